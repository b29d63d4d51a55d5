"""Storing to flash: what it is, of which device, what it would keep, and why it cannot be done now."""

from typing import Final

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.edits import unit_of
from server_gui.core.tuning.storing import Storable, objection, storable
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import PlainLabel

SETTLE_MS: Final = 400  # a click that was meant for what stood there before does not count
TITLES: Final = ("Parameter", "Robot", "Unit", "Stored")
EXPLAINED: Final = (
    "<b>Write</b> changes a device's memory: in force at once, gone with its power. <b>Store</b> copies all "
    "of a device's parameters from memory to its flash, so that they come back with its power: those below, "
    "and whatever else it holds, whoever has changed it. A flash wears out: store what has proved itself."
)


class StorePage(QWidget):
    """`store` brings a component of each device that is to store, `back` leaves."""

    store = Signal(tuple)
    back = Signal()

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._devices: list[Storable] = []
        self._settled = QTimer(self, singleShot=True)
        self._settled.timeout.connect(self.refresh)
        title = PlainLabel("Store to flash")
        title.setObjectName("title")
        explained = QLabel(EXPLAINED)
        explained.setWordWrap(True)
        self.device = QComboBox()
        self.device.setAccessibleName("Device that is to store")
        self.device.currentIndexChanged.connect(self._settle)
        self.table = self._table()
        self.said = PlainLabel()
        self.said.setObjectName("banner")
        self.said.setWordWrap(True)
        back = QPushButton("Back")
        back.setShortcut("Esc")
        back.clicked.connect(self.back)
        self.store_it = QPushButton("Store")
        self.store_it.setObjectName("primary")
        self.store_it.clicked.connect(self._store)
        row = QHBoxLayout()
        row.addWidget(back)
        row.addStretch(1)
        row.addWidget(self.store_it)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(0, 0, 0, 0)
        for widget in (title, explained, self.device):
            everything.addWidget(widget)
        everything.addWidget(self.table, 1)
        everything.addWidget(self.said)
        everything.addLayout(row)

    def begin(self, component: str | None) -> None:
        """Offer the devices of the robot that is looked at, first that of `component`."""
        station = self._desk.selected
        description = None if station is None else station.robot.description
        self._devices = [] if description is None else storable(description)
        self.device.blockSignals(True)
        self.device.clear()
        self.device.addItems([device.title for device in self._devices])
        if len(self._devices) > 1:
            self.device.addItem(f"all {len(self._devices)} devices, one after another")
        places = [place for place, device in enumerate(self._devices) if component in device.components]
        self.device.setCurrentIndex(places[0] if places else 0)
        self.device.blockSignals(False)
        self._settle()

    def refresh(self) -> None:
        """Show how it is now."""
        station, chosen = self._desk.selected, self._chosen
        rows = [] if station is None else [row for one in chosen for row in _rows(self._desk, station, one)]
        self.table.setRowCount(len(rows))
        for place, texts in enumerate(rows):
            self._fill(place, texts)
        why, tone = self._state(station, chosen)
        set_text(self.said, why)
        if self.said.property("tone") != tone:
            self.said.setProperty("tone", tone)
            self.said.style().polish(self.said)
        self.store_it.setEnabled(tone != "bad" and not self._settled.isActive())
        names = [one.title for one in chosen]
        text = f"Store {names[0]}" if len(names) == 1 else f"Store all {len(names)}" if names else "Store"
        if self.store_it.text() != text:
            self.store_it.setText(text)

    @property
    def _chosen(self) -> list[Storable]:
        place = self.device.currentIndex()
        return self._devices[place : place + 1] if place < len(self._devices) else self._devices

    def _settle(self) -> None:
        self._settled.start(SETTLE_MS)
        self.refresh()

    def _store(self) -> None:
        if self._chosen:
            self.store.emit(tuple(one.components[0] for one in self._chosen))

    def _state(self, station: Station | None, chosen: list[Storable]) -> tuple[str, str]:
        """Return the notes before storing, and whether it is possible."""
        if station is None or not chosen:
            return "No device of this robot can store its parameters (1010h).", "bad"
        trial = station.writing.trial
        objections = dict.fromkeys(objection(one, station.robot, trial) or "" for one in chosen)
        why_not = "\n".join(filter(None, objections))
        if not station.is_linked or why_not:
            return why_not or "There is no link to the robot.", "bad"
        staged = [name for name in station.edits.staged if any(name in one.parameters for one in chosen)]
        if staged:
            return f"{', '.join(staged)}: staged and not written, so not stored. Write first.", "warn"
        return "Values are compared before and after; the journal shows who stored.", "good"

    def _table(self) -> QTableWidget:
        table = QTableWidget(0, len(TITLES))
        table.setHorizontalHeaderLabels(TITLES)
        table.setAccessibleName("What the device would keep")
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        table.verticalHeader().hide()
        table.setShowGrid(False)
        for column in range(1, len(TITLES)):
            table.horizontalHeader().setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        table.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        return table

    def _fill(self, row: int, texts: tuple[str, ...]) -> None:
        for column, text in enumerate(texts):
            item = self.table.item(row, column)
            if item is None:
                item = QTableWidgetItem()
                self.table.setItem(row, column, item)
                if column == 1:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            if item.text() != text:
                item.setText(text)


def _rows(desk: Desk, station: Station, device: Storable) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name in device.parameters:
        held, unit = (
            station.robot.parameters.get(name),
            unit_of(name, station.known[name].unit, desk.shown.units),
        )
        value = "–" if held is None or held.value is None else unit.editable(held.value)
        rows.append((name, value, unit.symbol, "yes" if station.is_stored(name) else "unknown"))
    return rows
