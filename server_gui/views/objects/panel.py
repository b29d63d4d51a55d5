"""Objects: the dictionary of a device, searched, read while it is looked at, compared, saved; never written.

What may be written is a parameter, and is staged, reviewed and written where parameters are.
"""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QGridLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gateway.wire.dictionary import OBJECT_READ, ObjectInfo
from gateway.wire.parameter import PARAMETER_WRITE
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.news import NewsKind
from server_gui.core.objects.devices import Device, device_of, devices
from server_gui.core.objects.facts import facts
from server_gui.core.objects.objects import NO_EDS, Dictionary
from server_gui.core.objects.reading import Object
from server_gui.core.objects.rows import BY_EDS, CSV_TITLES, Compared, Finder, Kind, cells, pin_of
from server_gui.core.tuning.edits import unit_of
from server_gui.views.objects.facts_card import FactsCard
from server_gui.views.objects.objects_model import Shown
from server_gui.views.objects.objects_table import ObjectsTable
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.files import ask_save, save_whole
from server_gui.views.widgets.fitted import FittedLabel
from server_gui.views.widgets.plain import PlainLabel, set_tip

READ: Final = 6  # frames between two looks
BUTTON: Final = 104  # px at text of 100 % that one needs
READ_ALL, READ_NO_MORE = "Read all", "Stop reading"
TIPS: Final = {
    Kind.ALL: "Every object of the device's EDS",
    Kind.PARAMETERS: "Those that may be written: parameters",
    Kind.DIFFERENT: "Those that were read, and hold something else than what they are compared with",
    Kind.PINNED: "Those that are pinned (Ctrl+P pins the chosen one)",
}
LOST: Final = "The robot is not linked: what is shown is as old as it says."
NO_DEVICE: Final = f"This robot has no CANopen device with an EDS. {NO_EDS}"
ASKING: Final = "Asking for the objects of its EDS …"


