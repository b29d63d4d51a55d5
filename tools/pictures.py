"""Makes the pictures of docs/window.md: the window on the simulated robot, worked as a newcomer would.

`.venv/bin/python tools/pictures.py` takes about three minutes; with a display, or QT_QPA_PLATFORM=offscreen.
It records into a folder of its own, and starts a process that eats a core, to be found in the table.
"""

import contextlib
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PySide6.QtCore import QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from server_gui.app import FOLLOWING, App
from server_gui.core.desk.feeds import Record
from server_gui.core.desk.station import Station
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from server_gui.core.tuning.stop import StopState
from server_gui.views.processes import NAME

DOCS = Path(__file__).parents[1] / "docs"
SIZE = 1480, 900
WITHIN_S = 240.0
WALKED_S = 75.0  # recorded before it is labelled
TRIAL_S = 20
NEW_STEP = "430"  # mm
EATER = "gait_planner"


class Newcomer:
    """Does something with the window, waits for what comes of it, and keeps a picture."""

    def __init__(self, app: App) -> None:
        self.app = app
        self.window = app.window

    @property
    def station(self) -> Station:
        return self.app.desk.stations[0]

    def wait(self, so: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + WITHIN_S
        while not so():
            if time.monotonic() > deadline:
                raise TimeoutError(f"it never {what}")
            QTest.qWait(20)

    def open(self, title: str) -> None:
        tabs = self.window.tabs
        titles = [tabs.tabText(place).replace("&", "") for place in range(tabs.count())]
        tabs.setCurrentIndex(titles.index(title))
        QTest.qWait(1500)

    def keep(self, name: str) -> None:
        self.wait(lambda: not self.station.robot.is_stale(), "was live")
        QTest.qWait(300)
        self.window.grab().save(str(DOCS / f"window-{name}.png"))
        sys.stdout.write(f"window-{name}.png\n")
        sys.stdout.flush()


def sees_it_walk(one: Newcomer) -> None:
    one.wait(one.window.empty.isVisible, "offered the simulator")
    one.window.empty.start.click()
    one.wait(lambda: bool(one.app.desk.stations), "started it")
    one.wait(lambda: one.station.processing.derived().gait.walking, "walked")
    one.wait(lambda: len(one.station.predictions.by_task) == 3, "was predicted")
    one.wait(lambda: np.ptp(one.station.rings.times(10.0)) > 9.9, "walked for ten seconds")
    one.keep("overview")


def finds_the_process(one: Newcomer) -> None:
    one.open("Resources")
    one.wait(lambda: one.window.resources.table.processes.rowCount(), "listed the processes")
    QTest.qWait(8000)
    one.wait(
        lambda: one.window.resources.table.model().index(0, NAME).data() == EATER, "saw who eats the CPU"
    )
    one.keep("resources")


def looks_at_signals(one: Newcomer) -> None:
    one.open("Signals")
    one.window.signals.choose(
        [f"{side}_{joint}.position" for joint in ("hip", "knee") for side in ("left", "right")]
        + [f"{side}_insole.force" for side in ("left", "right")]
    )
    QTest.qWait(2000)
    one.keep("signals")


def tries_a_longer_step(one: Newcomer) -> None:
    one.open("Overview")
    panel = one.window.parameters
    panel.tree.select_name("gait.step_length")
    panel.stage_text("gait.step_length", NEW_STEP)
    panel.begin_review()
    panel.review.seconds.setValue(TRIAL_S)
    one.wait(panel.review.try_it.isEnabled, "let it be tried")
    one.keep("review")
    QTest.mouseClick(panel.review.try_it, Qt.MouseButton.LeftButton)
    one.wait(lambda: one.station.writing.trial is not None, "was on trial")
    one.wait(lambda: one.station.robot.parameters["gait.step_length"].value == 0.43, "held the new value")
    QTest.qWait(2000)
    one.keep("trial")


def watches_it_revert(one: Newcomer) -> None:
    one.wait(lambda: one.station.writing.trial is None, "took it back")
    one.wait(lambda: one.station.robot.parameters["gait.step_length"].value == 0.4, "held the old value")
    QTest.qWait(1000)
    one.keep("reverted")


def labels_a_minute(one: Newcomer) -> None:
    one.open("Recordings")
    page, player = one.window.recordings.list, one.window.recordings.player
    one.app.desk.recording.upload()
    one.wait(page.sessions.rowCount, "listed the session")
    page.table.selectRow(0)
    one.wait(page.play.isEnabled, "looked into it")
    page.play.click()
    one.wait(player.isVisible, "played it")
    QTest.qWait(3000)
    keys = (Qt.Key.Key_End, Qt.Key.Key_O, *[Qt.Key.Key_PageUp] * 6, Qt.Key.Key_I, *[Qt.Key.Key_PageDown] * 3)
    for key in keys:  # the last minute, ten seconds a page
        QTest.keyClick(player.timeline, key)
        QTest.qWait(200)
    player.labels.text.setCurrentText("walk")
    one.wait(player.labels.give.isEnabled, "let it be labelled")
    player.labels.give.click()
    one.wait(player.labels.list.count, "labelled it")
    QTest.qWait(2000)
    one.keep("playback")


def uploads_it(one: Newcomer) -> None:
    one.open("Cloud")
    one.window.cloud.upload.click()
    recording = one.app.desk.recording
    one.wait(lambda: recording.report is not None and recording.report.uploader.uploaded > 0, "uploaded it")
    QTest.qWait(4000)
    one.keep("cloud")


def stops_it(one: Newcomer) -> None:
    one.open("Overview")
    QTest.mousePress(one.window.header.stop, Qt.MouseButton.LeftButton)
    QTest.mouseRelease(one.window.header.stop, Qt.MouseButton.LeftButton)
    one.wait(lambda: one.station.stopping.state is StopState.CONFIRMED, "confirmed the stop")
    QTest.qWait(1500)
    one.keep("stopped")


@contextlib.contextmanager
def runaway(folder: Path) -> Iterator[None]:
    """A process of this name that eats a core."""
    program = folder / EATER
    shutil.copy(sys.executable, program)
    with subprocess.Popen([str(program), "-S", "-c", "while True: pass"]) as process:
        try:
            yield
        finally:
            process.kill()


def main() -> None:
    """All of it, once."""
    with tempfile.TemporaryDirectory(prefix="gwrms-pictures-") as name:
        folder = Path(name)
        settings = ServerSettings(
            store=StoreSettings(f"file://{folder}/store"), recorder=RecordingSettings(spool=folder / "spool")
        )
        qt = QApplication([])
        qt.setStyle("Fusion")
        kept = QSettings(str(folder / "kept.ini"), QSettings.Format.IniFormat)
        with App(qt, settings, kept, FOLLOWING, Record("Ada", "first steps")) as app:
            app.window.resize(*SIZE)
            app.window.show()
            one = Newcomer(app)
            began_s = time.monotonic()
            sees_it_walk(one)
            with runaway(folder):
                finds_the_process(one)
            for does in (looks_at_signals, tries_a_longer_step, watches_it_revert):
                does(one)
            one.wait(lambda: time.monotonic() - began_s > WALKED_S, "walked long enough")
            for does in (labels_a_minute, uploads_it, stops_it):
                does(one)
            app.window.hide()


if __name__ == "__main__":
    main()
