"""A recorded session, and the window's tabs of what is kept; fixtures for `conftest.py`."""

import dataclasses
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication, QTabWidget

from gateway.client import Batch
from ml.store import Store
from server_gui.core.archive.archive import Archive
from server_gui.core.fleet.live_prediction import record as record_of
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from server_gui.views.cloud.panel import Cloud
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.on_screen import USUAL
from server_gui.views.models.panel import ModelsPage
from server_gui.views.recordings.panel import Recordings
from server_gui.views.refresh_rate import SLOW
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy, draw_frames, leave_unpainted
from tests.gui.foreseen import predicted
from tests.gui.running import wait
from tests.support.commissioning import Played
from tests.support.desk import walking

ADA = Facts(operator="Ada", notes="new insoles")
SECONDS = 12
RATE_HZ = 50


def record(
    settings: ServerSettings,
    *,
    sent: bool = True,
    facts: Facts = ADA,
    fault_s: float | None = None,
    gap: bool = False,
) -> str:
    """Somebody who walks for `SECONDS`, of whom a model says so for half of it; and a marker.

    From `fault_s` on the left knee's drive is in fault, and tells its code two rows later; with a `gap` rows
    were dropped in the middle.
    """
    walk = walking(SECONDS * RATE_HZ, rate_hz=RATE_HZ).batch
    if fault_s is not None:
        fine = round(fault_s * RATE_HZ)
        for name, before, then, late in (("state", 4.0, 7.0, 0), ("error_code", 0.0, float(0x2310), 2)):
            values = (before if row < fine + late else then for row in range(len(walk.stamps_ns)))
            walk.columns[f"left_knee.{name}"] = [*values]
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            units = {name: "rad" if name.endswith("position") else "" for name in walk.columns}
            session = recorder.begin("exo-01", msgspec.structs.replace(facts, units=units))
            for batch in halves(walk) if gap else (walk,):
                recorder.record("exo-01", 1, batch, 0)
            recorder.add(
                *(foretold(session, at_ns) for at_ns in walk.stamps_ns[: len(walk.stamps_ns) // 2 : 5])
            )
            recorder.mark("exo-01", "stairs")
        for number in spool.waiting() if sent else ():
            send(spool, number, Store(settings.store.url))
    return session


def halves(walk: Batch) -> tuple[Batch, Batch]:
    """Return a walk as two notifications, between which the robot has dropped rows."""
    middle = len(walk.stamps_ns) // 2
    first, then = (
        dataclasses.replace(
            walk,
            stamps_ns=walk.stamps_ns[rows],
            columns={name: values[rows] for name, values in walk.columns.items()},
        )
        for rows in (slice(None, middle), slice(middle, None))
    )
    return first, dataclasses.replace(then, seq=walk.seq + 1, dropped=12)


def foretold(session: str, stamp_ns: int) -> Record:
    """That a model said then that somebody walks."""
    utc_ns = stamp_ns + time.time_ns() - time.monotonic_ns()
    told = predicted("walk", {"walk": 0.94})
    prediction = dataclasses.replace(told.prediction, stamp_ns=stamp_ns)
    return record_of(session, dataclasses.replace(told, prediction=prediction, utc_ns=utc_ns))


@pytest.fixture
def settings(tmp_path: Path, folder_url: str) -> ServerSettings:
    return ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path / "spool"))


@pytest.fixture
def posted() -> list[Callable[[], None]]:
    """What threads have posted to the window's."""
    return []


@pytest.fixture
def archive(settings: ServerSettings, bench: Bench, posted: list[Callable[[], None]]) -> Iterator[Archive]:
    made = Archive(settings, bench.desk, posted.append)
    yield made
    assert made.close(30.0)


@pytest.fixture
def played() -> Played:
    """Commissioning whose command is played."""
    return Played()


@pytest.fixture
def full_window(
    qt: QApplication, theme: Theme, bench: Bench, archive: Archive, played: Played, tmp_path: Path
) -> Iterator[MainWindow]:
    """The window with recordings, cloud and commissioning."""
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    made = MainWindow(bench.desk, theme, kept, archive, played.model)
    made.resize(USUAL)
    made.resize(1480, 900)
    leave_unpainted(made)
    made.show()
    yield made
    destroy(made)


class Tabs(QTabWidget):
    """These tabs without the rest of the window, which takes its time to be made."""

    def __init__(self, archive: Archive, bench: Bench, theme: Theme) -> None:
        super().__init__()
        self.recordings = Recordings(archive, bench.desk.recording, theme)
        self.cloud = Cloud(archive, bench.desk.recording, theme)
        self.models = ModelsPage(archive.models, theme)
        self.tabs = self
        self.addTab(self.recordings, "Recordings")
        self.addTab(self.cloud, "Cloud")
        self.addTab(self.models, "Models")
        self.resize(900, 700)

    def refresh(self) -> None:
        view = self.currentWidget()
        if isinstance(view, Recordings | Cloud | ModelsPage):
            view.refresh()


class Shown:
    """The window, or some of its tabs, drawn with whatever threads have posted."""

    def __init__(self, window: MainWindow | Tabs, posted: list[Callable[[], None]]) -> None:
        self.window = window
        self._posted = posted

    def draw(self) -> None:
        while self._posted:
            self._posted.pop(0)()
        if isinstance(self.window, MainWindow):
            draw_frames(self.window)
        else:
            for _ in range(SLOW + 1):
                self.window.refresh()
        QApplication.processEvents()

    def until(self, so: Callable[[], object], what: str) -> None:
        def drawn() -> bool:
            self.draw()
            return bool(so())

        wait(drawn, what)

    def open(self, tab: str) -> None:
        tabs = self.window.tabs
        tabs.setCurrentIndex(
            next(place for place in range(tabs.count()) if tabs.tabText(place).replace("&", "") == tab)
        )
        self.draw()


@pytest.fixture
def whole(full_window: MainWindow, posted: list[Callable[[], None]]) -> Shown:
    return Shown(full_window, posted)


@pytest.fixture
def shown(
    qt: QApplication, theme: Theme, bench: Bench, archive: Archive, posted: list[Callable[[], None]]
) -> Iterator[Shown]:
    tabs = Tabs(archive, bench, theme)
    tabs.show()
    yield Shown(tabs, posted)
    destroy(tabs)


def cell(shown: Shown, column: int) -> str:
    """What stands in the row of the newest job."""
    item = shown.window.tabs.cloud.jobs.item(0, column)
    return "" if item is None else item.text()


def play(shown: Shown, archive: Archive) -> None:
    """Open the newest recording, which plays at once, and stand still at its beginning."""
    archive.library.look(now=True)
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    shown.until(lambda: page.sessions.rowCount(), "listed it")
    page.table.selectRow(0)
    shown.until(lambda: archive.tape, "looked into it")
    page.play.click()
    assert archive.playback.playing
    tape = archive.playback.tape
    assert tape is not None
    archive.playback.play(on=False)
    archive.playback.seek(tape.first_ns)
    shown.until(lambda: not archive.playback.is_loading, "showed it")
