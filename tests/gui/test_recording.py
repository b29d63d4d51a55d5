"""What the window says of recording, and that it records: once, in one store, and not where another does."""

import concurrent.futures
import contextlib
import itertools
import re
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from PySide6.QtCore import QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from gateway.client import Address
from ml.store import Store
from ml.store.tables import TELEMETRY
from server_gui.app import App
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk import feeds
from server_gui.core.desk.feeds import Record
from server_gui.core.desk.recording import SOON, By, Recording, Tone
from server_gui.core.fleet.collector import Collector, CollectorReport
from server_gui.core.fleet.link_statistics import LinkStatistics
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.recording.recorder import Alarm, AlarmKind, RecorderState
from server_gui.core.recording.records import Worn
from server_gui.core.recording.uploader import UploaderState
from server_gui.core.settings.server_file import (
    RecordingSettings,
    ServerSettings,
    StoreSettings,
    Upload,
    add_robots,
)
from server_gui.views.confirmation import Question
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.recording_chip import stop_question
from server_gui.views.frame.status_bar import StatusBar
from server_gui.views.theme import Theme
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from tests.fake_robot import FakeRobot
from tests.gui.fakes import Bench, destroy
from tests.gui.running import running, wait

ADDRESS = "192.0.2.7:7420"
FULL = Alarm(AlarmKind.DISK_FULL, "recording has stopped: the disk of /spool is nearly full; make room there")
AWAY = "the store s3://lab/exo cannot be reached: Connection refused"


def report(
    alarms: tuple[Alarm, ...] = (),
    problem: str | None = None,
    waiting: int = 0,
    rows_per_s: float = 50.0,
    age_s: float | None = 0.1,
    **more: Any,
) -> CollectorReport:
    link = LinkStatistics(Address.parse(ADDRESS)).report("")
    link = replace(link, rows_per_s=rows_per_s, newest_age_s=age_s)
    return CollectorReport(
        version="1.0",
        pid=77,
        began_utc_s=1.0,
        spool="/spool",
        store="s3://lab/exo",
        upload=Upload.ALWAYS,
        disk_free_bytes=31 << 30,
        robots={"exo-01": link},
        recorder=RecorderState(12, 3, 0, 0.01, alarms),
        uploader=UploaderState(2, waiting, 5 << 20, 0.5, problem),
        **more,
    )


class FakeKeeper:
    """Answers at once with what the test says."""

    def __init__(self, answer: CollectorReport | Exception) -> None:
        self.answer = answer
        self.asked: list[str] = []
        self.marked = 2

    def report(self) -> "Future[CollectorReport]":
        return settled(self.answer)

    def mark(self, text: str, ago_s: float = 0.0) -> "Future[int]":
        self.asked.append(f"mark {text}")
        return settled(self.marked)

    def upload(self) -> "Future[int]":
        self.asked.append("upload")
        return settled(0)

    def pause(self) -> "Future[None]":
        self.asked.append("pause")
        return settled(None)

    def go_on(self, name: str, wearer: str | None = None) -> "Future[None]":
        self.asked.append(f"go on {name}")
        return settled(None)


def settled(answer: Any) -> "Future[Any]":
    future: Future[Any] = concurrent.futures.Future()
    if isinstance(answer, Exception):
        future.set_exception(answer)
    else:
        future.set_result(answer)
    return future


def looked(keeper: FakeKeeper, by: By = By.WINDOW, why: str = "") -> tuple[Recording, News]:
    news = News()
    recording = Recording(by, keeper, lambda call: call(), news, why, keeper if by is By.WINDOW else None)
    recording.look()
    return recording, news


def test_all_is_well() -> None:
    recording, news = looked(FakeKeeper(report()))
    said = recording.said(ADDRESS)
    assert said.tone is Tone.GOOD
    assert said.text == "Recording · 50 rows/s · 5.0 MiB to upload · 31.00 GiB free"
    assert not news.items


def test_all_is_uploaded_only_where_not_a_row_waits() -> None:
    empty = replace(report(), uploader=UploaderState(2))
    assert " · all uploaded · " in looked(FakeKeeper(empty))[0].said(ADDRESS).text
    no_batch_yet = replace(report(), uploader=UploaderState(2, 0, 1 << 20, problem=AWAY))
    assert "store not reached, 1.0 MiB to upload" in looked(FakeKeeper(no_batch_yet))[0].said(ADDRESS).text


