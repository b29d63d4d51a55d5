"""The doctor's report: for people as a page, for machines as an object."""

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from gateway.amounts import counted
from gateway.doctor.table import RULES
from gateway.doctor.verdicts import Finding, Fix, Unknown, Verdict

PAGE = 110
INDENT = "    "


def findings(verdicts: Sequence[Verdict]) -> list[Finding]:
    return [one for one in verdicts if isinstance(one, Finding)]


def unknowns(verdicts: Sequence[Verdict]) -> list[Unknown]:
    return [one for one in verdicts if isinstance(one, Unknown)]


def well(verdicts: Sequence[Verdict]) -> list[str]:
    """Rules that were judged, everywhere, and found nothing."""
    spoken = {one.rule for one in verdicts}
    return [rule.name for rule in RULES if rule.name not in spoken]


def as_text(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Yield the report: the findings first, each with its remedies.

    Then what could not be judged, then what is well.
    """
    for number, finding in enumerate(findings(verdicts), 1):
        yield f"{number}. {finding.about}: {finding.words} ({finding.rule})"
        yield from (f"{INDENT}{text}" for text in finding.evidence)
        for place, fix in enumerate(finding.fixes):
            yield f"{INDENT}{'fix:' if not place else 'or: '} {fix.words}"
        yield ""
    grouped: dict[tuple[str, str], list[str]] = {}
    for one in unknowns(verdicts):
        grouped.setdefault((one.rule, one.why), []).append(one.about)
    if grouped:
        yield "not judged:"
        for (rule, why), about in grouped.items():
            yield from _wrapped(f"{rule}, {', '.join(about)}: {why}")
        yield ""
    if names := well(verdicts):
        yield "no problem found:"
        yield from _wrapped(", ".join(names))
        yield ""
    yield summary(verdicts)


def summary(verdicts: Sequence[Verdict]) -> str:
    wrong, unknown = findings(verdicts), {one.rule for one in unknowns(verdicts)}
    told = counted(len(wrong), "finding") if wrong else "nothing wrong was found"
    passed = f"{len(well(verdicts))} of {counted(len(RULES), 'check')} passed"
    return f"{told}; {passed}, {len(unknown)} could not be completed"


def as_json(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Return the same for machines."""
    return {
        "findings": [
            {
                "rule": one.rule,
                "about": one.about,
                "words": one.words,
                "evidence": list(one.evidence),
                "fixes": [_fix(fix) for fix in one.fixes],
            }
            for one in findings(verdicts)
        ],
        "not_judged": [{"rule": one.rule, "about": one.about, "why": one.why} for one in unknowns(verdicts)],
        "well": well(verdicts),
    }


def _fix(fix: Fix) -> dict[str, Any]:
    return {"kind": type(fix).__name__.lower(), "words": fix.words}


def status(verdicts: Sequence[Verdict]) -> int:
    """0: nothing wrong was found; 1: something was; 2: nothing at all could be judged."""
    if findings(verdicts):
        return 1
    return 0 if well(verdicts) else 2


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(
        text, PAGE, initial_indent=INDENT, subsequent_indent=2 * INDENT, break_on_hyphens=False
    )
