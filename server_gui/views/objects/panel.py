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
    QVBoxLayout,
    QWidget,
)

from gateway.wire.dictionary import OBJECT_READ, ObjectInfo
from gateway.wire.parameter import PARAMETER_WRITE
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.follow.news import NewsKind
from server_gui.core.objects.devices import Device, device_of, devices
from server_gui.core.objects.facts import facts
from server_gui.core.objects.objects import NO_EDS, Dictionary
from server_gui.core.objects.reading import Object
from server_gui.core.objects.rows import CSV_TITLES, Compared, Finder, cells, pin_of
from server_gui.core.tuning.edits import unit_of
from server_gui.views.objects.choice_bar import ChoiceBar
from server_gui.views.objects.facts_card import FactsCard
from server_gui.views.objects.objects_model import ShownObjects
from server_gui.views.objects.objects_table import ObjectsTable
from server_gui.views.refresh_rate import READ_NS
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.files import ask_save, save_whole
from server_gui.views.widgets.plain import PlainLabel
from server_gui.views.widgets.shrinking_label import ShrinkingLabel

READ: Final = 6  # frames between two looks
LOST: Final = "The robot is not linked: each value has its age."
NO_DEVICE: Final = f"This robot has no CANopen device with an EDS. {NO_EDS}"
ASKING: Final = "Asking for the objects of its EDS …"


class ObjectsPage(QWidget):
    """`edited` brings the name of a parameter that somebody wants to change."""

    edited = Signal(str)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._frame, self._looked_ns = 0, 0
        self._devices: Sequence[Device] = ()
        self._chosen: dict[str, str] = {}  # by robot, the component that is looked at
        self._finder = Finder()
        self.setObjectName("page")
        self.bar = ChoiceBar(theme)
        self.count = ShrinkingLabel("dim")
        self.said = PlainLabel()
        self.said.setObjectName("banner")
        self.said.setWordWrap(True)
        self.table, self.facts = ObjectsTable(theme), FactsCard(theme)
        self._build()
        self._connect()

    def refresh(self) -> None:
        """Show how it is now, and ask for what is in sight; called each frame while the tab is visible."""
        self._frame += 1
        if self._frame % READ == 1 or now_ns() - self._looked_ns >= READ_NS:
            self.look()

    def look(self) -> None:
        """Do so at once."""
        self._looked_ns = now_ns()
        station = self._desk.selected
        self._arrange()
        if station is None:
            return
        description = station.robot.description
        self._devices = () if description is None else devices(description)
        device = self._device(station)
        self.bar.offer(self._devices, device)
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
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        for widget in (self.bar, self.count, self.said):
            everything.addWidget(widget)
        everything.addWidget(self.table, 1)
        everything.addWidget(self.facts)
        self._arrange()

    def _arrange(self) -> None:
        outside: QWidget | None = self.parentWidget()  # of the room itself this may be wider
        self.facts.arrange(self.bar.arrange((outside or self).width()))

    def _connect(self) -> None:
        self.bar.picked.connect(self._choose_device)
        self.bar.changed.connect(self.look)
        self.bar.all.clicked.connect(self._read_all)
        self.bar.export.clicked.connect(self._ask_where)
        self.table.chosen.connect(self._look_at_chosen)
        self.table.copied.connect(self.facts.copy_address)
        for part in (self.table, self.facts):
            part.pinned.connect(self._pin)
        self.table.wanted.connect(self._edit)
        self.facts.edited.connect(self._edit)
        self._theme.scaled.connect(self._arrange)
        self._desk.on_select.append(lambda _station: self._forget_choice())

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
            self._frame = 0  # and is asked for with the next frame

    def _pin(self) -> None:
        station, current = self._desk.selected, self.table.current
        device = None if station is None else self._device(station)
        if station is not None and device is not None and current is not None:
            self._desk.pins.toggle(station.title, pin_of(device.component, current.object))
            self.look()

    def _edit(self) -> None:
        """Stage it with the other parameters, if it is one that may be changed here."""
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
        component = "" if device is None else device.component
        return Compared(component, station.objects.reading.held, self.bar.beside)

    def _show_rows(
        self, station: Station, device: Device | None, dictionary: Dictionary, compared: Compared
    ) -> None:
        pinned = self._desk.pins.of(station.title)
        reading = station.objects.reading
        kinds = self._finder.find(dictionary, self.bar.words.text(), compared, pinned, reading.revision)
        self.bar.count(kinds, is_reading=bool(reading.left))
        shown = ShownObjects(compared, station.is_linked, pinned, station.edits.staged.keys())
        component = None if device is None else device.component
        measured = (station, component, dictionary.revision, compared.with_component)
        self.table.take(kinds[self.bar.kind], shown, measured)

    def _say(self, station: Station, device: Device | None, dictionary: Dictionary) -> None:
        reading, known = station.objects.reading, len(dictionary.objects)
        text = _trouble(station, device, dictionary)
        set_text(self.said, text)
        self.said.setVisible(bool(text))
        component = "" if device is None else device.component
        read = sum((component, one.object) in reading.held for one in dictionary.objects)
        left = f", {len(reading.left)} to read" if reading.left else ""
        is_asking = device is not None and not known and not text
        self.count.say(ASKING if is_asking else f"{known} objects, {read} read{left}", f"{read} read{left}")
        may_read = not station.refused(OBJECT_READ)
        self.bar.all.setEnabled(station.is_linked and known > 0 and may_read)
        self.bar.export.setEnabled(read > 0)

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
        """Return why it cannot be changed here; empty if it can."""
        if info.read_only is not None or info.parameter not in station.known:
            return info.locked or info.read_only or "it is not a parameter that may be changed"
        return station.refused(PARAMETER_WRITE)

    # --- what is asked

    def _wanted(
        self, station: Station, dictionary: Dictionary, compared: Compared
    ) -> tuple[list[Object], list[Object]]:
        """Return the chosen and visible objects, here and on the device beside it.

        And what of it never changes.
        """
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


def _trouble(station: Station, device: Device | None, dictionary: Dictionary) -> str:
    """Return the problem of the whole panel; problems of single objects are in their rows."""
    if not station.is_linked:
        return LOST
    if station.robot.description is None:
        return "The robot has not described itself yet."
    if device is None:
        return NO_DEVICE
    return dictionary.problem or station.objects.reading.problem or ""
