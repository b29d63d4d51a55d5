"""Two recordings in the same plots: played together, aligned by their beginnings or by a heel strike."""

import threading

import numpy as np
import pytest
from msgspec.structs import replace
from PySide6.QtWidgets import QApplication, QMenu

from gateway.units import Units, rounded, with_minus
from server_gui.core.archive.archive import Archive
from server_gui.core.archive.cycle_remarks import CycleRemarks
from server_gui.core.archive.side_by_side import By
from server_gui.core.cloud.tape import Tape
from server_gui.core.evidence.comparison import Measured, Word
from server_gui.core.processing.gait_events import EventKind, Leg
from server_gui.core.settings.server_file import ServerSettings
from server_gui.views.recordings.player import SIGNALS, Player
from tests.gui import rules
from tests.gui.archives import Shown, record


@pytest.fixture
def player(shown: Shown, archive: Archive, settings: ServerSettings) -> Player:
    """Both are marked and shown side by side, and stand still."""
    for _ in range(2):
        record(settings)
    archive.library.look(now=True)
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    shown.until(lambda: page.sessions.rowCount() == 2, "listed both")
    page.table.selectRow(0)
    shown.draw()
    assert not page.together.isEnabled()
    page.table.selectAll()
    shown.until(page.together.isEnabled, "looked into the first")
    page.together.click()
    archive.playback.play(on=False)
    player = shown.window.tabs.recordings.player
    shown.until(lambda: player.beside.station, "looked into the second")
    return player


def jump(shown: Shown, archive: Archive, player: Player, seconds: float) -> tuple[Tape, Tape]:
    """Go to so many seconds after the beginning of the first."""
    first, second = archive.playback.tape, player.beside.second.tape
    assert first is not None
    assert second is not None
    archive.playback.seek(first.first_ns + round(seconds * 1e9))
    shown.until(lambda: not archive.playback.is_loading, "showed the first")
    shown.until(lambda: not player.beside.second.is_loading, "showed the second")
    shown.draw()
    return first, second


def choose(player: Player, by: By) -> None:
    """Align them so."""
    player.beside_bar.by.setCurrentText(by.value)
    player.beside_bar.by.activated.emit(player.beside_bar.by.currentIndex())


def test_while_both_are_read_that_is_said_without_tools_and_with_one_button_for_cursors(
    shown: Shown, player: Player
) -> None:
    player._end_comparing()
    session, player.beside.session = player.beside.session, None
    assert session is not None
    player.show_beside(session)
    player._refresh_beside()
    assert player.signals.empty.text() == "reading both recordings …"
    assert not player.signals.tools.isVisible(), "they would be there for a moment"
    bar = player.beside_bar
    assert bar.cursors.isVisibleTo(bar)
    bar.tools.click()
    assert not bar.cursors.isVisibleTo(bar), "the tools have that button"
    bar.tools.click()
    player.beside.close()
    player._refresh_beside()
    assert player.signals.empty.text().startswith("Tick channels")


def test_both_are_in_the_same_plots_at_one_time_since_their_beginnings_until_one_is_put_away(
    shown: Shown, archive: Archive, player: Player
) -> None:
    assert player._stack.currentIndex() == SIGNALS
    choose(player, By.START)
    for seconds in (6.0, 3.0, 9.0):
        first, second = jump(shown, archive, player, seconds)
        assert player.beside.second.position_ns - second.first_ns == pytest.approx(seconds * 1e9, abs=1e6)
        assert player.beside.second.position_ns != archive.playback.position_ns
    player.signals.choose(["left_knee.position"])
    shown.draw()
    scene = player.signals.scene
    times = scene.times(2.0)
    beside = scene.values_beside("left_knee.position", times)
    assert np.count_nonzero(~np.isnan(beside)) > len(times) / 2
    assert first.session.session != second.session.session
    assert player.beside_bar.isVisible()
    assert player.beside_bar.by.currentText() == "their beginnings"
    assert scene.beside_text() == "", "aligned as is chosen above, and in no second way"
    assert rules.out_of_reach(player) == []
    assert player.signals.cards[0].visibleRegion().boundingRect().height() > 0, "curves are in sight"
    player.beside_bar.close_button.click()
    shown.draw()
    assert player.signals.scene.beside is None
    assert not player.beside_bar.isVisible()
    player._back()
    assert player.beside.second.tape is None


