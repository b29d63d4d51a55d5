"""A drive in fault, and a window that has settled."""

import time

from PySide6.QtWidgets import QApplication

from server_gui.views.frame.main_window import MainWindow
from tests.gui.fakes import Around, Bench
from tests.support.desk import JOINTS, looked, telemetry, walking

CAUSE = "0x2310 continuous overcurrent at the output (register: generic, current)"


def fault(bench: Bench) -> None:
    """The left knee's drive in fault; the others stopped."""
    now_ns = time.monotonic_ns() + 60_000_000_000  # not stale while the test lasts
    columns: dict[str, list[float | None]] = {f"{joint}.state": [5.0] for joint in JOINTS}
    columns["left_knee.state"] = [7.0]
    columns["left_knee.current"] = [9.0]
    bench.station.take([walking(100, -60.0)])
    found = looked(state="fault", problem=f"the drive is in fault: {CAUSE}")
    bench.look_again([telemetry([now_ns + 1], columns, now_ns), found])


def settle(window: MainWindow | Around, bench: Bench) -> None:
    """Frames, and Qt's layouts within layouts."""
    bench.draw(window)
    for _ in range(10):
        QApplication.processEvents()
