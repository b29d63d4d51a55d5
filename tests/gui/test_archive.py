"""Recordings in the window: listed, played apart from what is live, labelled, exported."""

from pathlib import Path

import msgspec
import numpy as np
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QLineEdit,
    QWidget,
)

from gateway.units import Units
from gateway.wire.stop import Stopped
from ml.store.sessions import UNREAD, Session
from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.jobs import JobState
from server_gui.core.desk.recording import By, Recording
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.tuning.stop import StopState
from server_gui.views.frame.dock_title import DockTitle
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.recordings.sessions import NOTES
from server_gui.views.recordings.timeline import clock_text
from server_gui.views.theme import Look, Theme
from server_gui.views.widgets.time_axis import SHOWN
from tests.gui.archives import RATE_HZ, SECONDS, Shown, cell, play, record
from tests.gui.fakes import Bench
from tests.gui.test_recording import FakeKeeper, report
from tests.support.desk import described, looked, walking
from tests.support.journals import RobotsJournal


def test_recordings_of_store_and_spool_are_listed_with_what_is_in_them(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    record(settings, sent=False)
    archive.library.look(now=True)
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    shown.until(lambda: page.sessions.rowCount() == 2, "listed both")
    texts = [page.table.model().index(row, 5).data() for row in range(2)]
    assert sorted(texts) == ["stored", "waits for upload"]
    for row in range(2):
        page.table.selectRow(row)
        shown.until(lambda: archive.tape, "looked into it")
        shown.draw()
        said = page.details.toPlainText()
        assert "Operator: Ada" in said
        assert "mark: stairs" in said
        assert page.play.isEnabled()


def test_a_recording_that_goes_on_is_said_to_be_recorded_now_with_one_length(
    shown: Shown, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    name = record(settings, sent=False)
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    shown.until(lambda: page.sessions.rowCount(), "listed it")
    made = report()
    link = msgspec.structs.replace(made.robots["exo-01"], session=name)
    keeper = FakeKeeper(msgspec.structs.replace(made, robots={"exo-01": link}))
    page._recording = Recording(By.WINDOW, keeper, lambda call: call(), bench.desk.news)
    page._recording.look()
    page.sessions.take([msgspec.structs.replace(archive.library.found.sessions[0], ended=None)])
    page.table.selectRow(0)
    shown.until(lambda: archive.tape, "looked into it")
    shown.draw()
    said = page.details.toPlainText()
    assert "Ended: not yet: it is recorded now" in said
    assert "killed" not in said
    assert "Length: it goes on\n" in said
    assert "Its first 0:12.0 can be played by now" in said
    assert [page.table.model().index(0, column).data() for column in (2, 5)] == ["goes on", "recorded now"]


def test_notes_of_a_recording_whose_store_is_away_stand_in_the_list_as_beside_it(
    shown: Shown, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    name = record(settings)
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    shown.until(lambda: page.sessions.rowCount(), "listed it")
    made = report()
    link = msgspec.structs.replace(made.robots["exo-01"], session=name, notes="new insoles")
    keeper = FakeKeeper(msgspec.structs.replace(made, robots={"exo-01": link}))
    page._recording = Recording(By.WINDOW, keeper, lambda call: call(), bench.desk.news)
    page._recording.look()
    page.sessions.take([msgspec.structs.replace(archive.library.found.sessions[0], notes=UNREAD)])
    shown.draw()
    shown.draw()
    assert page.sessions.index(0, NOTES).data() == "new insoles"


def test_the_list_says_that_the_store_is_away_before_its_first_frame(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    shown.until(lambda: page.sessions.rowCount(), "listed it")
    shown.open("Cloud")
    archive.library.reach.looked("it cannot be reached")
    shown.window.tabs.setCurrentIndex(0)
    assert page.said.text() == "The store is not reached, retried automatically: it cannot be reached"
    assert page._list.note.startswith("1 session known")


def test_texts_about_labels_are_whole_below_the_list(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    shown.window.resize(660, 590)  # what a screen of 768 leaves beside the panels
    record(settings)
    play(shown, archive)
    player = shown.window.tabs.recordings.player
    player.labelling.setChecked(True)
    archive.labels.said = "labelled: walk, safe here, goes to the store with the next upload"
    archive.labels.revision += 1
    shown.draw()
    bar = player.labels
    bar.right.setText("falling predicted then: 100.0 % right, 0.0 % wrong, 0.0 % not said of 200 " * 3)
    bar.right.show()
    for _ in range(3):
        QApplication.processEvents()
    texts = (bar.said, bar.right)
    assert all(one.height() >= one.heightForWidth(one.width()) > 0 for one in texts), "lines are cut"
    assert bar.said.geometry().bottom() < bar.right.geometry().top()
    assert bar.list.geometry().bottom() < bar.said.geometry().top()


def test_nothing_recorded_yet_says_what_to_do(shown: Shown, archive: Archive) -> None:
    shown.open("Recordings")
    shown.until(lambda: archive.library.revision, "looked")
    shown.draw()
    assert "add a robot" in shown.window.tabs.recordings.list.said.text()
    shown.open("Cloud")
    assert shown.window.tabs.cloud.hint.isVisible()
    assert not shown.window.tabs.cloud.verify.isEnabled()


def test_events_are_called_live_while_a_recording_is_played(
    whole: Shown, full_window: MainWindow, bench: Bench, settings: ServerSettings, archive: Archive
) -> None:
    record(settings)
    play(whole, archive)
    bench.draw(full_window)
    title = full_window.docks[2].titleBarWidget()
    assert isinstance(title, DockTitle)
    assert title.name.text() == "Events, live"
    bench.station.take([described(), walking(300), looked()])
    bench.draw(full_window)
    strip = full_window.alarms
    assert strip.headline.text().startswith("Live: "), "those of the recording are with it"
    full_window.tabs.setCurrentIndex(0)
    bench.draw(full_window)
    assert title.name.text() == "Events"


def test_recordings_can_be_looked_at_without_a_robot(
    whole: Shown, full_window: MainWindow, bench: Bench, settings: ServerSettings, archive: Archive
) -> None:
    record(settings)
    bench.desk.select(None)
    whole.draw()
    assert full_window.empty.isVisible()
    full_window.empty.open.click()
    page = full_window.tabs.recordings.list
    whole.until(lambda: page.sessions.rowCount(), "listed it")
    assert page.isVisible()
    whole.open("Overview")
    assert full_window.empty.isVisible()


def test_playback_is_marked_never_mixed_with_what_is_live_and_shows_what_was_predicted_then(
    whole: Shown, full_window: MainWindow, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    record(settings)
    bench.station.take([walking(50)])
    live = dict(bench.station.robot.values)
    play(whole, archive)
    tape = archive.playback.tape
    assert tape is not None
    player = full_window.tabs.recordings.player
    archive.playback.seek(tape.first_ns + 5 * 10**9)
    whole.until(lambda: not archive.playback.is_loading, "jumped")
    whole.until(lambda: "PLAYBACK, not live: exo-01" in player.banner.text(), "said what it is")
    assert bench.desk.selected is bench.station
    assert bench.station.robot.values == live
    played = archive.playback.desk.stations[0]
    assert played.robot.values["left_knee.position"] != live["left_knee.position"]
    QTest.mousePress(full_window.header.stop, Qt.MouseButton.LeftButton)
    assert bench.first.named("stop") == [], "the app does that"
    bench.station.stop("test")
    bench.first.answer(Stopped({"left_knee": "confirmed"}, True))
    assert bench.station.stopping.state is StopState.CONFIRMED
    assert played.stopping.state is StopState.IDLE
    archive.playback.seek(tape.first_ns + SECONDS * 10**9 // 4)
    whole.until(lambda: player.banner.text().endswith(" · predicted then: Walk\u00a094\u00a0%"), "showed it")
    lines, activity = player.overview.status_lines, player.overview.now.activity
    whole.until(lambda: activity.main.text().startswith("Walk 94 %"), "said it large")
    axis = player.overview._plots[0].plot.getPlotItem().getAxis("bottom")
    whole.until(lambda: axis.tickStrings([0.0], 1.0, 1.0) == [SHOWN], "an instant long past was called now")
    assert activity.detail.text().startswith("said then by the activity model")
    archive.playback.seek(tape.last_ns)
    whole.until(lambda: "predicted" not in player.banner.text(), "jumped")
    whole.until(lambda: any(text.startswith("Not predicted") for text in lines.texts), "said so")
    assert not bench.station.predictions.told


def test_the_audit_shows_the_journal_of_a_robot_that_is_away(
    whole: Shown, full_window: MainWindow, settings: ServerSettings, tmp_path: Path
) -> None:
    (tmp_path / "robot").mkdir()
    journal = RobotsJournal(tmp_path / "robot")
    journal.say("stop", reason="STOP key")
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.journal("exo-07", journal.told().journal.entries)
    journal.close()
    whole.open("Audit")
    whole.until(lambda: full_window.tabs.audit.chosen.rowCount() == 1, "showed it")
    assert "exo-07: collected were 1 entry" in full_window.tabs.audit.verdict.text()


def test_the_bar_of_time_is_used_by_keys_and_by_mouse_and_a_span_exported_in_the_background(
    shown: Shown, archive: Archive, settings: ServerSettings, tmp_path: Path
) -> None:
    record(settings)
    play(shown, archive)
    playback, timeline = archive.playback, shown.window.tabs.recordings.player.timeline
    assert playback.tape is not None
    shown.until(lambda: any(not np.isnan(least).all() for least in playback.outline.least.values()), "read")
    shown.draw()
    drawn, bar = timeline.grab().toImage(), timeline._bar()
    inside = range(round(bar.top()) + 3, round(bar.top() + 0.57 * bar.height()))
    columns = range(round(bar.left()) + 3, round(bar.right()) - 3)
    told = [x for x in columns if len({drawn.pixel(x, y) for y in inside}) > 1]
    assert len(told) > 0.9 * len(columns), "all of it is seen at a glance"
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
    playback.play(False)
    player, tape = shown.window.tabs.recordings.player, archive.playback.tape
    assert tape is not None
    player.timeline.choose(tape.first_ns + 2 * 10**9, tape.first_ns + 4 * 10**9)
    player.export_to("csv", tmp_path / "walk.csv")
    job = archive.jobs.jobs[0]
    shown.until(lambda: job.is_over, "exported it")
    assert job.state is JobState.DONE
    assert len((tmp_path / "walk.csv").read_text().splitlines()) == 1 + 2 * RATE_HZ
    shown.open("Cloud")
    assert cell(shown, 2).endswith("walk.csv: 100 rows")


def test_a_span_is_labelled_a_contradiction_is_refused_and_a_label_taken_back(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    play(shown, archive)
    player, tape = shown.window.tabs.recordings.player, archive.playback.tape
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


def test_the_controls_of_the_player_stay_in_sight_at_every_size(
    whole: Shown, full_window: MainWindow, archive: Archive, settings: ServerSettings, theme: Theme
) -> None:
    record(settings)
    play(whole, archive)
    player = full_window.tabs.recordings.player
    for width, height, scale in ((1366, 768, 1.0), (1024, 700, 1.5)):
        if scale != theme.scale:
            theme.set(Look.LIGHT, scale)
        full_window.resize(width, height)
        whole.draw()
        assert (full_window.width(), full_window.height()) == (width, height)
        if not player.labelling.isChecked():
            assert player._stack.height() > full_window.tabs.height() / 3, "the robot is not seen"
            player.labelling.click()
            whole.draw()
        for control in (player.timeline, player.play, player.labels.give):
            assert full_window.tabs.rect().contains(
                control.mapTo(full_window.tabs, control.rect().bottomLeft())
            )
        plot = player.overview._plots[0].plot
        seen = player._stack.height() - plot.mapTo(player._stack, QPoint()).y()
        assert seen >= theme.px(20), "what is labelled is not seen"


def test_both_tabs_are_drawn_dark_and_light_and_everything_in_reach_has_a_name(
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
            places = ((x, y) for x in range(0, image.width(), 9) for y in range(0, image.height(), 9))
            seen = {image.pixel(x, y) for x, y in places}
            assert len(seen) > 40
            assert theme.colour("card").rgb() in seen
    assert shown.window.tabs.recordings.changed is not None  # made now
    nameless = [
        f"{type(widget).__name__} {widget.objectName()}"
        for tab in (shown.window.tabs.recordings, shown.window.tabs.cloud)
        for widget in tab.findChildren(QWidget)
        if isinstance(widget, QAbstractButton | QLineEdit)
        and widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        and not (widget.accessibleName() or (isinstance(widget, QAbstractButton) and widget.text()))
        and not isinstance(widget.parent(), QComboBox)
    ]
    assert nameless == []


def test_what_a_recording_began_with_is_in_the_window_s_units(archive: Archive, bench: Bench) -> None:
    held = {"gait.step_length": 0.4300000131, "gait.trunk_angle": None, "gone.gain": 2.0}
    walk = Session("exo-01", "s", parameters=held, setup={"object/gait.step_length": "gait m"})
    assert archive.held_then(walk) == ["gait.step_length = 430 mm", "gone.gain = 2 (SI)"]
    bench.desk.shown.change(Units(by_si={"m": "m"}))
    assert archive.held_then(walk)[0] == "gait.step_length = 0.43 m"
    assert archive.held_then(msgspec.structs.replace(walk, setup={}))[0] == "gait.step_length = 0.43 (SI)"
    zero = {"gait.step_length": 0.0, "gone.gain": 0}
    assert archive.held_then(msgspec.structs.replace(walk, parameters=zero)) == [
        "gait.step_length = 0 m",
        "gone.gain = 0 (SI)",
    ]
