"""Edits and their metrics in words: the same in the command and in the window. Values are SI."""

from gateway.amounts import NONE
from server_gui.core.evidence.comparison import Measured
from server_gui.core.evidence.edits import Edit


def changes(edit: Edit) -> str:
    """Each parameter, what from and to."""
    return ", ".join(f"{one.name} {number(one.old)} → {number(one.new)}" for one in edit.changes)


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
