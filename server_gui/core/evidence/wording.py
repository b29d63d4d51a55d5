"""Edits and their metrics in words: the same in the command and in the window. Values are SI."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from gateway.amounts import NONE
from server_gui.core.evidence.comparison import Measured
from server_gui.core.evidence.edits import Edit

NO_UNITS: Final[Mapping[str, str]] = MappingProxyType({})


def changes(edit: Edit, units: Mapping[str, str] = NO_UNITS) -> str:
    """Each parameter, what from and to; `units` are those that the values are in, by parameter."""
    said = (f"{one.name} {from_to(one.old, one.new)} {units.get(one.name, '')}" for one in edit.changes)
    return ", ".join(one.rstrip() for one in said)


def from_to(old: float | None, new: float | None) -> str:
    """Both with as many decimal places: `0.40 → 0.43`."""
    texts = [number(old), number(new)]
    places = [len(text.partition(".")[2]) for text in texts]
    if old is not None and new is not None and all("e" not in text for text in texts):
        texts = [f"{value:.{max(places)}f}" for value in (old, new)]
    return " → ".join(texts)


def share(one: Measured) -> str:
    """The difference, in percent of what was before where that says something."""
    if one.difference is None:
        return NONE
    if not one.before or abs(one.difference / one.before) > 10.0:
        return f"{one.difference:+.3g}"
    return f"{one.difference / abs(one.before):+.1%}".replace("%", " %")


def number(value: float | None) -> str:
    """Four digits."""
    return NONE if value is None else f"{value:.4g}"
