"""The robot's computer over time: CPU, memory, who uses them, disk, network, heat; and its processes."""

from collections.abc import Mapping
from typing import Final

from msgspec import UNSET
from PySide6.QtCore import QSize
from PySide6.QtGui import QHideEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QBoxLayout, QGridLayout, QLineEdit, QWidget

from gateway.wire.resource import ResourceSnapshot
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.processing.process_names import told_apart
from server_gui.core.processing.resource import DEVICES, SERIES
from server_gui.views.marks import age_text
from server_gui.views.resources.computer import facts, held_back
from server_gui.views.resources.processes import ProcessTable
from server_gui.views.resources.trend import Trend, since_restart
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import PlainLabel
from server_gui.views.widgets.plot import Curve
from server_gui.views.workspace.unit_plot import OTHERS

GIB: Final = 1 << 30
KIB: Final = 1 << 10
OLD_S: Final = 5.0
SLOW: Final = 6  # frames between two looks
TOP: Final = 4  # processes that are drawn
# Each card's series, with what people call them and their colours.
CPU: Final = {
    "cpu_percent": Curve("all cores", "accent"),
    "gateway_cpu_percent": Curve("gateway, of one core", "good"),
}
MEMORY: Final = {"memory_used": Curve("used", "accent")}
DISK_AND_NETWORK: Final = {
    "disk_read": Curve("disk read", "accent"),
    "disk_written": Curve("written", "good"),
    "received": Curve("network in", OTHERS[1]),
    "sent": Curve("out", OTHERS[2]),
}
NARROW, THREE, TRENDS = 800, 500, 260  # wide, at text of 100 %: trends and processes; three trends; two
TEMPERATURE: Final = {"hottest": Curve("hottest", "warn")}


