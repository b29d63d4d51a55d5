"""Recordings and cloud in the window: listed, played apart from what is live, labelled, uploaded."""

import dataclasses
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QLineEdit,
    QPushButton,
    QTabWidget,
    QTreeWidgetItem,
    QWidget,
)

from gateway.wire.messages import Stopped
from ml.store import Store, StoreError
from server_gui.core.archive import library
from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.jobs import Job, JobState
from server_gui.core.desk.recording import By, Recording
from server_gui.core.fleet.live_prediction import record as record_of
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from server_gui.core.tuning.stop import StopState
from server_gui.views.cloud.panel import Cloud
from server_gui.views.main_window import MainWindow
from server_gui.views.recordings.panel import Recordings
from server_gui.views.recordings.timeline import clock_text
from server_gui.views.theme import Look, Theme
from tests.gui.fakes import Bench, destroy, walking
from tests.gui.foreseen import predicted
from tests.gui.journals import RobotsJournal
from tests.gui.running import wait
from tests.gui.test_recording import FakeKeeper, report

SECONDS = 12
RATE_HZ = 50


def record(settings: ServerSettings, *, sent: bool = True) -> str:
    """Somebody who walks for `SECONDS`, of whom a model says so for half of it; and a marker."""
    walk = walking(SECONDS * RATE_HZ, rate_hz=RATE_HZ).batch
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            units = {name: "rad" if name.endswith("position") else "" for name in walk.columns}
            session = recorder.begin("exo-01", Facts(units=units, operator="Ada", notes="new insoles"))
            recorder.record("exo-01", 1, walk, 0)
            recorder.add(
                *(foretold(session, at_ns) for at_ns in walk.stamps_ns[: len(walk.stamps_ns) // 2 : 5])
            )
            recorder.mark("exo-01", "stairs")
        for number in spool.waiting() if sent else ():
            send(spool, number, Store(settings.store.url))
    return session


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
def window(
    qt: QApplication, theme: Theme, bench: Bench, archive: Archive, tmp_path: Path
) -> Iterator[MainWindow]:
    """The window with recordings and cloud."""
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    made = MainWindow(bench.desk, theme, kept, archive)
    made.resize(1480, 900)
    made.show()
    yield made
    destroy(made)


class Tabs(QTabWidget):
    """The two tabs without the rest of the window, which takes its time to be made."""

    def __init__(self, archive: Archive, bench: Bench, theme: Theme) -> None:
        super().__init__()
        self.recordings = Recordings(archive, bench.desk.recording, theme)
        self.cloud = Cloud(archive, bench.desk.recording, theme)
        self.tabs = self
        self.addTab(self.recordings, "Recordings")
        self.addTab(self.cloud, "Cloud")
        self.resize(900, 700)

    def refresh(self) -> None:
        view = self.currentWidget()
        if isinstance(view, Recordings | Cloud):
            view.refresh()


class Shown:
    """The window, or its two tabs, drawn with whatever threads have posted."""

    def __init__(self, window: MainWindow | Tabs, posted: list[Callable[[], None]]) -> None:
        self.window = window
        self._posted = posted

    def draw(self) -> None:
        while self._posted:
            self._posted.pop(0)()
        for _ in range(7):
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
def whole(window: MainWindow, posted: list[Callable[[], None]]) -> Shown:
    return Shown(window, posted)


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
    item = shown.window.cloud.jobs.item(0, column)
    return "" if item is None else item.text()


def play(shown: Shown, archive: Archive) -> None:
    """Open the newest recording and play it."""
    shown.open("Recordings")
    page = shown.window.recordings.list
    shown.until(lambda: page.sessions.rowCount(), "listed it")
    page.table.selectRow(0)
    shown.until(lambda: archive.tape, "looked into it")
    page.play.click()
    shown.until(lambda: not archive.playback.is_loading, "showed it")


def test_recordings_of_store_and_spool_are_listed_with_what_is_in_them(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    record(settings, sent=False)
    shown.open("Recordings")
    page = shown.window.recordings.list
    shown.until(lambda: page.sessions.rowCount() == 2, "listed both")
    texts = [page.table.model().index(row, 5).data() for row in range(2)]
    assert sorted(texts) == ["stored", "waits for upload"]
    for row in range(2):
        page.table.selectRow(row)
        shown.until(lambda: archive.tape, "looked into it")
        shown.draw()
        said = page.details.toPlainText()
        assert "Operator: Ada" in said
        assert "marker: stairs" in said
        assert page.play.isEnabled()


def test_nothing_recorded_yet_says_what_to_do(shown: Shown, archive: Archive) -> None:
    shown.open("Recordings")
    shown.until(lambda: archive.library.revision, "looked")
    shown.draw()
    assert "add a robot" in shown.window.recordings.list.said.text()
    shown.open("Cloud")
    assert shown.window.cloud.hint.isVisible()
    assert not shown.window.cloud.verify.isEnabled()


def test_recordings_can_be_looked_at_without_a_robot(
    whole: Shown, window: MainWindow, bench: Bench, settings: ServerSettings, archive: Archive
) -> None:
    record(settings)
    bench.desk.select(None)
    whole.draw()
    assert window.empty.isVisible()
    next(button for button in window.empty.findChildren(QPushButton) if "recordings" in button.text()).click()
    page = window.recordings.list
    whole.until(lambda: page.sessions.rowCount(), "listed it")
    assert page.isVisible()
    whole.open("Overview")
    assert window.empty.isVisible()


def test_playback_is_marked_and_never_mixed_with_what_is_live(
    whole: Shown, window: MainWindow, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    record(settings)
    bench.station.take([walking(50)])
    live = dict(bench.station.robot.values)
    play(whole, archive)
    tape = archive.playback.tape
    assert tape is not None
    player = window.recordings.player
    archive.playback.seek(tape.first_ns + 5 * 10**9)
    whole.until(lambda: not archive.playback.is_loading, "jumped")
    whole.until(lambda: "PLAYBACK, not live: exo-01" in player.banner.text(), "said what it is")
    assert bench.desk.selected is bench.station
    assert bench.station.robot.values == live
    played = archive.playback.desk.stations[0]
    assert played.robot.values["left_knee.position"] != live["left_knee.position"]
    QTest.mousePress(window.header.stop, Qt.MouseButton.LeftButton)
    assert bench.first.named("stop") == [], "the app does that"
    bench.station.stop("test")
    bench.first.answer(Stopped({"left_knee": "confirmed"}, True))
    assert bench.station.stopping.state is StopState.CONFIRMED
    assert played.stopping.state is StopState.IDLE


def test_playback_shows_what_was_predicted_then_and_nothing_where_nothing_was(
    whole: Shown, window: MainWindow, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    record(settings)
    play(whole, archive)
    tape, player = archive.playback.tape, window.recordings.player
    assert tape is not None
    archive.playback.seek(tape.first_ns + SECONDS * 10**9 // 4)
    whole.until(lambda: player.banner.text().endswith(" · predicted then: Walk  0.94"), "showed it")
    lines = player.overview.status_lines
    whole.until(lambda: "Does: Walk  0.94 · said then by activity-3fa2c1" in lines.texts, "said by what")
    archive.playback.seek(tape.last_ns)
    whole.until(lambda: "predicted" not in player.banner.text(), "jumped")
    whole.until(lambda: any(text.startswith("Not predicted") for text in lines.texts), "said so")
    assert not bench.station.predictions.told


def test_the_audit_shows_the_journal_of_a_robot_that_is_away(
    whole: Shown, window: MainWindow, settings: ServerSettings, tmp_path: Path
) -> None:
    (tmp_path / "robot").mkdir()
    journal = RobotsJournal(tmp_path / "robot")
    journal.say("stop", reason="STOP key")
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.journal("exo-07", journal.told().journal.entries)
    journal.close()
    whole.open("Audit")
    whole.until(lambda: window.audit.chosen.rowCount() == 1, "showed it")
    assert "exo-07: collected were 1 entry" in window.audit.verdict.text()


def test_the_bar_of_time_is_used_by_keys_and_by_mouse(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    play(shown, archive)
    playback, timeline = archive.playback, shown.window.recordings.player.timeline
    assert playback.tape is not None
    first, last = playback.tape.first_ns, playback.tape.last_ns
    QTest.keyClick(timeline, Qt.Key.Key_Right)
    assert playback.position_ns == first + 10**9
    shown.draw()
    QTest.keyClick(timeline, Qt.Key.Key_I)
    QTest.keyClick(timeline, Qt.Key.Key_PageDown)
    shown.draw()
    QTest.keyClick(timeline, Qt.Key.Key_O)
    assert timeline.span_ns == (first + 10**9, first + 11 * 10**9)
    QTest.keyClick(timeline, Qt.Key.Key_End)
    assert playback.position_ns == last
    QTest.keyClick(timeline, Qt.Key.Key_Home)
    assert playback.position_ns == first
    middle = QPoint(timeline.width() // 2, timeline.height() // 2)
    QTest.mouseClick(timeline, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, middle)
    assert abs(playback.position_ns - (first + last) // 2) < 10**9
    QTest.keyClick(timeline, Qt.Key.Key_Space)
    assert playback.playing
    assert (clock_text(3725.04, 1), clock_text(11.98, 1)) == ("1:02:05.0", "0:12.0")


def test_a_span_is_labelled_a_contradiction_is_refused_and_a_label_taken_back(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    play(shown, archive)
    player, tape = shown.window.recordings.player, archive.playback.tape
    assert tape is not None
    player.timeline.choose(tape.first_ns + 10**9, tape.first_ns + 4 * 10**9)
    player.labels.text.setCurrentText("walk")
    shown.draw()
    player.labels.give.click()
    shown.until(lambda: archive.labels.labels or archive.labels.failed, "labelled it")
    assert not archive.labels.failed, archive.labels.said
    assert [label.label for label in archive.labels.labels] == ["walk"]
    player.timeline.choose(tape.first_ns + 3 * 10**9, tape.first_ns + 5 * 10**9)
    player.labels.text.setCurrentText("sit")
    shown.draw()
    player.labels.give.click()
    shown.until(lambda: archive.labels.failed, "refused it")
    assert "contradicts walk" in archive.labels.said
    shown.until(lambda: player.labels.list.count() == 1, "listed it")
    player.labels.list.setCurrentRow(0)
    QTest.keyClick(player.labels.list, Qt.Key.Key_Return)
    label = archive.labels.labels[0]
    assert player.timeline.span_ns == (label.began_utc_ns, label.ended_utc_ns)
    shown.draw()
    player.labels.take_back.click()
    shown.until(lambda: not archive.labels.labels, "took it back")


def test_the_chosen_span_is_exported_in_the_background(
    shown: Shown, archive: Archive, settings: ServerSettings, tmp_path: Path
) -> None:
    record(settings)
    play(shown, archive)
    player, tape = shown.window.recordings.player, archive.playback.tape
    assert tape is not None
    player.timeline.choose(tape.first_ns + 2 * 10**9, tape.first_ns + 4 * 10**9)
    player.export_to("csv", tmp_path / "walk.csv")
    job = archive.jobs.jobs[0]
    shown.until(lambda: job.is_over, "exported it")
    assert job.state is JobState.DONE
    assert len((tmp_path / "walk.csv").read_text().splitlines()) == 1 + 2 * RATE_HZ
    shown.open("Cloud")
    assert cell(shown, 2).endswith("walk.csv: 100 rows")


def test_the_store_is_shown_with_where_its_keys_come_from_and_never_the_keys(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    shown.open("Cloud")
    cloud = shown.window.cloud
    shown.until(lambda: "Reached" in cloud.state.text(), "reached it")
    assert cloud._facts["URL"].text() == settings.store.url
    assert cloud._facts["Keys"].text() == "none needed: it is a folder"
    tops = below(cloud.browser.invisibleRootItem())
    assert [top.text(0) for top in tops] == ["telemetry", "sessions", "events", "predictions"]
    tops[0].setExpanded(True)
    robot = below(tops[0])[0]
    assert robot.text(0) == "exo-01"
    robot.setExpanded(True)
    shown.until(lambda: below(robot)[0].text(0).endswith(".parquet"), "listed its files")


def below(item: QTreeWidgetItem) -> list[QTreeWidgetItem]:
    found = [item.child(row) for row in range(item.childCount())]
    return [child for child in found if child is not None]


def test_a_store_that_is_away_says_so_and_is_tried_again(
    shown: Shown, archive: Archive, settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(library, "AGAIN_S", 0.0)
    existing = Store.existing
    away = [True]

    def reach(url: str | None = None) -> Store:
        if away[0]:
            raise StoreError("s3://lab cannot be reached: Connection refused")
        return existing(url)

    monkeypatch.setattr(Store, "existing", reach)
    record(settings)
    shown.open("Cloud")
    shown.until(lambda: "Connection refused" in shown.window.cloud.state.text(), "said so")
    shown.open("Recordings")
    assert "it is tried again" in shown.window.recordings.list.said.text()
    away[0] = False
    shown.until(lambda: shown.window.recordings.list.sessions.rowCount(), "came back")
    shown.open("Cloud")
    assert "Reached" in shown.window.cloud.state.text()


def test_upload_now_asks_who_records_and_does_it_itself_where_nobody_does(
    shown: Shown, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    record(settings, sent=False)
    shown.open("Cloud")
    cloud = shown.window.cloud
    cloud.upload.click()
    job = archive.jobs.jobs[0]
    shown.until(lambda: job.is_over, "uploaded it")
    assert "nothing waits" in job.said
    shown.until(lambda: any("nothing waits" in item.text for item in bench.desk.news.items), "told it")
    keeper = FakeKeeper(report(problem="the store cannot be reached", waiting=2))
    cloud._recording = Recording(By.WINDOW, keeper, lambda call: call(), bench.desk.news)
    cloud._recording.look()
    shown.draw()
    assert "2 batches wait" in cloud.waiting.text()
    assert "It is tried again by itself: the store cannot be reached" in cloud.waiting.text()
    cloud.upload.click()
    assert keeper.asked == ["upload"]


def test_a_job_shows_how_far_it_is_and_can_be_cancelled(shown: Shown, archive: Archive) -> None:
    def long(job: Job) -> str:
        job.expect(10, "files")
        job.done = 4
        while True:
            job.check()
            time.sleep(0.001)

    job = archive.jobs.add("Verify", long)
    shown.open("Cloud")
    table = shown.window.cloud.jobs
    shown.until(lambda: cell(shown, 2) == "4 of 10 files", "showed how far it is")
    cancel = table.cellWidget(0, 3)
    assert isinstance(cancel, QPushButton)
    cancel.click()
    shown.until(lambda: job.state is JobState.CANCELLED, "cancelled it")
    shown.until(lambda: table.cellWidget(0, 3) is None, "took the button away")


def test_a_store_is_downloaded_and_verified(
    shown: Shown, archive: Archive, settings: ServerSettings, tmp_path: Path
) -> None:
    record(settings)
    shown.open("Cloud")
    shown.window.cloud.download_to(tmp_path / "copy", ())
    shown.window.cloud._verify(deep=True)
    shown.until(lambda: all(job.is_over for job in archive.jobs.jobs), "did both")
    assert [job.state for job in archive.jobs.jobs] == [JobState.DONE, JobState.DONE]
    assert Store((tmp_path / "copy").as_uri()).dataset("sessions").count_rows() > 0


def test_everything_that_can_be_reached_has_a_name(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    play(shown, archive)
    nameless = [
        f"{type(widget).__name__} {widget.objectName()}"
        for tab in (shown.window.recordings, shown.window.cloud)
        for widget in tab.findChildren(QWidget)
        if isinstance(widget, QAbstractButton | QLineEdit)
        and widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        and not (widget.accessibleName() or (isinstance(widget, QAbstractButton) and widget.text()))
        and not isinstance(widget.parent(), QComboBox)
    ]
    assert nameless == []


def test_the_controls_of_the_player_stay_in_sight_at_every_size(
    whole: Shown, window: MainWindow, archive: Archive, settings: ServerSettings, theme: Theme
) -> None:
    record(settings)
    play(whole, archive)
    player = window.recordings.player
    for width, height, scale in ((1366, 768, 1.0), (1920, 1080, 2.0)):
        if scale != theme.scale:
            theme.set(Look.LIGHT, scale)
        window.resize(width, height)
        whole.draw()
        assert (window.width(), window.height()) == (width, height)
        for control in (player.timeline, player.play, player.labels.give):
            assert window.tabs.rect().contains(control.mapTo(window.tabs, control.rect().bottomLeft()))


def test_both_tabs_are_drawn_dark_and_light(
    shown: Shown, archive: Archive, settings: ServerSettings, theme: Theme
) -> None:
    record(settings)
    play(shown, archive)
    for look in Look:
        if look is not theme.look:
            theme.set(look)
        for tab in ("Recordings", "Cloud"):
            shown.open(tab)
            shown.draw()
            image = shown.window.grab().toImage()
            places = ((x, y) for x in range(0, image.width(), 5) for y in range(0, image.height(), 5))
            seen = {image.pixel(x, y) for x, y in places}
            assert len(seen) > 40
            assert theme.colour("card").rgb() in seen
