"""Filter of the parameters: by words, and by kind."""

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QSize, QSortFilterProxyModel, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QButtonGroup, QGridLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.views.theme import Theme

Index = QModelIndex | QPersistentModelIndex
NAME_ROLE: Final = Qt.ItemDataRole.UserRole + 1
A_ROW: Final = 3  # of the kinds, where one row has no room


class Filter(QSortFilterProxyModel):
    """By words in name, object and unit, and by a set of names."""

    def __init__(self) -> None:
        super().__init__()
        self._words: list[str] = []
        self._names: frozenset[str] | None = None
        self.setRecursiveFilteringEnabled(True)

    def show(self, words: str, names: Iterable[str] | None) -> bool:
        """Show rows that match all words and are one of `names`; return whether the filter has changed."""
        wanted = words.lower().split(), None if names is None else frozenset(names)
        if wanted == (self._words, self._names):
            return False
        self._words, self._names = wanted
        self.invalidate()
        return True

    def filterAcceptsRow(self, row: int, parent: Index) -> bool:
        index = self.sourceModel().index(row, 0, parent)
        name = index.data(NAME_ROLE)
        if name is None:
            return False  # a group is shown for what is in it
        if self._names is not None and name not in self._names:
            return False
        text = f"{name} {index.data(Qt.ItemDataRole.ToolTipRole)}".lower()
        return all(word in text for word in self._words)


class FilterBar(QWidget):
    """Words, and one of the kinds with how many there are of each; `changed` when another is chosen."""

    changed = Signal()

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self.words = QLineEdit()
        self.words.setPlaceholderText("Filter: name, 0x6072, unit …   Ctrl+F")
        self.words.setClearButtonEnabled(True)
        self.words.setAccessibleName("Filter of the parameters")
        self.words.textChanged.connect(self.changed)
        self.buttons = {kind: QPushButton(kind) for kind in KINDS}
        self._group = QButtonGroup(self)
        for kind, button in self.buttons.items():
            button.setCheckable(True)
            button.setToolTip(_TIPS[kind])
            self._group.addButton(button)
        self._group.buttonClicked.connect(lambda _button: self.changed.emit())
        self.buttons["All"].setChecked(True)
        self._grid = QGridLayout()
        self._grid.setSpacing(4)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(0, 0, 0, 0)
        everything.addWidget(self.words)
        everything.addLayout(self._grid)
        self._columns = 0
        theme.scaled.connect(self._arrange)
        self._arrange()

    def refresh(self) -> Iterable[str] | None:
        """Show the numbers of each kind; return the names of the chosen one, None for all."""
        station = self._desk.selected
        chosen: Iterable[str] | None = None
        for kind, names_of in KINDS.items():
            names = () if station is None else names_of(self._desk, station)
            text = f"{kind} {len(names)}"
            if self.buttons[kind].text() != text:
                self.buttons[kind].setText(text)
                self._arrange()
            if self.buttons[kind].isChecked() and kind != "All":
                chosen = names
        return chosen

    def show_all(self) -> None:
        """Leave nothing out."""
        self.words.clear()
        self.buttons["All"].setChecked(True)

    def minimumSizeHint(self) -> QSize:
        """Size of the kinds in two rows."""
        wide = max(button.sizeHint().width() for button in self.buttons.values())
        return QSize(A_ROW * wide, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange()

    def _arrange(self) -> None:
        """In one row where that has room."""
        wide = sum(button.sizeHint().width() + self._grid.spacing() for button in self.buttons.values())
        columns = len(KINDS) if wide <= self.width() else A_ROW
        if columns != self._columns:
            self._columns = columns
            for place, button in enumerate(self.buttons.values()):
                self._grid.addWidget(button, place // columns, place % columns)


def _changed(_desk: Desk, station: Station) -> tuple[str, ...]:
    return tuple(station.edits.staged)


def _unlike_file(_desk: Desk, station: Station) -> tuple[str, ...]:
    return () if station.file is None else tuple(row.name for row in station.file.different)


def _unlike_default(_desk: Desk, station: Station) -> tuple[str, ...]:
    held = station.robot.parameters
    return tuple(
        name
        for name, info in station.known.items()
        if info.default is not None and name in held and held[name].value not in (None, info.default)
    )


def _pinned(desk: Desk, station: Station) -> tuple[str, ...]:
    return tuple(desk.pins.of(station.title) & station.known.keys())


KINDS: Final[Mapping[str, Callable[[Desk, Station], tuple[str, ...]]]] = {
    "All": lambda _desk, station: tuple(station.known),
    "Changed": _changed,
    "≠ file": _unlike_file,
    "≠ default": _unlike_default,
    "★": _pinned,
}
_TIPS: Final = {
    "All": "Every parameter that can be changed",
    "Changed": "Those with a staged edit",
    "≠ file": "Those that differ from the file that is open",
    "≠ default": "Those that differ from the default of the device's EDS",
    "★": "Those that are pinned (Ctrl+P pins the chosen one)",
}