def test_each_has_a_name_and_a_colour_of_its_own_in_the_bar_in_plots_and_at_cursors(
    shown: Shown, archive: Archive, player: Player
) -> None:
    jump(shown, archive, player, 8.0)
    shown.until(lambda: all(len(plot.drawn) == 1 for plot in player.signals.plots), "gave each a plot")
    names, plot = player.signals.scene.names, player.signals.plots[0]
    assert names is not None
    assert names[0] != names[1], "two recordings of one robot and one second"
    assert len({*player.beside_bar.said.accessibleDescription().split(", exo-01")}) == 2
    colours = [one.colour for one in plot.plot._curves]
    assert len(colours) == len({*colours}) == 2
    assert not {"left", "right"} & {*colours}, "colours of sides are no colours of recordings"
    scene, (channel,) = player.signals.scene, plot.drawn
    player.signals._hovered(-2.0)
    here, beside = (scene.read(channel, -2.0, beside=one) for one in (False, True))
    assert here is not None
    assert beside is not None
    legend = plot._legend.accessibleDescription()
    text = plot._text
    shown_here, shown_beside = (round(one * plot.unit.scale, plot._places) for one in (here, beside))
    difference = rounded(shown_beside - shown_here, plot._places, "+")
    symbol = plot.unit.symbol
    assert legend == (f"{names[0]} {text(here)}, {names[1]} {text(beside)}, difference {difference} {symbol}")
    player.beside_bar.cursors.click()
    shown.draw()
    table = player.signals.measuring.table
    told = [str(table.item(row, 0).text()) for row in range(3)]  # type: ignore[union-attr]
    assert told == [f"{channel}, {one}" for one in (*names, "difference")]
    for at_s in (-3.0, -2.73, -2.37, -1.91, -1.18):
        player.signals.two.move(0, at_s)
        shown.draw()
        ours, theirs, apart = (str(table.item(row, 1).text()) for row in range(3))  # type: ignore[union-attr]
        between = float(theirs.replace("−", "-")) - float(ours.replace("−", "-"))
        assert apart == with_minus(f"{between:.5g}"), "as both are shown"


def test_while_two_are_compared_plots_have_the_room_of_the_tools_until_these_are_asked_for(
    shown: Shown, archive: Archive, player: Player
) -> None:
    jump(shown, archive, player, 8.0)
    shown.until(lambda: player.signals.area.is_paired, "made room")
    QApplication.processEvents()
    tools, channels, plots = player.signals.tools, player.signals.channels, player.signals.plots
    assert not tools.isVisible()
    assert not channels.isVisible()
    assert plots[0].y() == plots[1].y(), "left and right beside each other"
    assert plots[0].plot.height() > 2 * plots[0].plot.minimumSizeHint().height()
    player.beside_bar.tools.click()
    assert tools.isVisible()
    assert channels.isVisible()
    player.signals.cursors.click()
    assert player.beside_bar.cursors.isChecked(), "one switch in two places"
    menu = QMenu()
    player.signals.beside.fill(menu)
    menu.actions()[0].trigger()
    shown.draw()
    assert player.beside.session is None, "nothing is beside"
    assert tools.isVisible()
    assert {len(plot.drawn) for plot in player.signals.plots} == {2}, "arranged as before"