@pytest.mark.parametrize("age_s", [None, 5.0])
def test_a_recording_to_which_nothing_comes_is_not_all_well(age_s: float | None) -> None:
    recording, _ = looked(FakeKeeper(report(age_s=age_s)))
    said = recording.said(ADDRESS)
    assert said.tone is Tone.WARNING
    assert said.text.startswith("Recording · nothing comes · ")


def test_a_recording_is_not_all_well_once_the_link_is_old() -> None:
    recording, _ = looked(FakeKeeper(report()))
    assert recording.said(ADDRESS).tone is Tone.GOOD
    said = recording.said(ADDRESS, is_live=False)
    assert (said.tone, said.text[:26]) == (Tone.WARNING, "Recording · nothing comes ")


def test_a_window_without_a_robot_is_not_said_to_record() -> None:
    recording, _ = looked(FakeKeeper(report()))  # the report is of a moment ago, when there was one
    said = recording.said(None, is_live=False)
    assert (said.tone, said.text) == (Tone.OFF, "No robot to record")


def test_rows_come_before_there_is_a_rate_of_them() -> None:
    recording, _ = looked(FakeKeeper(report(rows_per_s=0.0)))
    said = recording.said(ADDRESS)
    assert (said.tone, said.text[:22]) == (Tone.GOOD, "Recording · rows come ")


def test_what_is_not_kept_and_what_is_not_uploaded_are_alarms_of_their_own() -> None:
    recording, _ = looked(FakeKeeper(report((FULL,), AWAY)))
    told = {one.alarm.kind: one.alarm for one in recording.alarms.active}
    assert told[Kind.NOT_RECORDED].what == FULL.text
    assert told[Kind.UPLOAD].what == AWAY
    assert all(one.check for one in told.values())
    fine, _ = looked(FakeKeeper(report()))
    assert not fine.alarms.active


def test_a_recording_is_stopped_and_started_by_its_name() -> None:
    keeper = FakeKeeper(report(is_paused=True))
    recording, news = looked(keeper)
    assert recording.is_paused
    assert recording.can_pause
    assert (recording.said(ADDRESS).tone, recording.said(ADDRESS).text) == (
        Tone.OFF,
        "Not recording: stopped",
    )
    assert not recording.alarms.active
    recording.go_on("Ada, stairs")
    recording.mark("here")
    keeper.answer = report()
    recording.look()
    recording.pause()
    assert keeper.asked == ["go on Ada, stairs", "pause"], "nothing is marked where nothing is recorded"
    assert any("not marked" in item.text for item in news.items)


def test_a_disk_that_is_full_is_said_with_what_to_do_and_once_in_the_news() -> None:
    keeper = FakeKeeper(report((FULL,)))
    recording, news = looked(keeper)
    said = recording.said(ADDRESS)
    assert (said.tone, said.text) == (Tone.BAD, "RECORDING HAS STOPPED")
    assert "make room there" in said.detail
    for answer in (report((FULL,)), report()):
        keeper.answer = answer
        recording._asked_ns = None
        recording.look()
    assert [item.text for item in news.items] == [f"trouble ended after 1 s: {FULL.text}", FULL.text]
    assert recording.said(ADDRESS).tone is Tone.GOOD


def test_a_spool_that_can_be_read_again_is_said_to_be_so_with_how_long_it_was_not() -> None:
    away = Alarm(AlarmKind.UNCLEARED, "the spool /spool cannot be read: No such file or directory")
    keeper = FakeKeeper(report((away,)))
    recording, news = looked(keeper)
    keeper.answer, recording._asked_ns = report(), None
    recording.look()
    assert news.items[0].text == "trouble ended after 1 s: the spool /spool can be read again"
    assert (news.items[0].kind, news.items[1].kind) == (NewsKind.STATE, NewsKind.WARNING)


def test_without_the_spools_folder_the_remedy_is_to_create_it() -> None:
    gone = Alarm(AlarmKind.SPOOL_FAILED, "the spool /spool cannot be read: No such file or directory")
    recording, _ = looked(FakeKeeper(report((gone,))))
    [one] = recording.alarms.active
    assert one.alarm.check.startswith("create the folder, or check its mount")


