"""Three shifts at the desk: once its histories are full, what is kept open holds no more after the next one.

By default at `USUAL_HZ` rows a second, as fast as it goes; `GWRMS_MEMORY_HZ=100` is the window's own rate.
"""

import gc
import os
import time
from collections.abc import Iterator

import psutil
import pytest
from PySide6.QtWidgets import QApplication

from gateway.client import Batch, ClockOffset, ConnectionState
from gateway.wire.parameter import Written
from gateway.wire.resource import ProcessUse
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import LinkChanged, Telemetry
from server_gui.views.frame.main_window import MainWindow
from tests.gui.fakes import Bench
from tests.support.desk import described, looked, resources, walking

USUAL_HZ = 4
RATE_HZ = int(os.environ.get("GWRMS_MEMORY_HZ", USUAL_HZ))
HOURS, SETTLED_HOURS = 24, 16  # the longest history, of events, is full after some 14 of such hours
HOUR_S = 3600
BATCH_S, LOOK_S, EVENT_S, FRAME_S, TAB_S = 10, 20, 120, 90, 600  # simulated, between each and the next
MORE_BYTES, MORE_OBJECTS = 8 << 20, 0.005


def walked(rate_hz: int) -> Iterator[Telemetry]:
    """Ten seconds after the others, for ever: somebody who takes a stride a second."""
    rows = BATCH_S * rate_hz
    columns = walking(rows, rate_hz=float(rate_hz)).batch.columns
    step_ns, newest_ns = 1_000_000_000 // rate_hz, time.monotonic_ns()
    while True:
        stamps_ns = [newest_ns + (row + 1) * step_ns for row in range(rows)]
        newest_ns = stamps_ns[-1]
        yield Telemetry(1, Batch(stamps_ns, columns, 0, 0, 0, 1, newest_ns), ClockOffset(0, 0))


def happens(bench: Bench, number: int) -> None:
    """A link that drops, a robot that describes itself anew, a fault, a write: nothing may stay for ever."""
    station = bench.station
    station._watched_ns = 0
    station.take([LinkChanged(ConnectionState.WAITING, f"timed out {number}", 0)])
    station.take([LinkChanged(ConnectionState.CONNECTED, None, 0), described()])
    station.take([looked(state="fault" if number % 2 else "ok", problem=f"overload {number}")])
    station.edits.stage("gait.step_length", 0.3 + number % 100 / 1000, None)
    station.write(station.difference(bench.desk.shown.units))
    bench.first.answer(Written(number, {"gait.step_length": 0.4}, {"gait.step_length": 0.41}))
    bench.first.asked.clear()
    bench.first.futures.clear()


def looks(station: Station, second: int) -> None:
    processes = [ProcessUse(1000 + second + number, f"job-{second}", 0.1, 1 << 20) for number in range(20)]
    station.take([resources(processes), resources()])


def held() -> tuple[int, int]:
    """Bytes and objects of this process."""
    QApplication.processEvents()
    gc.collect()
    return psutil.Process().memory_info().rss, len(gc.get_objects())


@pytest.mark.timeout(300 + 12 * RATE_HZ)
def test_eight_more_hours_leave_nothing_behind(window: MainWindow, bench: Bench) -> None:
    window.setUpdatesEnabled(True)  # it is painted here, too
    source, settled = walked(RATE_HZ), (0, 0)
    for second in range(0, HOURS * HOUR_S, BATCH_S):
        bench.station.take([next(source)])
        if second % LOOK_S == 0:
            looks(bench.station, second)
        if second % EVENT_S == 0:
            happens(bench, second)
        if second % FRAME_S == 0:
            window.tabs.setCurrentIndex(second // TAB_S % window.tabs.count())
            window.refresh()
            QApplication.processEvents()
        if second == SETTLED_HOURS * HOUR_S:
            settled = held()
    more_bytes, more_objects = (now - then for now, then in zip(held(), settled, strict=True))
    assert more_bytes < MORE_BYTES
    assert more_objects < MORE_OBJECTS * settled[1]
