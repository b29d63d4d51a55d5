"""The robot's computer: CPU and memory over time, temperatures, who leaks, and the process table."""

import time
from typing import Final

import msgspec
import numpy as np
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QLineEdit, QVBoxLayout, QWidget

from gateway.messages import GatewayCost, ResourceSnapshot
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.processing.resource import SERIES
from server_gui.views.marks import age_text
from server_gui.views.processes import ProcessTable
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plot import Curve, Plot

SPANS_S: Final = (30.0, 60.0, 120.0, 300.0, 600.0)  # of the past, the shortest that holds what there is
GIB: Final = 1 << 30
MIB: Final = 1 << 20
KIB: Final = 1 << 10
OLD_S: Final = 5.0
SLOW: Final = 6  # frames between two looks
CLIENTS: Final = 4  # those that cost the most


class Resources(QWidget):
    """Asks for the process table only while it is visible."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._watched: Station | None = None
        self._taken: ResourceSnapshot | None = None
        self._frame = 0
        self.setObjectName("page")
        self._cpu, self._memory = Plot(theme, SPANS_S[0], 20.0), Plot(theme, SPANS_S[0], 256.0)
        self._cpu.set_curves([Curve("cpu_percent", "accent"), Curve("gateway_cpu_percent", "good")])
        self._memory.set_curves([Curve("memory_used", "accent")])
        self._cards = {name: Card(name) for name in ("CPU", "Memory", "Computer")}
        self._cards["CPU"].body.addWidget(self._cpu)
        self._cards["Memory"].body.addWidget(self._memory)
        self.facts = QLabel()
        self.facts.setWordWrap(True)
        self._cards["Computer"].body.addWidget(self.facts)
        self._cards["Computer"].body.addStretch(1)
        self.table = ProcessTable(theme)
        self.words = QLineEdit()
        self.words.setPlaceholderText("Filter processes by name")
        self.words.setClearButtonEnabled(True)
        self.words.setAccessibleName("Filter of the processes")
        self.words.textChanged.connect(self.table.sorted.setFilterFixedString)
        self._processes = Card("Processes")
        self._processes.body.addWidget(self.words)
        self._processes.body.addWidget(self.table, 1)
        left = QVBoxLayout()
        for name, share in (("CPU", 3), ("Memory", 3), ("Computer", 2)):
            left.addWidget(self._cards[name], share)
        everything = QHBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addLayout(left, 1)
        everything.addWidget(self._processes, 1)
        desk.on_select.append(lambda _station: self._watch())

    def showEvent(self, event: QShowEvent) -> None:
        self._watch()
        super().showEvent(event)

    def hideEvent(self, event: QHideEvent) -> None:
        self._watch()
        super().hideEvent(event)

    def refresh(self) -> None:
        """Show how it is now; there is something new once a second."""
        self._frame += 1
        station = self._desk.selected
        if station is None or self._frame % SLOW != 1:
            return
        self._refresh_plots(station)
        self._refresh_facts(station)
        seen = station.processes
        if seen is not None and seen is not self._taken and isinstance(seen.processes, list):
            self._taken = seen
            self.table.processes.take(seen.processes)
        age_s = _age_s(station.processes_at_ns)
        old = age_s is not None and age_s > OLD_S
        count = self.table.processes.rowCount()
        self._processes.set_note(f"STALE, {age_text(age_s)} old" if old else f"{count} processes")
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
            self.table.processes.take([])
        self._watched, self._taken = wanted, None

    def _refresh_plots(self, station: Station) -> None:
        rows = station.processing.resource.history.recent()
        if not len(rows):
            return
        restarts = np.flatnonzero(np.diff(rows[:, 0]) < 0)  # the robot's clock has begun anew
        rows = rows[restarts[-1] + 1 :] if len(restarts) else rows
        times = rows[:, 0]
        series = {name: rows[:, 1 + place] for place, name in enumerate(SERIES)}
        span = next((seconds for seconds in SPANS_S if times[-1] - times[0] < seconds), SPANS_S[-1])
        for plot in (self._cpu, self._memory):
            if plot.seconds != span:
                plot.set_seconds(span)
        live = not _is_old(station)
        source = station.processing.resource.history
        self._cpu.draw(source, times, [series["cpu_percent"], series["gateway_cpu_percent"]], live=live)
        self._memory.draw(source, times, [series["memory_used"]], live=live, scale=1 / MIB)

    def _refresh_facts(self, station: Station) -> None:
        seen = station.robot.resources
        if seen is None:
            set_text(self.facts, "The robot has not been asked yet, or has not answered.")
            return
        age_s = _age_s(station.robot.resources_at_ns)
        old = f"STALE, {age_text(age_s)} old · " if _is_old(station) else ""
        cpu = "–" if seen.cpu.percent is None else f"{seen.cpu.percent:.0f} %"
        own = "–" if seen.gateway.cpu_percent is None else f"{seen.gateway.cpu_percent:.1f} %"
        memory = seen.memory
        self._cards["CPU"].set_note(
            f"{old}{cpu} of {len(seen.cpu.per_core)} cores · this gateway {own} of one"
        )
        share = 100 * memory.used / memory.total
        self._cards["Memory"].set_note(
            f"{old}{share:.0f} % · {memory.used / GIB:.2f} of {memory.total / GIB:.1f} GiB, in MiB"
        )
        set_text(self.facts, _facts(station, seen))


def _facts(station: Station, seen: ResourceSnapshot) -> str:
    load = " ".join(f"{one:.2f}" for one in seen.cpu.load)
    lines = [f"Load over 1, 5 and 15 minutes: {load}", f"Gateway: {seen.gateway.rss_bytes / MIB:.1f} MiB"]
    table = station.processes
    if table is not None and not isinstance(table.thermal, msgspec.UnsetType):
        known = [f"{name} {value:.0f} °C" for name, value in table.thermal.items() if value is not None]
        lines.append(f"Temperatures: {', '.join(known) or 'this computer tells none'}")
    lines += _costs(station.cost)
    if seen.memory.swap_used:
        lines.append(f"Swapped out: {seen.memory.swap_used / MIB:.0f} MiB")
    lines += [f"▲ {leak.text}" for leak in station.processing.resource.leaks()]
    return "\n".join(lines)


def _costs(cost: GatewayCost | None) -> list[str]:
    """Who causes what the gateway takes, the most first."""
    if cost is None or cost.wake_ups_per_s is None:
        return []
    lines = [f"Monitoring wakes the computer {cost.wake_ups_per_s:.0f} times a second; for"]
    known = [one for one in cost.clients if one.cpu_percent is not None]
    clients = sorted(known, key=lambda one: -(one.cpu_percent or 0.0))
    for one in clients[:CLIENTS]:
        sent_bytes = one.sent_bytes_per_s or 0.0
        lines.append(f"   {one.who}: {one.cpu_percent or 0.0:.1f} % of a core, {sent_bytes / KIB:.0f} KiB/s")
    if cost.budget is not None and cost.budget.shed > 1:
        lines.append(f"▲ To keep to its budget the robot sends one row of {cost.budget.shed}")
    return lines


def _age_s(at_ns: int | None) -> float | None:
    return None if at_ns is None else (time.monotonic_ns() - at_ns) / 1e9


def _is_old(station: Station) -> bool:
    age_s = _age_s(station.robot.resources_at_ns)
    return age_s is None or age_s > OLD_S