def test_a_recording_that_was_stopped_says_since_when_and_how_much_is_kept() -> None:
    began = report()
    link = replace(began.robots["exo-01"], recording_since_utc_s=time.time() - 41, notes="P01", session="s")
    keeper = FakeKeeper(replace(began, robots={"exo-01": link}))
    recording, _ = looked(keeper)
    assert stop_question(recording).startswith("Stop “P01”, 0:41, of exo-01?")
    recording.pause()
    keeper.answer, recording._asked_ns = report(is_paused=True), None
    recording.look()
    said = recording.said(ADDRESS).text
    assert re.fullmatch(r"Not recording: stopped · since \d\d:\d\d:\d\d · 0:4[12] kept", said)


def test_a_store_that_is_away_is_a_warning_and_recording_goes_on() -> None:
    recording, news = looked(FakeKeeper(report(problem=AWAY, waiting=3)))
    said = recording.said(ADDRESS)
    assert said.tone is Tone.WARNING
    assert "store not reached, 5.0 MiB to upload" in said.text
    assert said.reason == "an upload failed"
    recording.reach.looked(AWAY)
    assert recording.said(ADDRESS).reason == "store not reached", "the header's second line begins with it"
    assert said.detail.startswith(AWAY)
    assert news.items[0].text == AWAY


def test_a_robot_that_the_other_program_does_not_follow_is_said_not_to_be_recorded() -> None:
    recording, _ = looked(FakeKeeper(report()), By.OTHER, "another server records into /spool")
    assert recording.said(ADDRESS).text.startswith("Recording by process 77")
    said = recording.said("192.0.2.9:7420")
    assert (said.tone, said.text) == (Tone.WARNING, "This robot is NOT recorded")
    assert "add it to [robots]" in said.detail


def test_nobody_who_answers_is_bad_and_nobody_at_all_is_said() -> None:
    recording, _ = looked(FakeKeeper(ConnectionError("gone")), By.OTHER, "the folder cannot be used")
    said = recording.said(ADDRESS)
    assert (said.tone, said.detail) == (Tone.BAD, f"the folder cannot be used; {SOON}")
    nobody = Recording(By.NOBODY, None, lambda call: call(), News(), "to show only")
    assert (nobody.said(None).tone, nobody.said(None).text) == (Tone.OFF, "Not recording")


def test_marks_and_uploads_are_asked_for_and_told() -> None:
    keeper = FakeKeeper(report())
    recording, news = looked(keeper)
    recording.mark("stairs")
    recording.upload()
    assert keeper.asked == ["mark stairs", "upload"]
    assert "marked in the recordings of 2 robots: stairs" in [item.text for item in news.items]
    keeper.marked = 0
    recording.mark("door", 90.0)
    assert [item.kind for item in news.items if "NOT marked" in item.text] == [NewsKind.WARNING]


# --- the whole window


def test_the_status_bar_says_why_recording_is_yellow_however_little_room_it_has(
    window: MainWindow, bench: Bench
) -> None:
    bench.desk.recording, _ = looked(FakeKeeper(report()))
    bench.desk.recording.reach.looked(AWAY)
    bench.draw(window)
    assert all("store not reached" in wording for wording in window._bar.recording._wordings)


def test_ctrl_r_asks_before_it_ends_a_recording_whose_chip_says_for_how_long_and_as_what(
    window: MainWindow, bench: Bench
) -> None:
    keeper = FakeKeeper(report())
    bench.desk.recording, _ = looked(keeper)
    bench.draw(window)
    QTest.keyClick(window, Qt.Key.Key_R, Qt.KeyboardModifier.ControlModifier)
    (question,) = window.findChildren(Question)
    assert keeper.asked == []
    question.act.click()
    assert keeper.asked == ["pause"]
    keeper.answer = report(is_paused=True)
    bench.desk.recording.look()
    bench.draw(window)
    assert window.header.recording.main_text == "Not recording: stopped"
    assert window.header.recording.detail_text.startswith("since ")
    window.header.recording.turn.click()
    asked = window.findChildren(Question)[-1]
    assert asked.field is not None
    asked.field.setText("Ada, stairs")
    QTest.keyClick(asked.field, Qt.Key.Key_Return)
    assert keeper.asked == ["pause", "go on Ada, stairs"]
    answer = report()
    since_s = time.time() - 3725
    link = replace(
        answer.robots["exo-01"],
        address=bench.station.address,
        recording_since_utc_s=since_s,
        notes="Ada, stairs",
    )
    bench.desk.recording, _ = looked(FakeKeeper(replace(answer, robots={"exo-01": link})))
    bench.draw(window)
    chip = window.header.recording
    assert chip.main_text.startswith("Recording 1:02:0")
    assert "Ada, stairs" in chip.accessibleDescription()
    assert chip.turn.isVisible()
    bench.desk.recording = Recording(By.NOBODY, None, lambda call: call(), News(), "to show only")
    bench.draw(window)
    assert not chip.turn.isVisible()


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as made:
        yield made


