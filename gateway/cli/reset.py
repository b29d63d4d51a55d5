"""`gwrms reset`: ends a held stop."""

from gateway.amounts import NONE
from gateway.cli.connect import connect, parser
from gateway.cli.text import say, say_json, table, warn
from gateway.wire.stop import Reset

EPILOG = """Each drive is taken to "switch on disabled": a moving one is stopped first, a fault is reset, and
one that held its position releases it. Nothing is enabled: the controller or gwrms enable does
that. The stop stays held until every drive is known to be without current, and every controller
to be stopped; otherwise the reason is named."""


def main(argv: list[str]) -> int:
    """Run `gwrms reset`; 0 only when no stop is held any more and every drive is where it should be."""
    made = parser("reset", "End a held stop: every drive switched off, none enabled.", EPILOG)
    arguments = made.parse_args(argv)
    with connect(arguments, "reset") as robot:
        reset = robot.reset()
    if arguments.json:
        say_json(reset)
    else:
        say(_text(reset))
    return _verdict(reset)


def _text(reset: Reset) -> str:
    rows = [(name, state, reset.problems.get(name, "")) for name, state in reset.drives.items()]
    rows += [(name, NONE, why) for name, why in reset.problems.items() if name not in reset.drives]
    held = "The stop is STILL HELD." if reset.held else "No stop is held."
    return table(("OF", "STATE", "PROBLEM"), rows) + f"\n{held}\n"


def _verdict(reset: Reset) -> int:
    if reset.problems:
        what = "the stop is still held" if reset.held else "no stop is held, but"
        warn("reset", f"{what}: {'; '.join(f'{name}: {why}' for name, why in reset.problems.items())}")
    return 1 if reset.held or reset.problems else 0
