"""Edits and their metrics in words: the same in the command and in the window. Values are SI."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from gateway.amounts import NONE, counted
from server_gui.core.evidence.comparison import FEWEST, Evidence, Measured, Word
from server_gui.core.evidence.edits import Edit, EditState
from server_gui.core.evidence.file import EditEvidence

PERCENT: Final = "%"
POINTS: Final = " points"  # of a percentage: from 10 to 15 % it is 5 more, and not 50 %
MOST_SHARE: Final = 10.0  # times what was before, which else was next to nothing
NO_UNITS: Final[Mapping[str, str]] = MappingProxyType({})


def changes(edit: Edit, units: Mapping[str, str] = NO_UNITS, name: Callable[[str], str] = str) -> str:
    """Return each parameter, by its `name`, what from and to.

    `units` are those that the values are in, by parameter.
    """
    said = (f"{name(one.name)} {from_to(one.old, one.new)} {units.get(one.name, '')}" for one in edit.changes)
    return ", ".join(one.rstrip() for one in said)


def from_to(old: float | None, new: float | None) -> str:
    """Return both with as many decimal places: `0.40 → 0.43`."""
    texts = [number(old), number(new)]
    places = [len(text.partition(".")[2]) for text in texts]
    if old is not None and new is not None and all("e" not in text for text in texts):
        texts = [f"{value:.{max(places)}f}" for value in (old, new)]
    return " → ".join(texts)


def share(one: Measured) -> str:
    """Return the difference, in percent of what was before where that says something."""
    if one.difference is None:
        return NONE
    if not _is_share(one):
        return f"{one.difference:+.3g}{POINTS if one.unit == PERCENT else ''}"
    return f"{one.difference / abs(one.before or 1.0):+.1%}".replace("%", " %")


def _is_share(one: Measured) -> bool:
    """Return whether a percentage of the value before makes sense: not of almost nothing, or of percents."""
    ends = (abs(end or 0.0) for end in (one.difference, one.low, one.high))
    return bool(one.before) and one.unit != PERCENT and max(ends) <= MOST_SHARE * abs(one.before or 0.0)


def interval(one: Measured) -> str:
    """Return the 95 % interval of `share`, in the same kind.

    Percent beside percent, else in the metric's unit.
    """
    if one.low is None or one.high is None:
        return NONE
    if not _is_share(one):
        unit = POINTS if one.unit == PERCENT else f" {one.unit}"
        return f"{one.low:+.3g} to {one.high:+.3g}{unit}".rstrip()
    low, high = (100.0 * end / abs(one.before or 1.0) for end in (one.low, one.high))
    return f"{low:+.1f} to {high:+.1f} %"


def word(told: EditEvidence) -> str:
    """Return the judgement of an edit, and its tense: past for an edit that has ended."""
    found = told.evidence.word
    if told.edit.state in (EditState.REVERTED, EditState.TAKEN_OVER) and told.experiment is None:
        return f"was {found}" if found in (Word.BETTER, Word.WORSE, Word.MIXED) else str(found)
    return str(found) if told.is_final else f"{found} so far"


def strides(evidence: Evidence) -> str:
    """Return the numbers of compared strides; those since the revert have the old values, too.

    Where they are not enough, also how many it takes.
    """
    before, after, back = evidence.cycles_before, evidence.cycles_after, evidence.cycles_back
    old = f"{before - back} before it, {back} since it was taken back" if back else f"{before} before it"
    said = f"{counted(after, 'gait cycle')} with it, {old}"
    if evidence.word is not Word.FEW or min(before, after) >= 2 * FEWEST:
        return said
    return f"{said}; it takes {FEWEST} of each leg, with and without it"


def number(value: float | None) -> str:
    """Four digits."""
    return NONE if value is None else f"{value:.4g}"