@pytest.fixture
def settings(robot: FakeRobot, tmp_path: Path, folder_url: str) -> ServerSettings:
    recorder = RecordingSettings(spool=tmp_path / "spool", batch_s=1.0)
    return add_robots(ServerSettings({}, StoreSettings(folder_url), recorder), {"exo-01": robot.address})


@pytest.fixture
def kept(tmp_path: Path) -> QSettings:
    return QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)


def test_what_the_window_shows_is_in_the_store_and_came_by_one_link(
    qt: QApplication, settings: ServerSettings, kept: QSettings, robot: FakeRobot
) -> None:
    with FakeRobot() as other, running(qt, settings, kept, Record("Ada", "first")) as app:
        station = app.desk.stations[0]
        wait(lambda: not station.robot.is_stale() and bool(station.robot.parameters), "was live")
        wait(lambda: app.desk.recording.report is not None, "told how recording goes")
        wait(lambda: app.desk.recording.said(station.address).tone is Tone.GOOD, "recorded")
        app.desk.recording.mark("stairs")
        wait(lambda: station.robot.resources is not None, "saw the robot's computer")
        wait(lambda: rows(app, "exo-01") > 20, "recorded rows")
        assert len(robot.called("stream.start")) == 1
        app.window.added.emit(other.address)
        wait(lambda: not app.desk.stations[1].robot.is_stale(), "saw the one that was added")
        name = app.desk.stations[1].name
        wait(lambda: rows(app, name) > 5, "recorded it too")
        shown = app.window.statusBar().findChildren(ShrinkingLabel)
        wait(lambda: any(label.text().startswith("Recording · ") for label in shown), "said so")
    store = Store(settings.store.url)
    assert store.dataset(TELEMETRY.location("exo-01", 1)).count_rows() > 10
    assert store.dataset(TELEMETRY.location(name, 1)).count_rows() > 0
    assert store.dataset("sessions").to_table()["operator"].to_pylist()[-1] == "Ada"
    assert "stairs" in store.dataset("events").to_table()["text"].to_pylist()


def test_what_comes_while_it_is_stopped_is_not_kept_and_a_name_begins_a_session(
    qt: QApplication, settings: ServerSettings, kept: QSettings
) -> None:
    with running(qt, settings, kept, Record("Ada", "first", Worn("P01", "signed"))) as app:
        recording, station = app.desk.recording, app.desk.stations[0]
        wait(lambda: rows(app, "exo-01") > 5 and recording.can_pause, "recorded")
        assert recording.wearer == "P01"
        recording.pause()
        wait(lambda: recording.is_paused, "stopped")
        newest_ns = station.rings.newest_ns or 0
        wait(lambda: (station.rings.newest_ns or 0) > newest_ns + 10**9, "is shown as before")
        recording.go_on("stairs", "P02")
        wait(lambda: not recording.is_paused, "went on")
        link = recording.link(station.address)
        assert link is not None
        assert (link.notes, link.wearer, recording.wearer) == ("stairs", "P02", "P02")
        again_ns = station.rings.newest_ns or 0
        wait(lambda: (station.rings.newest_ns or 0) > again_ns + 5 * 10**8, "recorded again")
        recording.pause()
        wait(lambda: recording.is_paused, "stopped")
        recording.go_on("")
        wait(lambda: not recording.is_paused, "went on")
        link = recording.link(station.address)
        assert link is not None
        assert (link.notes, link.wearer) == ("", "P02"), "without a name it has no other's"
    store = Store(settings.store.url)
    sessions = store.dataset("sessions").to_table().to_pylist()
    notes = {row["session"]: row["notes"] for row in sessions}
    assert sorted(notes.values()) == ["", "first", "stairs"]
    worn = {(row["notes"], row["wearer"], row["consent"]) for row in sessions}
    assert worn == {("first", "P01", "signed"), ("stairs", "P02", ""), ("", "P02", "")}, (
        "what another has agreed to is not hers"
    )
    stamps_ns = store.dataset(TELEMETRY.location("exo-01", 1)).to_table(["stamp_ns"])["stamp_ns"].to_pylist()
    gaps_ns = [late - soon for soon, late in itertools.pairwise(sorted(stamps_ns))]
    assert max(gaps_ns) > 9 * 10**8


