"""A device's objects as a table: texts are made of what is in sight, when it is drawn."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt

from gateway.plain_text import plain
from gateway.wire.dictionary import ObjectInfo
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.objects.forms import for_reading
from server_gui.core.objects.reading import ReadValue
from server_gui.core.objects.rows import Compared, limits, pin_of
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import tip

Index = QModelIndex | QPersistentModelIndex
WHOSE: Final = re.compile(r"^.*?reading 0x[0-9A-Fa-f]+:\w+: (refused, )?| \(abort \w+\)$")  # its row, facts
TITLES: Final = (
    "Object",
    "Name",
    "Holds",
    "Age",
    "Default",
    "Type",
    "Access",
    "Parameter",
    "Limits",
    "Unit",
    "PDO",
)
OBJECT, NAME, HOLDS, AGE, OTHER, TYPE, ACCESS, PARAMETER, LIMITS, UNIT, PDO = range(len(TITLES))
LIVE: Final = (HOLDS, AGE, OTHER)  # that change by themselves
LONGEST: Final = 200  # letters of a cell: the chosen one's facts have them all


@dataclass(frozen=True, slots=True)
class ShownObjects:
    """One device's objects beside another's, and what of them is pinned or staged."""

    compared: Compared = field(default_factory=lambda: Compared("", {}))
    is_linked: bool = False
    pinned: Collection[str] = ()
    staged: Collection[str] = ()  # names of parameters

    def held(self, info: ObjectInfo) -> ReadValue | None:
        return self.compared.held.get((self.compared.component, info.object))

    def is_now(self, held: ReadValue) -> bool:
        """Return whether it may be called the present value."""
        return self.is_linked and not held.is_old(now_ns())


class ObjectsModel(QAbstractTableModel):
    """`rows` in their order; `shown` says beside what."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.rows: Sequence[ObjectInfo] = ()
        self.shown = ShownObjects()

    def take(self, rows: Sequence[ObjectInfo], shown: ShownObjects) -> bool:
        """Show these from now on; whether there are others than before."""
        before, self.shown = self.shown, shown
        if before.compared.title != shown.compared.title:
            self.headerDataChanged.emit(Qt.Orientation.Horizontal, OTHER, OTHER)
        if rows == self.rows:
            return False
        self.beginResetModel()
        self.rows = rows
        self.endResetModel()
        return True

    def changed(self, first: int, last: int) -> None:
        """Refresh the values of these."""
        if 0 <= first <= last < len(self.rows):
            self.dataChanged.emit(self.index(first, 0), self.index(last, len(TITLES) - 1))

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(TITLES)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation is not Qt.Orientation.Horizontal or role != Qt.ItemDataRole.DisplayRole:
            return None
        with_component = self.shown.compared.with_component
        return self.shown.compared.title if section == OTHER and with_component else TITLES[section]

    def data(self, index: Index, role: int = 0) -> Any:
        info, column = self.rows[index.row()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return self.text(info, column)
            case Qt.ItemDataRole.ToolTipRole:
                return tip(_TEXTS[column](self.shown, info))
            case Qt.ItemDataRole.ForegroundRole:
                return self._theme.colour(self._ink(info, column))
            case Qt.ItemDataRole.FontRole if column in (OBJECT, HOLDS, OTHER, LIMITS):
                return self._theme.number_font()
            case Qt.ItemDataRole.BackgroundRole if info.parameter in self.shown.staged:
                return self._theme.colour("staged")
        return None

    def text(self, info: ObjectInfo, column: int) -> str:
        """Return the text of a cell."""
        text = plain(_TEXTS[column](self.shown, info))
        return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"

    def _ink(self, info: ObjectInfo, column: int) -> str:
        if column in (HOLDS, AGE):
            held = self.shown.held(info)
            if held is None or not self.shown.is_now(held):
                return "old"
            if held.told.problem is None or column == AGE:
                return "text"
            return "dim" if info.type == "DOMAIN" or info.access == "wo" else "warn"  # so it is always
        if column == OTHER:
            return "warn" if self.shown.compared.differs(info) else "dim"
        return "dim" if column == PARAMETER and info.read_only is not None else "text"


def age_text(seconds: float) -> str:
    """Return an age in the largest unit that gives about two digits."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


def _name(shown: ShownObjects, info: ObjectInfo) -> str:
    return f"★ {info.name}" if pin_of(shown.compared.component, info.object) in shown.pinned else info.name


def _holds(shown: ShownObjects, info: ObjectInfo) -> str:
    held = shown.held(info)
    if held is None or held.told.problem is None:
        return "–" if held is None else for_reading(info, held.told.words)
    return WHOSE.sub("", held.told.problem)


def _age(shown: ShownObjects, info: ObjectInfo) -> str:
    held = shown.held(info)
    return "" if held is None else age_text(held.age_s(now_ns()))


def _other(shown: ShownObjects, info: ObjectInfo) -> str:
    other = shown.compared.other(info)
    if other is None:
        return "–"
    mark = "≠ " if shown.compared.differs(info) else ""
    return f"{mark}{for_reading(info, _as_beside(_holds(shown, info), other))}"


def _as_beside(words: str, other: float | str) -> str:
    """In hexadecimal where the value beside it is."""
    is_hex = words.startswith("0x") and isinstance(other, int) and other >= 0
    return f"0x{other:X}" if is_hex else str(other)


def _parameter(shown: ShownObjects, info: ObjectInfo) -> str:
    if info.read_only is not None or info.parameter is None:
        return info.read_only or ""
    return f"● {info.parameter}" if info.parameter in shown.staged else info.parameter


_TEXTS: Final[tuple[Callable[[ShownObjects, ObjectInfo], str], ...]] = (
    lambda _shown, info: info.object,
    _name,
    _holds,
    _age,
    _other,
    lambda _shown, info: info.type,
    lambda _shown, info: info.access,
    _parameter,
    lambda _shown, info: limits(info),
    lambda _shown, info: info.unit,
    lambda _shown, info: " ".join(info.pdos),
)
WIDEST: Final[Mapping[int, int]] = {HOLDS: 260, OTHER: 150, PARAMETER: 220, LIMITS: 200, UNIT: 90, PDO: 110}
