"""A recording with a fault in it: the alarm of that time is shown again, and leads to its signal."""

import dataclasses
import importlib.metadata
import re

import pytest
from msgspec.structs import replace
from PySide6.QtCore import QPointF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMenu

from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.tape import Tape, as_time
from server_gui.core.desk.flags import Flag, FlagKind
from server_gui.core.settings.server_file import ServerSettings
from server_gui.views.recordings.player import SIGNALS, Player
from server_gui.views.recordings.timeline import clock_text, day_text
from server_gui.views.widgets.cursors import FIRST, FLAGS
from tests.gui.archives import ADA, RATE_HZ, Shown, play, record
from tests.gui.fakes import Bench
from tests.support.desk import described, looked

FAULT_S = 5.0


@pytest.fixture
def player(shown: Shown, archive: Archive, settings: ServerSettings) -> Player:
    record(settings, fault_s=FAULT_S)
    play(shown, archive)
    return shown.window.tabs.recordings.player


def at(seconds: float, tape: Tape) -> int:
    return tape.first_ns + round(seconds * 1e9)


def test_flags_outside_of_it_are_not_at_the_ends_of_its_bar_and_the_list_says_so(
    shown: Shown, archive: Archive, player: Player
) -> None:
    tape = archive.playback.tape
    assert tape is not None
    before, early, after = (
        Flag(at(seconds, tape), text, FlagKind.MARK)
        for seconds, text in ((-3.0, "before"), (2.0, "early"), (99.0, "after"))
    )
    archive.playback.happened.flags.add(before, early, after)
    player._refresh_words()
    timeline = player.timeline
    bar = timeline._bar()
    places = [QPointF(x, bar.top() - 4) for x in (bar.left(), timeline._x(early.at_ns), bar.right())]
    assert [timeline._flag_at(place) for place in places] == [None, early, None]
    menu = QMenu()
    player._list_events(menu)
    said = [action.text() for action in menu.actions()]
    assert any(text.endswith("mark: before, before its beginning") for text in said)
    assert any(text.endswith("mark: after, after its end") for text in said)
    archive.playback.seek(at(8.0, tape))
    player._turn(1)
    assert archive.playback.position_ns == at(8.0, tape), "there is no event to go to in it"


def test_once_a_drive_has_failed_its_row_is_seen_on_a_low_screen(
    shown: Shown, archive: Archive, player: Player
) -> None:
    shown.window.resize(660, 590)  # what a screen of 768 leaves beside the panels
    player.labelling.setChecked(False)
    to_the_fault(shown, archive, player)
    shown.draw()
    table = player.overview._table
    row = next(
        row
        for row in range(table.model().rowCount())
        if "left knee" in str(table.model().index(row, 0).data())
    )
    place = table.visualRect(table.model().index(row, 0))
    place.moveTopLeft(table.viewport().mapTo(table, place.topLeft()))
    assert table.visibleRegion().contains(place), "it has to be scrolled to"


def test_pages_of_a_replay_keep_their_names_and_order_as_an_alarm_comes(
    shown: Shown, archive: Archive, player: Player
) -> None:
    def names() -> list[str]:
        buttons = player.overview.sections.buttons
        return [one.text().lstrip("■▲ ").partition(":")[0] for one in buttons if not one.isHidden()]

    shown.window.resize(660, 590)
    player.labelling.setChecked(False)
    shown.until(lambda: len(names()) > 1, "arranged its pages")
    before = names()
    assert not player.overview._joints.isVisible(), "it begins with how the walk looked"
    to_the_fault(shown, archive, player)
    shown.draw()
    assert player.overview._joints.isVisible()
    assert names() == before