class ObjectsPage(QWidget):
    """`edited` brings the name of a parameter that somebody wants to change."""

    edited = Signal(str)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._frame = 0
        self._devices: Sequence[Device] = ()
        self._chosen: dict[str, str] = {}  # by robot, the component that is looked at
        self._columns = 0  # of buttons, for the room that there is
        self._finder = Finder()
        self.setObjectName("page")
        self.device, self.other = _combo("Device"), _combo("Compare with")
        set_tip(self.other, "What is beside it: the default of its EDS, or what another device holds")
        self.words = QLineEdit()
        self.words.setPlaceholderText("Search: 0x6041, 0x60*, 0x6060-0x607F, words …")
        self.words.setClearButtonEnabled(True)
        self.words.setAccessibleName("Search of the objects")
        self.kinds = {kind: QPushButton(kind.value) for kind in Kind}
        self.all = QPushButton(READ_ALL)
        self.export = QPushButton("CSV …")
        set_tip(self.all, "Every object once, some hundred a second at most; goes on while this is shown")
        set_tip(self.export, "All that was read of this device, with every digit")
        self.count = FittedLabel("dim")
        self.said = PlainLabel()
        self.said.setObjectName("banner")
        self.said.setWordWrap(True)
        self.table, self.facts = ObjectsTable(theme), FactsCard(theme)
        self._build()
        self._connect()

    def refresh(self) -> None:
        """Show how it is now, and ask for what is in sight; called each frame while the tab is visible."""
        self._frame += 1
        if self._frame % READ == 1:
            self.look()

    def look(self) -> None:
        """Do so at once."""
        station = self._desk.selected
        self._arrange()
        if station is None:
            return
        description = station.robot.description
        self._devices = () if description is None else devices(description)
        self._offer(station)
        device = self._device(station)
        dictionary = Dictionary() if device is None else self._dictionary(station, device)
        compared = self._compared(station, device)
        self._show_rows(station, device, dictionary, compared)
        self._say(station, device, dictionary)
        self._show_facts(station, compared)
        if station.is_linked and device is not None and not self.window().isMinimized():
            wanted, still = self._wanted(station, dictionary, compared)
            station.objects.reading.look(wanted, still)

    def save_csv(self, path: Path) -> None:
        """Save all that was read of the device."""
        station = self._desk.selected
        device = None if station is None else self._device(station)
        if station is None or device is None:
            return
        compared = self._compared(station, device)
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(CSV_TITLES)
            writer.writerows(cells(station.objects.of(device.component).objects, compared))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange()

    # --- how it is put together

    def _build(self) -> None:
        self._group = QButtonGroup(self)
        for kind, button in self.kinds.items():
            button.setCheckable(True)
            set_tip(button, TIPS[kind])
            self._group.addButton(button)
        self.kinds[Kind.ALL].setChecked(True)
        self._above = QGridLayout()
        self._above.setSpacing(4)
        self._buttons = QGridLayout()
        self._buttons.setSpacing(4)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addLayout(self._above)
        everything.addWidget(self.words)
        everything.addLayout(self._buttons)
        everything.addWidget(self.count)
        everything.addWidget(self.said)
        everything.addWidget(self.table, 1)
        everything.addWidget(self.facts)
        self._arrange()

    def _arrange(self) -> None:
        outside: QWidget | None = self.parentWidget()  # of the room itself this may be wider
        room = (outside or self).width()
        columns = max(1, room // self._theme.px(BUTTON))
        if columns == self._columns:
            return
        self._columns = columns
        buttons = (*self.kinds.values(), self.all, self.export)
        for grid, widgets, most in (
            (self._above, (self.device, self.other), columns // 2),
            (self._buttons, buttons, columns),
        ):
            for place, widget in enumerate(widgets):
                row, column = divmod(place, min(max(most, 1), len(widgets)))
                grid.addWidget(widget, row, column)
        self.facts.arrange(min(columns, len(self.facts.buttons)))

    def _connect(self) -> None:
        self.device.activated.connect(self._choose_device)
        self.other.activated.connect(lambda _place: self.look())
        self.words.textChanged.connect(lambda _text: self.look())
        self._group.buttonClicked.connect(lambda _button: self.look())
        self.all.clicked.connect(self._read_all)
        self.export.clicked.connect(self._ask_where)
        self.table.chosen.connect(self._look_at_chosen)
        self.table.copied.connect(self.facts.copy_address)
        for part in (self.table, self.facts):
            part.pinned.connect(self._pin)
        self.table.wanted.connect(self._edit)
        self.facts.edited.connect(self._edit)
        self._theme.scaled.connect(self._rearrange)
        self._desk.on_select.append(lambda _station: self._forget_choice())

    def _rearrange(self) -> None:
        self._columns = 0
        self._arrange()

    def _forget_choice(self) -> None:
        self._frame = 0  # what another robot has is shown with the next frame

    # --- what people do

    def _choose_device(self, place: int) -> None:
        station = self._desk.selected
        if station is not None and 0 <= place < len(self._devices):
            self._chosen[station.name] = self._devices[place].component
            station.objects.reading.read_once(())
            self.look()

    def _read_all(self) -> None:
        station = self._desk.selected
        device = None if station is None else self._device(station)
        if station is None or device is None:
            return
        reading = station.objects.reading
        compared = self._compared(station, device)
        wanted = self._of_both(station, station.objects.of(device.component).objects, compared)
        reading.read_once(() if reading.left else wanted)
        self.look()

    def _look_at_chosen(self) -> None:
        station = self._desk.selected
        if station is not None:
            self._show_facts(station, self._compared(station, self._device(station)))

    def _pin(self) -> None:
        station, current = self._desk.selected, self.table.current
        device = None if station is None else self._device(station)
        if station is not None and device is not None and current is not None:
            self._desk.pins.toggle(station.title, pin_of(device.component, current.object))
            self.look()

    def _edit(self) -> None:
        """Where it is a parameter that may be changed here, stage it where parameters are staged."""
        station, current = self._desk.selected, self.table.current
        if station is None or current is None or current.parameter is None:
            return
        if not self._refused(station, current):
            self.edited.emit(current.parameter)

    def _ask_where(self) -> None:
        station = self._desk.selected
        device = None if station is None else self._device(station)
        if station is not None and device is not None:
            name = f"{station.title}-{device.component}"
            ask_save(self, "Export as CSV", "csv", self._export, name)

    def _export(self, path: Path) -> None:
        self._desk.news.add(NewsKind.STATE, "objects", save_whole(self.save_csv, path))

    # --- what is shown

    def _device(self, station: Station) -> Device | None:
        wanted = self._chosen.get(station.name, "")
        return device_of(self._devices, wanted) or next(iter(self._devices), None)

    def _dictionary(self, station: Station, device: Device) -> Dictionary:
        """Nothing is asked while there is nobody to ask, so that what is known stays shown."""
        return station.objects.of(device.component, ask=station.is_linked)

    def _compared(self, station: Station, device: Device | None) -> Compared:
        place = self.other.currentIndex()
        other = self.other.itemData(place) if place > 0 else None
        component = "" if device is None else device.component
        return Compared(component, station.objects.reading.held, other if isinstance(other, str) else None)

    def _offer(self, station: Station) -> None:
        device = self._device(station)
        _fill(self.device, [(one.title, one.component) for one in self._devices])
        if device is not None:
            self.device.setCurrentIndex(self._devices.index(device))
        others = [(one.title, one.component) for one in self._devices if one is not device]
        _fill(self.other, [(BY_EDS, None), *others])

    def _show_rows(
        self, station: Station, device: Device | None, dictionary: Dictionary, compared: Compared
    ) -> None:
        pinned = self._desk.pins.of(station.title)
        revision = station.objects.reading.revision
        kinds = self._finder.find(dictionary, self.words.text(), compared, pinned, revision)
        for kind, button in self.kinds.items():
            text = f"{kind.value} {len(kinds[kind])}"
            if button.text() != text:
                button.setText(text)
        kind = next(kind for kind, button in self.kinds.items() if button.isChecked())
        shown = Shown(compared, station.is_linked, pinned, station.edits.staged.keys())
        component = None if device is None else device.component
        measured = (station, component, dictionary.revision, compared.with_component)
        self.table.take(kinds[kind], shown, measured)

    def _say(self, station: Station, device: Device | None, dictionary: Dictionary) -> None:
        reading = station.objects.reading
        problem = dictionary.problem or reading.problem
        if not station.is_linked:
            text = LOST
        elif station.robot.description is None:
            text = "The robot has not described itself yet."
        elif device is None:
            text = NO_DEVICE
        else:
            text = problem or ""
        set_text(self.said, text)
        self.said.setVisible(bool(text))
        component = "" if device is None else device.component
        read = sum((component, one.object) in reading.held for one in dictionary.objects)
        left = f", {len(reading.left)} to read" if reading.left else ""
        known = f"{len(dictionary.objects)} objects, {read} read{left}"
        self.count.say(
            known if dictionary.objects or problem or device is None else ASKING, f"{read} read{left}"
        )
        set_text_of(self.all, READ_NO_MORE if reading.left else READ_ALL)
        refused = station.refused(OBJECT_READ)
        self.all.setEnabled(station.is_linked and bool(dictionary.objects) and not refused)
        self.export.setEnabled(read > 0)

    def _show_facts(self, station: Station, compared: Compared) -> None:
        info = self.table.current
        if info is None:
            self.facts.show_object(None, compared.component, (), "choose an object")
            return
        parameter = station.known.get(info.parameter or "")
        unit = None
        if parameter is not None:
            unit = unit_of(parameter.name, parameter.unit, self._desk.shown.units)
        refused = self._refused(station, info)
        said = facts(info, compared, parameter, unit, refused, is_linked=station.is_linked)
        self.facts.show_object(info, compared.component, said, refused)

    def _refused(self, station: Station, info: ObjectInfo) -> str:
        """Why it cannot be changed here; empty where it can."""
        if info.read_only is not None or info.parameter not in station.known:
            return info.locked or info.read_only or "it is no parameter that may be changed"
        return station.refused(PARAMETER_WRITE)

    # --- what is asked

    def _wanted(
        self, station: Station, dictionary: Dictionary, compared: Compared
    ) -> tuple[list[Object], list[Object]]:
        """What is chosen or in sight, here and on the device beside it; and what of it never changes."""
        current = self.table.current
        shown = [*([] if current is None else [current]), *self.table.in_sight]
        still = [(compared.component, address) for address in dictionary.still]
        return self._of_both(station, shown, compared), still

    def _of_both(self, station: Station, infos: Iterable[ObjectInfo], compared: Compared) -> list[Object]:
        addresses = [info.object for info in infos]
        wanted = [(compared.component, address) for address in addresses]
        if compared.with_component is not None:
            there = station.objects.of(compared.with_component).addresses
            wanted += [(compared.with_component, one) for one in addresses if one in there]
        return wanted


def set_text_of(button: QPushButton, text: str) -> None:
    """Change a button only where it says something else."""
    if button.text() != text:
        button.setText(text)


def _combo(name: str) -> QComboBox:
    combo = QComboBox()
    combo.setAccessibleName(name)
    combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    combo.setMinimumContentsLength(8)
    return combo


def _fill(combo: QComboBox, entries: Sequence[tuple[str, str | None]]) -> None:
    """Offer these; what is chosen stays, where it still is there."""
    if [combo.itemText(place) for place in range(combo.count())] == [title for title, _ in entries]:
        return
    chosen = combo.currentData()
    combo.blockSignals(True)
    combo.clear()
    for title, component in entries:
        combo.addItem(title, component)
    combo.setCurrentIndex(max(0, combo.findData(chosen)))
    combo.blockSignals(False)