def test_what_gait_cycles_of_both_say_stands_at_the_plots_of_the_joint(
    shown: Shown, archive: Archive, player: Player
) -> None:
    jump(shown, archive, player, 8.0)
    shown.until(lambda: archive.compared.moved, "compared the walks")
    session, moved = player.beside.session, archive.compared.moved
    assert session is not None
    assert moved is not None
    shown.draw()
    assert player.beside_bar.cadence.text().startswith("gait cycles of both legs: ")
    assert "too few cycles of one activity" in player.beside_bar.cadence.text(), "of so short a walk"
    bar, lines = player.beside_bar, []
    for width in range(700, 1800, 100):
        shown.window.resize(width, 800)
        shown.draw()
        assert bar.said.width() >= min(bar.said.whole_width, bar.width()), "the names of both are in sight"
        lines.append(bar.said.geometry().right() < bar.cadence.x())
    assert lines == sorted(lines)
    assert len({*lines}) == 2, "in one line with the buttons where both have room"
    first = next(one for one in archive.compared.pair or () if one.session != session.session)
    torque = Measured("left_knee.torque_rms", "torque RMS", "N·m", Word.CHANGED, 10, 12, 20.0, 30.0, 10.0)
    archive.compared.moved = replace(moved, metrics=(torque,))
    archive.compared.pair = (first, session)
    remarks, turned = (CycleRemarks(archive.compared, one, Units()) for one in (first, session))
    assert remarks.of("left_knee.torque")[0] == "per gait cycle: torque RMS 20 → 30 N·m, differs"
    assert turned.of("left_knee.torque")[0] == "per gait cycle: torque RMS 30 → 20 N·m, differs"
    assert remarks.of("left_insole.force") == (), "nothing is measured of it"
    note = "too few cycles of one activity on both sides: 30 walk before, 32 turn after"
    few = replace(moved, word=Word.FEW, cycles_before=30, cycles_after=32, metrics=(), notes=(note,))
    archive.compared.moved = few
    turned = CycleRemarks(archive.compared, session, Units())
    assert turned.cadence[0] == f"gait cycles of both legs: 32 and 30; {note}"
    assert turned.cadence[1].endswith("32 and 30, too few of them are alike"), "and not that 30 are too few"


@pytest.mark.parametrize("by", [By.FIRST_STRIKE, By.LAST_STRIKE])
def test_by_a_heel_strike_their_strides_lie_over_each_other_and_one_that_cannot_be_read_is_said(
    shown: Shown, archive: Archive, player: Player, monkeypatch: pytest.MonkeyPatch, by: By
) -> None:
    jump(shown, archive, player, 8.0)
    assert player.beside_bar.by.currentText() == "the first left heel strike", "without being asked for"
    if by is not By.FIRST_STRIKE:
        choose(player, by)
    assert player.beside.by is by
    shown.draw()
    jump(shown, archive, player, 8.0)
    since = []
    for playback in (archive.playback, player.beside.second):
        station = playback.desk.stations[0]
        strikes = [
            one.stamp_ns
            for one in station.processing.derived().events
            if one.kind is EventKind.HEEL_STRIKE and one.leg is Leg.LEFT
        ]
        since.append(((station.rings.newest_ns or 0) - max(strikes)) / 1e9)
    assert since[0] % 1.0 == pytest.approx(since[1] % 1.0, abs=0.1)  # a stride takes a second

    _cannot_be_read(shown, player, monkeypatch)


def _cannot_be_read(shown: Shown, player: Player, monkeypatch: pytest.MonkeyPatch) -> None:
    threads = list[str]()

    def broken(*_: object) -> None:
        threads.append(threading.current_thread().name)
        raise OSError("the disk is away")

    session = player.beside.session
    assert session is not None
    monkeypatch.setattr("server_gui.core.archive.side_by_side.Tape.open", broken)
    player.show_beside(session)
    shown.until(lambda: player.beside.problem, "told why not")
    shown.draw()
    assert "the disk is away" in player.beside_bar.said.accessibleDescription()
    assert threads[0].startswith("playback"), "a store that hangs must not keep anybody from looking at it"
    player.beside.close()
    player.beside_bar.refresh()
    assert not player.beside_bar.isVisible()


def test_events_of_both_are_on_the_bar_and_in_the_list(
    shown: Shown, archive: Archive, player: Player
) -> None:
    choose(player, By.START)
    first, second = jump(shown, archive, player, 2.0)
    for playback, seconds in ((archive.playback, 3.0), (player.beside.second, 5.0)):
        tape = first if playback is archive.playback else second
        at_ns = tape.first_ns + round(seconds * 1e9)
        playback.happened.tell([{"what": "stop", "who": "ada", "reason": f"at {seconds}", "utc_ns": at_ns}])
    player._refresh_words()
    menu = QMenu()
    player._list_events(menu)
    said = [action.text() for action in menu.actions() if "at " in action.text()]
    assert [text.partition(":")[2] for text in said] != []
    assert any(text.startswith("0:03.0  stop") for text in said)
    assert player.signals.scene.names is not None
    assert any(text.startswith(f"0:05.0  {player.signals.scene.names[1]} stop") for text in said)
    player._turn(1)
    player._turn(1)
    assert archive.playback.position_ns == first.first_ns + 5_000_000_000
