"""A recording with a fault in it: the alarm of that time is shown again, and leads to its signal."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMenu

from server_gui.core.archive.archive import Archive
from server_gui.core.desk.flags import FlagKind
from server_gui.core.settings.server_file import ServerSettings
from server_gui.views.recordings.player import SIGNALS, Player
from server_gui.views.recordings.timeline import clock_text
from server_gui.views.widgets.cursors import FIRST, FLAGS
from tests.gui.archives import Shown, play, record

FAULT_S = 5.0


@pytest.fixture
def player(shown: Shown, archive: Archive, settings: ServerSettings) -> Player:
    record(settings, fault_s=FAULT_S)
    play(shown, archive)
    return shown.window.tabs.recordings.player


def to_the_fault(shown: Shown, archive: Archive, player: Player) -> None:
    """As its event in the bar leads there, and some seconds more."""
    tape = archive.playback.tape
    assert tape is not None
    archive.playback.seek(tape.first_ns + round((FAULT_S + 2.0) * 1e9))
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
    assert "buses and computers are not" in player.alarms.details.text(), "nobody has looked at these"
    assert player.alarms.isVisible(), "nothing moves"


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
    assert any(name.startswith("left_knee.") for name in player.signals.chosen)
    left, right = player.signals._window
    at_ns, newest_ns = player.signals._jumped_ns, player.signals.scene.newest_ns
    assert at_ns is not None
    assert newest_ns is not None
    at_s = (at_ns - newest_ns) / 1e9
    assert left == pytest.approx(at_s - 5.0, abs=0.2)
    assert right == pytest.approx(at_s + 5.0, abs=0.2)


def test_clock_and_alarm_are_of_the_instant_that_a_jump_leads_to(
    shown: Shown, archive: Archive, player: Player
) -> None:
    to_the_fault(shown, archive, player)
    shown.draw()
    playback, tape = archive.playback, archive.playback.tape
    assert tape is not None
    for seconds, told in ((FAULT_S - 3.0, False), (FAULT_S + 1.0, True)):
        player._frame = 1  # the next look at what people read is some frames away
        playback.seek(tape.first_ns + round(seconds * 1e9))
        player.refresh()
        assert not playback.is_loading
        assert player.place.text().startswith(clock_text(seconds, 1))
        assert bool(player.alarms.told) is told


def test_a_recording_that_stands_still_is_said_to_be_paused_alone(
    shown: Shown, archive: Archive, player: Player
) -> None:
    to_the_fault(shown, archive, player)
    player._choice.button(SIGNALS).click()
    player.signals.pause.click()
    shown.draw()
    assert player.signals.said.text() == "Paused"


def test_a_replay_says_of_what_it_shows_no_alarms(player: Player) -> None:
    assert player.alarms.isHidden(), "nothing was wrong, as far as is known"
    assert player.unseen.isVisible()
    assert "without alarms of buses and computers" in player.unseen.text()


def test_a_gap_is_an_event_like_the_others(shown: Shown, archive: Archive, settings: ServerSettings) -> None:
    record(settings, gap=True)
    play(shown, archive)
    player, tape = shown.window.tabs.recordings.player, archive.playback.tape
    assert tape is not None
    said = "gap: the robot dropped 12 rows: it was too busy, or we read too slowly"
    shown.until(lambda: any(flag.kind is FlagKind.GAP for flag in player._in_order), "found it")
    player._list_events(menu := QMenu())
    assert any(said in action.text() for action in menu.actions()), "it is listed"
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