def test_the_limits_of_a_replay_are_those_of_the_recording_and_never_of_the_live_robot(
    shown: Shown, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    knee = "left_knee.max_torque"
    bench.station.take([described(), looked({knee: 80.0})])
    setup: dict[str, str | float] = {f"object/{knee}": "0x6072:0 N·m"}
    record(settings, facts=replace(ADA, parameters={knee: 30.0}, setup=setup))
    play(shown, archive)
    player = shown.window.tabs.recordings.player
    tape, torque = archive.playback.tape, player.overview._plots[1]
    assert tape is not None

    def limits_at(seconds: float) -> list[float]:
        archive.playback.seek(at(seconds, tape))
        shown.until(lambda: not archive.playback.is_loading, "went there")
        player.overview.read_now()
        shown.draw()
        return list(torque.plot._limits)

    assert limits_at(2.0) == [30.0, -30.0]
    assert "start ±30" in torque.legend.accessibleDescription(), "no journal is known"
    asked: dict[str, object] = {"what": "write", "write": 1, "before": {knee: 30.0}, "after": {knee: 40.0}}
    journal = [
        {**asked, "utc_ns": at(5.0, tape)},
        {"what": "write done", "write": 1, "after": {knee: 40.0}, "utc_ns": at(5.1, tape)},
    ]
    archive.playback.parameters.tell(journal, tape.first_ns, tape.last_ns)
    assert limits_at(4.0) == [30.0, -30.0]
    assert "±30" in torque.legend.accessibleDescription()
    assert "start" not in torque.legend.accessibleDescription()
    assert limits_at(6.0) == [40.0, -40.0]


def to_the_fault(shown: Shown, archive: Archive, player: Player, later_s: float = 2.0) -> None:
    """As its event in the bar leads there, and some seconds more."""
    tape = archive.playback.tape
    assert tape is not None
    archive.playback.seek(tape.first_ns + round((FAULT_S + later_s) * 1e9))
    shown.until(lambda: player.alarms.told, "said what was wrong then")


def test_before_the_fault_there_is_no_alarm_and_at_it_there_is_about_which_nothing_can_be_done(
    shown: Shown, archive: Archive, player: Player
) -> None:
    shown.draw()
    assert not player.alarms.isVisible()
    to_the_fault(shown, archive, player)
    shown.draw()
    assert player.alarms.isVisible()
    said = player.alarms.headline.text()
    assert "left knee" in said
    assert "0x2310" in said
    shown.until(lambda: len(archive.playback.happened.flags) > 1, "found the fault's event")
    assert any("left knee" in flag.text for flag in archive.playback.happened.flags)

    shown.window.resize(1900, 900)
    shown.draw()
    assert player.alarms.buttons.clear.isHidden()
    assert player.alarms.buttons.acknowledge.isHidden()


def test_back_before_the_fault_its_line_says_that_there_was_none_then(
    shown: Shown, archive: Archive, player: Player
) -> None:
    to_the_fault(shown, archive, player)
    shown.until(lambda: player.timeline._flags, "showed its events on the axis of time")
    assert player.events.isEnabled(), "they are listed as soon as they are shown"
    tape = archive.playback.tape
    assert tape is not None
    archive.playback.seek(tape.first_ns + 1_000_000_000)
    shown.until(lambda: not player.alarms.told, "went back")
    shown.until(lambda: player.alarms.headline.text() == "No alarm then", "said so")
    assert "trouble of its buses is on the time axis" in player.alarms.details.text(), (
        "nobody has looked at these"
    )
    assert player.alarms.isVisible(), "nothing moves"


def test_at_its_very_instant_the_code_that_comes_later_is_known(
    shown: Shown, archive: Archive, player: Player
) -> None:
    """It sent people to the manual, and the list beside it had the code."""
    shown.until(lambda: any("0x2310" in one.text for one in archive.playback.happened.flags), "found it")
    player._turn(1)  # as its flag and the list of events lead there
    shown.until(lambda: player.alarms.told, "said what was wrong then")
    shown.draw()
    assert player.overview.now.drives.main.text() == "1 in fault"
    assert archive.playback.desk.stations[0].robot.values["left_knee.error_code"] == 0.0
    said = player.alarms.headline.text()
    assert "0x2310" in said
    assert "a moment later" in said


def test_its_signal_is_shown_before_and_after_the_fault(
    shown: Shown, archive: Archive, player: Player
) -> None:
    to_the_fault(shown, archive, player)
    shown.draw()
    player.alarms.more.click()
    shown.draw()
    (row,) = (row for row in player.alarms.list.rows if row.isVisible() and not row.show_signal.isHidden())
    row.show_signal.click()
    shown.until(lambda: player.signals.scene.frozen, "stood still at it")
    assert player._stack.currentIndex() == SIGNALS
    assert not archive.playback.playing
    quantities = {name.removeprefix("left_knee.") for name in player.signals.chosen}
    assert {"current", "torque", "position", "velocity"} <= quantities, "all of that drive"
    jump = player.signals._jump
    assert jump is not None
    assert 0 < jump.at_ns - jump.read_ns <= 1.5e9 / RATE_HZ, "the row before is read, which led to it"
    left, right = player.signals._window
    jump, newest_ns = player.signals._jump, player.signals.scene.newest_ns
    assert jump is not None
    assert newest_ns is not None
    at_s = (jump.at_ns - newest_ns) / 1e9
    assert left == pytest.approx(at_s - 5.0, abs=0.2)
    assert right == pytest.approx(at_s + 5.0, abs=0.2)


@pytest.mark.parametrize("high", [590, 900])
def test_a_replay_stands_at_the_fault_whose_signals_are_shown_and_says_its_alarm(
    shown: Shown, archive: Archive, player: Player, high: int
) -> None:
    shown.window.resize(660, high)
    player.labelling.setChecked(False)
    to_the_fault(shown, archive, player, 0.02)
    (_, alarm), *_ = player.alarms.told
    assert alarm.at_ns is not None
    player.show_around("left_knee.current", alarm.at_ns)
    shown.until(lambda: player.signals.scene.frozen, "stood still at it")
    shown.draw()
    playback, tape, signals = archive.playback, archive.playback.tape, player.signals
    assert tape is not None
    assert 0.04 <= (playback.position_ns - tape.first_ns) / 1e9 - FAULT_S <= 0.15, "its code is there"
    assert player.alarms.isVisible()
    assert "left knee" in player.alarms.headline.text()
    assert "0x2310" in player.alarms.headline.text()
    frozen, jump = signals.scene.frozen, signals._jump
    assert frozen is not None
    assert jump is not None
    assert frozen.newest_ns - jump.at_ns == pytest.approx(5e9, abs=2e8), "what comes after it is kept"
    assert signals._read_s == (jump.read_ns - frozen.newest_ns) / 1e9, "values are those just before it"
    assert signals.plots[0].note == f"0:0{FAULT_S - 1 / RATE_HZ:.2f}", "as the axis below it counts"
    assert any(flag.kind is FlagKind.FAULT for flag in jump.flags)


def test_clock_and_alarm_are_of_the_instant_that_a_jump_leads_to(
    shown: Shown, archive: Archive, player: Player
) -> None:
    to_the_fault(shown, archive, player)
    shown.draw()
    playback, tape = archive.playback, archive.playback.tape
    assert tape is not None
    for seconds, told in ((FAULT_S - 3.0, False), (FAULT_S + 1.0, True)):
        player._pace.is_due(None)  # the next look at what people read is some frames away
        playback.seek(tape.first_ns + round(seconds * 1e9))
        player.refresh()
        assert not playback.is_loading
        assert player.place.text().startswith(clock_text(seconds, 1))
        assert bool(player.alarms.told) is told


def test_while_it_plays_the_clock_is_of_the_playhead_in_every_frame(
    shown: Shown, archive: Archive, player: Player, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a busy computer a frame takes as long as many, and words were those of five frames before."""
    playback, tape = archive.playback, archive.playback.tape
    assert tape is not None
    now_s = 100.0
    monkeypatch.setattr("server_gui.core.archive.playback.time.monotonic", lambda: now_s)
    playback.play(on=True)
    player.refresh()
    for _ in range(8):
        now_s += 0.3
        player.refresh()
        since_s = (playback.position_ns - tape.first_ns) / 1e9
        assert player.timeline._position_ns == playback.position_ns
        assert player.place.text().startswith(f"{clock_text(since_s, 1)} of ")
        assert day_text(playback.position_ns) in player.banner.text()
    assert playback.position_ns > tape.first_ns + 2 * 10**9, "it has played"


def test_a_recording_that_stands_still_is_said_to_be_paused_alone(
    shown: Shown, archive: Archive, player: Player
) -> None:
    to_the_fault(shown, archive, player)
    player._choice.button(SIGNALS).click()
    player.signals.pause.click()
    shown.draw()
    assert player.signals.said.text() == "Paused"
    playback, tape = archive.playback, archive.playback.tape
    assert tape is not None
    player.signals.choose(["left_knee.current"])
    for _ in range(2):  # it goes on, and stands still with the curve
        player.signals.pause.click()
        player.signals.refresh()
    axis = player.signals.plots[0].plot.getPlotItem().getAxis("bottom")
    at_s = (playback.position_ns - tape.first_ns) / 1e9
    assert axis._since_s == pytest.approx(at_s, abs=0.1), "it counts as the bar below does"
    [(step, offset)] = axis.tickSpacing(-5.0, 0.0, 500.0)
    text = axis.tickStrings([offset - step], 1.0, step)[0]
    assert re.fullmatch(r"\d:\d\d(\.0)?|\d:\d\d\.\d", text)


def test_a_replay_says_that_buses_are_missing_in_it_only_where_they_are(
    shown: Shown, archive: Archive, settings: ServerSettings, player: Player
) -> None:
    assert player.alarms.isHidden(), "nothing was wrong, as far as is known"
    assert player.unseen.isVisible()
    assert "trouble of its buses was not recorded" in player.unseen.accessibleName()
    tape = archive.playback.tape
    assert tape is not None
    assert not tape.tells_of_buses, "nobody knows which version recorded it"
    ours = {"gwrms collect": importlib.metadata.version("gwrms")}
    assert dataclasses.replace(tape, session=replace(tape.session, versions=ours)).tells_of_buses
    told = {"kind": "bus", "utc": as_time(tape.first_ns), "text": "main: full"}
    assert dataclasses.replace(tape, events=[told]).tells_of_buses


def test_a_gap_is_an_event_like_the_others(shown: Shown, archive: Archive, settings: ServerSettings) -> None:
    record(settings, gap=True)
    play(shown, archive)
    player, tape = shown.window.tabs.recordings.player, archive.playback.tape
    assert tape is not None
    said = "gap: the robot dropped 12 rows: it was too busy, or we read too slowly"
    shown.until(lambda: any(flag.kind is FlagKind.GAP for flag in player._in_order), "found it")
    player._list_events(menu := QMenu())
    assert any(said in action.text() for action in menu.actions()), "it is listed"
    assert not any(action.icon().isNull() for action in menu.actions()), "with its flag"
    assert player.events.isEnabled()
    gap = next(flag for flag in player._in_order if flag.kind is FlagKind.GAP)
    assert player.timeline.told(gap) == said, "its tip"
    QTest.keyClick(player.timeline, Qt.Key.Key_N)
    while archive.playback.position_ns < gap.at_ns:
        before_ns = archive.playback.position_ns
        QTest.keyClick(player.timeline, Qt.Key.Key_N)
        assert archive.playback.position_ns > before_ns, "N leads there"
    archive.playback.seek(tape.last_ns)
    station = archive.playback.desk.stations[0]
    shown.until(lambda: any(flag.kind is FlagKind.GAP for flag in station.flags), "it is in the plots")
    assert set(FlagKind) == set(FLAGS) == set(FIRST), "each kind has its mark, and its rank"
    marks = {(mark.shape, mark.colour) for mark in FLAGS.values()}
    assert len(marks) == len(FLAGS), "no two look alike"
