"""A scenario's result as a table that a person reads."""

from hil_sim.scenario.runner import Outcome
from hil_sim.scenario.script import Script


def text(script: Script, outcome: Outcome) -> str:
    """Return a line for each expectation; what was seen stands below those that failed."""
    lines = [script.title]
    for verdict in outcome.verdicts:
        lines.append(f"  {'ok    ' if verdict.ok else 'FAILED'}  {verdict.expected}")
        lines.append(f"          {verdict.seen}")
    failed = sum(not verdict.ok for verdict in outcome.verdicts)
    lines.append(
        f"{failed} of {len(outcome.verdicts)} expectations failed"
        if failed
        else f"all {len(outcome.verdicts)} expectations met"
    )
    if outcome.skipped_s:
        lines.append(
            f"This computer was too slow: {outcome.skipped_s:.1f} s were left out. Times may be off by that."
        )
    return "\n".join(lines) + "\n"
