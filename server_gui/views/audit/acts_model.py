"""The audit's lines as a table: a line is known by its robot, entry and thing, and is never made anew."""

import datetime
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from PySide6.QtCore import Qt

from gateway.plain_text import plain
from gateway.units import Unit
from gateway.wire.method import Number
from server_gui.core.audit.acts import Act
from server_gui.core.tuning.edits import brief
from server_gui.views.parameters.tree import exact
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import tip
from server_gui.views.widgets.rows import SORT_ROLE, Index, RowsModel

TITLES: Final = (
    "Time",
    "Robot",
    "What",
    "Of",
    "What came of it",
    "Old",
    "New",
    "Read back",
    "Unit",
    "Who",
    "Told by",
)
TIME, ROBOT, WHAT, THING, OUTCOME, OLD, NEW, READ_BACK, UNIT, WHO, TOLD_BY = range(len(TITLES))
NUMBERS: Final = (OLD, NEW, READ_BACK)
BAD: Final = ("NOT ", "FAILED", "refused", "write taken back")  # in an outcome that is looked at first


@dataclass(frozen=True, slots=True)
class ActRow:
    """One act on one robot, the unit that its values are shown in, and who tells of it: robot or store."""

    robot: str
    act: Act
    unit: Unit
    told_by: str

    @property
    def key(self) -> tuple[str, str, str]:
        return self.robot, self.act.hash, self.act.thing


class ActsModel(RowsModel[ActRow]):
    """Each robot's lines, oldest first."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(TITLES, lambda line: line.key, (TIME,))
        self._theme = theme

    def data(self, index: Index, role: int = 0) -> Any:
        line, column = self.rows[index.row()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return plain(_TEXTS[column](line))
            case Qt.ItemDataRole.ToolTipRole:
                return tip(_tip(line))
            case Qt.ItemDataRole.TextAlignmentRole if column in NUMBERS:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.ForegroundRole if column == OUTCOME and _is_bad(line.act):
                return self._theme.colour("bad")
            case _ if role == SORT_ROLE:
                return _sort_key(line, column)
        return None


def _is_bad(act: Act) -> bool:
    return any(word in act.outcome for word in BAD)


def _when(line: ActRow) -> str:
    when = datetime.datetime.fromtimestamp(line.act.utc_ns / 1e9, datetime.UTC).astimezone()
    return f"{when:%Y-%m-%d %H:%M:%S}"


def _number(line: ActRow, value: Number | None) -> str:
    return "" if value is None else brief(line.unit, value)


def _tip(line: ActRow) -> str:
    """Return every digit, and where it stands in the journal."""
    act, unit = line.act, line.unit
    known = {"old": act.old, "new": act.new, "read back": act.read_back}
    values = (
        f"{name} {exact(unit, value)} {unit.symbol}" for name, value in known.items() if value is not None
    )
    return "\n".join((*values, act.outcome, f"entry {act.n} of the journal, told by the {line.told_by}"))


_TEXTS: Final[tuple[Callable[[ActRow], str], ...]] = (
    _when,
    lambda line: line.robot,
    lambda line: line.act.what,
    lambda line: line.act.thing,
    lambda line: line.act.outcome,
    lambda line: _number(line, line.act.old),
    lambda line: _number(line, line.act.new),
    lambda line: _number(line, line.act.read_back),
    lambda line: line.unit.symbol if line.act.new is not None else "",
    lambda line: line.act.who,
    lambda line: line.told_by,
)


def _sort_key(line: ActRow, column: int) -> int | float | str:
    numbers = {OLD: line.act.old, NEW: line.act.new, READ_BACK: line.act.read_back}
    if column == TIME:
        return line.act.utc_ns
    if column in numbers:
        value = numbers[column]
        return float("-inf") if value is None else value
    return _TEXTS[column](line).lower()