def rows(app: App, robot: str) -> int:
    report = app.desk.recording.report
    return 0 if report is None or robot not in report.robots else report.robots[robot].rows


def test_the_window_says_who_records_and_does_so_when_they_have_ended(
    qt: QApplication,
    settings: ServerSettings,
    kept: QSettings,
    robot: FakeRobot,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(feeds, "GIVE_WAY_S", 0.1)
    with contextlib.ExitStack() as other:
        other.enter_context(Collector(settings))
        with running(qt, settings, kept, Record("Ada", "after")) as app:
            recording, station = app.desk.recording, app.desk.stations[0]
            wait(lambda: recording.report is not None and not station.robot.is_stale(), "asked the collector")
            assert recording.by is By.OTHER
            assert recording.said(station.address).text.startswith("Recording by process")
            wait(lambda: rows(app, "exo-01") > 0, "was recorded")
            recording.mark("here")
            wait(lambda: any("marked in" in item.text for item in app.desk.news.items), "marked there")
            before = len(station.rings.times(60.0))
            other.close()
            wait(lambda: recording.by is By.WINDOW, "took over")
            wait(lambda: rows(app, "exo-01") > 20, "recorded")
            assert recording.said(station.address).tone is Tone.GOOD
            assert len(station.rings.times(60.0)) > before > 0, "what was shown stays"
            recording.mark("mine")
            wait(lambda: sum("marked in" in item.text for item in app.desk.news.items) == 2, "marked")
            told = [item.text for item in app.desk.news.items]
            assert sum("this window does from now on" in text for text in told) == 1
    store = Store(settings.store.url)
    sessions = {row["session"]: row["operator"] for row in store.dataset("sessions").to_table().to_pylist()}
    assert sorted(sessions.values()) == ["", "Ada"]
    recorded = store.dataset(TELEMETRY.location("exo-01", 1)).to_table(["session", "stamp_ns"]).to_pylist()
    stamps = [(row["session"], row["stamp_ns"]) for row in recorded]
    assert len(stamps) == len(set(stamps)), "no row is there twice"
    assert {session for session, _ in stamps} == set(sessions)
    assert {"here", "mine"} <= set(store.dataset("events").to_table()["text"].to_pylist())


def test_a_window_that_only_shows_never_records(
    qt: QApplication, settings: ServerSettings, kept: QSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feeds, "GIVE_WAY_S", 0.0)
    with running(qt, settings, kept) as app:
        wait(lambda: not app.desk.stations[0].robot.is_stale(), "was live")
        assert app.desk.recording.said(None).text == "Not recording"
        with Collector(settings):
            pass  # the spool was free


def test_a_spool_that_cannot_be_used_keeps_nothing_from_being_shown(
    qt: QApplication,
    settings: ServerSettings,
    kept: QSettings,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "spool").write_text("no folder")
    with running(qt, settings, kept, Record()) as app:
        station = app.desk.stations[0]
        wait(lambda: not station.robot.is_stale(), "was live")
        wait(lambda: app.desk.recording.problem is not None, "found nobody")
        said = app.desk.recording.said(station.address)
        assert (said.tone, said.text) == (Tone.BAD, "NOT RECORDING")
        assert said.detail.startswith("the spool's folder ")
        assert said.detail.endswith("; this window records as soon as it can")
        monkeypatch.setattr(feeds, "GIVE_WAY_S", 0.0)
        (tmp_path / "spool").unlink()
        wait(lambda: rows(app, "exo-01") > 0, "recorded, once it could")


def test_that_nothing_comes_is_said_in_the_last_line_however_little_room_there_is(
    theme: Theme, bench: Bench
) -> None:
    bar = StatusBar(bench.desk, theme)
    bench.desk.recording = looked(FakeKeeper(report(age_s=None)))[0]
    bar.refresh()
    assert "nothing comes" in bar.recording._wordings[0]
    assert bar.recording._wordings[-1] == "nothing comes"
    destroy(bar)