class Resources(QWidget):
    """Asks for the process table, disk, network and temperatures only while it is visible."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._watched: Station | None = None
        self._taken: ResourceSnapshot | None = None
        self._frame = 0
        self.setObjectName("page")
        self.cpu = Trend(theme, "CPU", 20.0, symbol=" %")
        self.memory = Trend(theme, "Memory", 0.25, 1 / GIB, symbol=" GiB", digits=2)
        self.top = Trend(theme, "CPU by process", 10.0, unit="% of a core")
        self.devices = Trend(theme, "Disk and network", 10.0, 1 / KIB, unit="KiB/s")
        self.temperature = Trend(theme, "Temperature", 10.0, symbol=" °C")
        self.facts = PlainLabel()
        self.facts.setWordWrap(True)
        computer = Card("Computer")
        computer.body.addWidget(self.facts)
        computer.body.addStretch(1)
        self.table = ProcessTable(theme)
        self.words = QLineEdit()
        self.words.setPlaceholderText("Filter processes by name or command")
        self.words.setClearButtonEnabled(True)
        self.words.setAccessibleName("Filter of the processes")
        self.words.textChanged.connect(self.table.sorted.setFilterFixedString)
        self._processes = Card("Processes")
        self._processes.body.addWidget(self.words)
        self._processes.body.addWidget(self.table, 1)
        self._grid = QGridLayout()
        self._cards = (self.cpu, self.memory, self.top, self.devices, self.temperature, computer)
        self._theme = theme
        self._columns, self._is_heatless = 2, False  # no sensor of a temperature
        self._layout = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._layout.setContentsMargins(8, 8, 8, 8)
        self._layout.addLayout(self._grid, 1)
        self._layout.addWidget(self._processes, 1)
        self._arrange(2)
        desk.on_select.append(lambda _station: self._watch())

    def minimumSizeHint(self) -> QSize:
        """As narrow as the trends: then the processes are above them."""
        return QSize(self._theme.px(TRENDS), super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        direction, is_narrow = QBoxLayout.Direction, self.width() < self._theme.px(NARROW)
        self._layout.setDirection(direction.BottomToTop if is_narrow else direction.LeftToRight)
        self._processes.setMinimumHeight(self._theme.px(200) if is_narrow else 0)
        self._arrange(3 if is_narrow and self.width() >= self._theme.px(THREE) else 2)

    def _arrange(self, columns: int) -> None:
        self._columns = columns
        shown = [card for card in self._cards if card is not self.temperature or not self._is_heatless]
        for place, card in enumerate(shown):
            span = columns - place % columns if card is shown[-1] else 1
            self._grid.addWidget(card, place // columns, place % columns, 1, span)
        for column in range(3):
            self._grid.setColumnStretch(column, int(column < columns))

    def showEvent(self, event: QShowEvent) -> None:
        self._watch()
        super().showEvent(event)

    def hideEvent(self, event: QHideEvent) -> None:
        self._watch()
        super().hideEvent(event)

    def read_now(self) -> None:
        """Let the next frame show it anew: what stands above the tab is shown anew then."""
        self._frame = 0

    def refresh(self) -> None:
        """Show how it is now; there is something new once a second."""
        self._frame += 1
        station = self._desk.selected
        if station is None or self._frame % SLOW != 1:
            return
        self._refresh_notes(station)
        seen = station.processes
        if seen is not None and seen is not self._taken and isinstance(seen.processes, list):
            self._taken = seen
            self.table.take(seen.processes)
        self._refresh_trends(station)
        age_s = _age_s(station.processes_at_ns)
        old = age_s is not None and age_s > OLD_S
        count = self.table.processes.rowCount()
        known = "no data yet" if age_s is None else f"{count} processes"
        self._processes.set_note(
            *(f"STALE, {age_text(age_s)} old", f"{age_text(age_s)} old") if old else (known,)
        )
        self.table.setEnabled(not old)

    def _watch(self) -> None:
        """Ask the robot that is looked at, while this is visible, and no other."""
        wanted = self._desk.selected if self.isVisible() else None
        if wanted is self._watched:
            return
        if self._watched is not None:
            self._watched.show_processes(False)
        if wanted is not None:
            wanted.show_processes(True)
        if wanted is not None and self._taken is not None:
            self.table.take([])
        self._watched, self._taken = wanted, None

    def _refresh_trends(self, station: Station) -> None:
        seen, live = station.processing.resource, not _is_old(station)
        for history, names, cards in (
            (seen.history, SERIES, ((self.cpu, CPU), (self.memory, MEMORY))),
            (seen.devices, DEVICES, ((self.devices, DISK_AND_NETWORK), (self.temperature, TEMPERATURE))),
        ):
            rows = since_restart(history.recent())
            for card, curves in cards:
                columns = [rows[:, 1 + names.index(name)] for name in curves]
                card.show_rows(history, rows[:, 0], list(curves.values()), columns, live=live)
        top = seen.top(TOP)
        times, columns = seen.over_time(top)
        colours = ("accent", "good", *OTHERS[1:3])
        called = told_apart([(one.label, one.pid) for one in top])
        known = self.table.processes.labels  # as the table calls them
        said = [known.get(one.pid, name) for one, name in zip(top, called, strict=True)]
        named = [Curve(name, colour) for name, colour in zip(said, colours, strict=False)]
        self.top.show_rows(seen, times, named, columns, live=live)

    def _refresh_notes(self, station: Station) -> None:
        seen = station.robot.resources
        if seen is None:
            set_text(self.facts, "The robot has not been asked yet, or has not answered.")
            return
        age_s = _age_s(station.robot.resources_at_ns)
        old = f"STALE, {age_text(age_s)} old · " if _is_old(station) else ""
        cores = len(seen.cpu.per_core)
        self.cpu.set_note(f"{old}{cores} {'core' if cores == 1 else 'cores'}", old[:5])
        memory = seen.memory
        share = 100 * memory.used / memory.total
        amount = f"{share:.0f} % · {memory.used / GIB:.2f} of {memory.total / GIB:.1f} GiB"
        self.memory.set_note(f"{old}{amount}", f"{old}{share:.0f} %", f"{old[:5]}")
        table = station.processes
        has_none = table is not None and table.thermal is not UNSET and not _any_known(table.thermal)
        if has_none is not self._is_heatless:  # then others have its room
            self._is_heatless = has_none
            self.temperature.setVisible(not has_none)
            self._arrange(self._columns)
        held = held_back(station.processes)
        self.temperature.set_note(held, held.partition(" · ")[0], "▲" if "▲" in held else "")
        set_text(self.facts, facts(station, seen))


def _any_known(values: Mapping[str, float | None]) -> bool:
    """Return whether one of these is known."""
    return any(value is not None for value in values.values())


def _age_s(at_ns: int | None) -> float | None:
    return None if at_ns is None else (now_ns() - at_ns) / 1e9


def _is_old(station: Station) -> bool:
    age_s = _age_s(station.robot.resources_at_ns)
    return age_s is None or age_s > OLD_S
