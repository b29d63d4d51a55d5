"""STOP: always there, at once, and never taken for done before the drives say so."""

import re
import time
from collections.abc import Iterator
from concurrent.futures import Future

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton

from gateway.client import ClockOffset, ConnectionState, LinkLost, NotConnected
from gateway.wire.stop import Reset, Stopped
from server_gui.core.follow.events import LinkChanged
from server_gui.core.tuning.stop import Sent, StopProgress, StopState
from server_gui.core.tuning.writing import Trial
from server_gui.views.confirmation import Question
from server_gui.views.frame.header import Header, _outcome
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.stop_keys import StopKeys
from server_gui.views.robots.reset import ask_clear, ask_reset
from server_gui.views.theme import Theme
from server_gui.views.widgets.stop_button import StopButton
from tests.gui.fakes import Bench, destroy, stop_is_whole
from tests.gui.faulty import CAUSE, fault
from tests.support.desk import JOINTS, described, looked, telemetry, walking

ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)


@pytest.fixture
def header(theme: Theme, bench: Bench) -> Iterator[Header]:
    """The header alone: its STOP stops the robot that is looked at."""
    made = Header(bench.desk, theme, QPushButton())
    made.stopped.connect(lambda: bench.station.stop("test"))
    made.show()
    made.refresh()
    yield made
    destroy(made)


def press(header: Header) -> None:
    QTest.mousePress(header.stop, Qt.MouseButton.LeftButton)


def shown(header: Header) -> str:
    header.refresh()
    return header.outcome_text


def test_stop_goes_out_when_the_button_goes_down_not_when_it_comes_up(header: Header, bench: Bench) -> None:
    press(header)
    assert len(bench.first.named("stop")) == 1
    QTest.mouseRelease(header.stop, Qt.MouseButton.LeftButton)
    assert len(bench.first.named("stop")) == 1


def test_stop_is_sent_then_confirmed(header: Header, bench: Bench) -> None:
    press(header)
    assert shown(header) == "STOP sent"
    bench.first.answer(ALL)
    assert shown(header) == "STOP confirmed"


@pytest.mark.parametrize(
    ("drives", "said"),
    [
        ({**ALL.drives, "left_knee": "unconfirmed"}, "left knee unconfirmed"),
        ({**ALL.drives, "left_knee": "unreachable"}, "left knee unreachable"),
        ({}, "no drive answered"),
    ],
)
def test_one_drive_that_does_not_confirm_makes_the_stop_not_confirmed(
    header: Header, bench: Bench, drives: dict[str, str], said: str
) -> None:
    press(header)
    bench.first.answer(Stopped(drives, held=True))  # type: ignore[arg-type]
    assert shown(header) == "STOP NOT CONFIRMED"
    assert said in bench.station.stopping.text


@pytest.mark.parametrize("error", [NotConnected("there is no link"), LinkLost("the link dropped")])
def test_a_stop_that_nobody_answers_is_not_confirmed(header: Header, bench: Bench, error: Exception) -> None:
    press(header)
    bench.first.fail(error)
    assert shown(header) == "STOP NOT CONFIRMED"
    assert str(error) in bench.station.stopping.text


def test_an_old_answer_does_not_confirm_a_newer_stop(bench: Bench) -> None:
    bench.station.stop("first")
    bench.station.stop("second")
    bench.first.futures[0].set_result(ALL)
    assert bench.station.stopping.state is StopState.SENT


def test_f12_and_ctrl_space_stop_while_somebody_types_and_while_a_menu_is_open(
    qt: QApplication, window: MainWindow, bench: Bench
) -> None:
    keys = StopKeys(qt)
    keys.pressed.connect(lambda: bench.station.stop("key"))
    window.activateWindow()
    window.parameters.filters.words.setFocus()
    QTest.qWaitForWindowActive(window)
    handle = window.windowHandle()
    QTest.keyClick(handle, Qt.Key.Key_A)
    QTest.keyClick(handle, Qt.Key.Key_F12)
    QTest.keyClick(handle, Qt.Key.Key_Space, Qt.KeyboardModifier.ControlModifier)
    assert len(bench.first.named("stop")) == 2
    assert window.parameters.filters.words.text() == "a", "the keys went into the field"
    menu = window.header.menu.menu()
    menu.popup(window.pos())
    QTest.qWaitForWindowExposed(menu)
    QTest.keyClick(window.windowHandle(), Qt.Key.Key_F12)
    menu.close()
    assert len(bench.first.named("stop")) == 3


def test_stop_all_reaches_every_robot(window: MainWindow, bench: Bench) -> None:
    bench.add("exo-02", 7421)
    bench.draw(window)
    window.stop_all.connect(lambda: bench.desk.stop_all("all"))
    QTest.mousePress(window.robots.all_stop, Qt.MouseButton.LeftButton)
    assert [len(commands.named("stop")) for commands in bench.commands] == [1, 1]


@pytest.mark.parametrize(("width", "height", "scale"), [(1024, 700, 1.5), (1366, 768, 1.0)])
def test_the_result_of_stop_all_is_wholly_in_sight_beside_each_robots_own_until_all_are_reset(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02")])
    theme.set(scale=scale)
    window.resize(width, height)
    bench.desk.stop_all("all")
    bench.first.answer(ALL)
    bench.commands[1].fail(NotConnected("there is no link"))
    off: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    later_ns = time.monotonic_ns() + 3_600_000_000_000  # so that it is live, however slow this computer is
    bench.station.take([telemetry([later_ns], off, later_ns)])
    bench.draw(window)
    bar = window.stopped_all
    assert bar.text.startswith("STOP ALL: 1 of 2 robots stopped")
    assert "exo-02 STOP NOT CONFIRMED" in bar.text
    assert bar.words.height() >= bar.words.heightForWidth(bar.words.width())
    assert bar.visibleRegion().boundingRect() == bar.rect()
    assert window.header.outcome_text == "STOP confirmed"
    assert stop_is_whole(window)
    for station, commands in zip(bench.desk.stations, bench.commands, strict=True):
        station.reset()
        commands.answer(Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False))
    bench.draw(window)
    assert bar.text == ""


@pytest.mark.parametrize("called", ["exo-05", "exo-of-the-clinic-beside-the-river-05"])
def test_the_time_and_the_buttons_of_a_trial_and_the_result_of_stop_all_are_whole_on_a_small_screen(
    window: MainWindow, bench: Bench, theme: Theme, called: str
) -> None:
    for name in ("exo-02", "exo-03", "exo-04", called):
        bench.add(name, 7420 + len(bench.desk.stations)).take([described(name)])
    trial = window.trial
    until_ns = time.monotonic_ns() + 3_600_000_000_000
    bench.desk.stations[-1].writing.trial = Trial(
        7, {"gait.step_length": 0.43}, {"gait.step_length": 0.4}, until_ns
    )
    bench.draw(window)
    assert "400 → 430 mm; taken back in" in trial.words.text()
    theme.set(scale=2.0)
    window.resize(1024, 700)
    bench.desk.stop_all("all")
    for commands in bench.commands:
        commands.fail(NotConnected("there is no link"))
    for tab in (0, 6):
        window.tabs.setCurrentIndex(tab)
        for _ in range(3):
            bench.draw(window)
        buttons = trial.findChildren(QPushButton)
        assert len(buttons) == 3
        for part in (trial.words, *buttons, window.stopped_all):
            assert part.visibleRegion().boundingRect() == part.rect(), part
            assert part.height() >= part.minimumSizeHint().height(), part
        assert trial.words.text().startswith("exo-")
        assert trial.words.text().endswith(" s"), "until it is taken back"
        assert stop_is_whole(window)
    bench.desk.stations[-1].writing.trial = None


def test_how_many_drives_confirmed_a_stop_all_has_room_in_the_smallest_window(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    bench.add("simulated-exo", 7421).take([described("simulated-exo")])
    theme.set(scale=1.5)
    window.resize(1024, 700)
    bench.desk.stop_all("all")
    bench.first.answer(ALL)
    bench.commands[1].answer(ALL)
    later_ns = time.monotonic_ns() + 3_600_000_000_000
    off: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    for station in bench.desk.stations:
        station.take([telemetry([later_ns], off, later_ns)])
    bench.draw(window)
    drives = 2 * len(JOINTS)
    assert f"{drives}/{drives} drives confirmed" in window.stopped_all.text
    assert window.stopped_all.visibleRegion().boundingRect() == window.stopped_all.rect()


@pytest.mark.parametrize(
    ("width", "height", "scale"), [(1024, 700, 1.5), (1366, 768, 1.0), (1920, 1080, 1.0)]
)
def test_the_result_of_stop_all_moves_no_alarm_no_tab_and_no_panel(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    """It pushed all that was below the header down, each robot's Stop and Acknowledge too."""
    bench.add("exo-02", 7421).take([described("exo-02")])
    theme.set(scale=scale)
    window.resize(width, height)
    bench.draw(window)
    parts = (window.alarms, window.page_bar, window.robots.all_stop, *window.docks)

    def places() -> list[object]:
        fixed: list[object] = [(part.mapTo(window, QPoint()), part.size()) for part in parts]
        return [*fixed, window.tabs.mapTo(window, QPoint())]

    before = places()
    bench.desk.stop_all("all")
    bench.draw(window)
    assert window.stopped_all.isVisible()
    assert places() == before


def test_the_list_of_alarms_does_not_cover_the_result_of_stop_all(window: MainWindow, bench: Bench) -> None:
    for number in range(2, 9):
        bench.add(f"exo-0{number}", 7419 + number).take([described(f"exo-0{number}")])
    bench.desk.stop_all("all")
    for commands in bench.commands:
        commands.fail(NotConnected("there is no link"))
    window.resize(1024, 600)
    bench.draw(window)
    window.alarms.more.click()
    bench.draw(window)
    assert window.alarms.list.isVisible()
    listed, result = (
        QRect(part.mapToGlobal(QPoint()), part.size()) for part in (window.alarms.list, window.stopped_all)
    )
    assert not listed.intersects(result)


def test_shift_f12_stops_every_robot_and_f12_none_but_the_one_that_is_looked_at(
    qt: QApplication, window: MainWindow, bench: Bench
) -> None:
    bench.add("exo-02", 7421)
    keys = StopKeys(qt)
    keys.pressed.connect(lambda: bench.station.stop("key"))
    keys.all_pressed.connect(lambda: bench.desk.stop_all("key"))
    window.activateWindow()
    QTest.qWaitForWindowActive(window)
    QTest.keyClick(window.windowHandle(), Qt.Key.Key_F12)
    assert [len(commands.named("stop")) for commands in bench.commands] == [1, 0]
    QTest.keyClick(window.windowHandle(), Qt.Key.Key_F12, Qt.KeyboardModifier.ShiftModifier)
    assert [len(commands.named("stop")) for commands in bench.commands] == [2, 1]


def test_stop_is_in_sight_on_every_tab_and_while_changes_are_reviewed(
    window: MainWindow, bench: Bench
) -> None:
    for tab in range(window.tabs.count()):
        window.tabs.setCurrentIndex(tab)
        assert window.header.stop.isVisible()
        assert window.header.stop.isEnabled()
    window.parameters.stage("gait.step_length", 0.45)
    window.parameters.begin_review()
    assert QApplication.activeModalWidget() is None
    assert window.header.stop.isEnabled()


def test_a_held_stop_is_reset_by_its_own_button_which_enables_nothing(header: Header, bench: Bench) -> None:
    header.reset.connect(lambda station: station.reset())
    bench.station.stop("test")
    bench.first.answer(ALL)
    header.refresh()
    assert header.reset_button.isVisible()
    header.reset_button.click()
    bench.first.answer(Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False))
    header.refresh()
    assert bench.first.asked[-1] == ("reset", ())
    assert not header.reset_button.isVisible()


def test_a_reset_that_leaves_the_stop_held_says_why(bench: Bench) -> None:
    bench.station.stop("test")
    bench.first.answer(ALL)
    bench.station.reset()
    bench.first.answer(Reset({}, {"left_knee": "does not answer"}, held=True))
    assert "left_knee: does not answer" in bench.desk.news.items[0].text
    assert bench.station.stopping.held


def test_a_fault_that_stays_after_it_was_cleared_is_shown_and_can_be_cleared_again(
    header: Header, bench: Bench
) -> None:
    asked = ask_clear(header, bench.station)
    asked.act.click()
    stays = "it stays in fault: 0x4310 drive temperature too high; let it cool, then reset it again"
    drives = {**dict.fromkeys(JOINTS, "switch on disabled"), "left_knee": "fault"}
    bench.first.answer(Reset(drives, {"left_knee": stays}, held=False))
    shown = [one for one in header.findChildren(Question) if one.windowTitle().startswith("NOT cleared")]
    assert [one.words.text() for one in shown] == [f"left_knee DID NOT LEAVE FAULT: {stays}."]
    shown[0].act.click()
    assert any(one.windowTitle().startswith("Clear the fault") for one in header.findChildren(Question))


def test_the_question_whether_to_clear_a_fault_names_it(header: Header, bench: Bench) -> None:
    fault(bench)
    asked = ask_clear(header, bench.station)
    first, named, *_ = asked.words.text().splitlines()
    assert first == "Clear the fault of exo-01?"
    assert named == f"left knee: {CAUSE}"
    assert "this moves nothing" in asked.words.text()


def test_what_is_known_of_the_drives_is_said_before_a_fault_is_cleared(header: Header, bench: Bench) -> None:
    def said() -> str:
        asked = ask_clear(header, bench.station)
        words = asked.words.text()
        destroy(asked)
        return words

    assert "What its drives do now is not known" in said(), "nothing has come yet"
    bench.station.take([walking(10, age_s=90.04)])
    assert re.search(r"states were 9\d\.\d s old: enabled then: left hip", said())
    bench.station.take([walking(10)])
    assert "STILL ENABLED, and without torque then: left hip" in said()
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no gateway", time.monotonic_ns())])
    assert "What its drives do now is not known" in said()


def test_the_robot_is_named_on_the_button_and_so_is_another(header: Header, bench: Bench) -> None:
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02")])
    bench.desk.select(other)
    header.refresh()
    assert header.stop.text() == "STOP  exo-02"


def test_a_very_long_name_makes_no_card_wider_and_hides_no_stop(window: MainWindow, bench: Bench) -> None:
    other = bench.add("x" * 90, 7421)
    other.take([described("x" * 90)])
    bench.desk.select(other)
    window.resize(1024, 700)
    bench.draw(window)
    assert stop_is_whole(window)
    for card in window.robots.cards:
        area = window.robots.rect()
        corners = (card.stop.rect().topLeft(), card.stop.rect().bottomRight())
        assert all(area.contains(card.stop.mapTo(window.robots, corner)) for corner in corners)
        assert card.stop.text().startswith("STOP")
        assert card.stop.width() >= card.stop.fontMetrics().horizontalAdvance("STOP")


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
def test_two_robots_of_one_name_are_told_apart_on_their_stops(
    window: MainWindow, bench: Bench, theme: Theme, scale: float
) -> None:
    theme.set(scale=scale)
    window.resize(1024, 700)
    bench.station.take([described("simulated-exo")])
    bench.add("second", 43113).take([described("simulated-exo")])
    for station in bench.desk.stations:
        bench.desk.select(station)
        bench.draw(window)
        stop = window.header.stop
        assert stop_is_whole(window)
        assert stop.is_whole, stop.lines
        assert station.address in " ".join(stop.lines)
        assert window.header._chips["drives"].isVisible()
    for dock in window.docks:
        dock.show()
    window.docks[0].raise_()
    bench.draw(window)
    for card in window.robots.cards:
        assert card.station.address in card._where.shown
        assert card._where.is_whole
        assert card._name.text() == "simulated-exo"


def test_header_and_overview_say_the_same_of_a_stop_at_once(window: MainWindow, bench: Bench) -> None:
    bench.look_again([walking(10), looked()])
    bench.draw(window)
    said = [window.header._chips["status"].main_text, window.tabs.overview.now.activity.main.text()]
    bench.station.stopping.described(held=True, reason=None)
    window.refresh()
    after = [window.header._chips["status"].main_text, window.tabs.overview.now.activity.main.text()]
    assert all(one != other for one, other in zip(said, after, strict=True))
    assert len(set(after)) == 1


def test_a_reset_from_before_ends_no_stop_that_is_not_confirmed() -> None:
    stopping = StopProgress()
    stopping.failed(stopping.sent(), "no link")
    stopping.described(held=False, reason=None)
    stopping.read([{"n": 1, "what": "stop"}, {"n": 2, "what": "reset", "held": False}])
    assert (stopping.state, stopping.held) == (StopState.NOT_CONFIRMED, False)


@pytest.mark.parametrize("clock", [ClockOffset(0, 1000), None])
def test_a_held_stop_that_was_not_confirmed_is_ended_by_whoever_resets_it(clock: ClockOffset | None) -> None:
    """By what was written since, as its clock says; where nobody can tell, not before the third look."""
    stopping, sent_ns = StopProgress(), 10**12
    number = stopping.sent(at_ns=sent_ns, clock=clock, boot_id="b")
    stopping.answered(number, Stopped({"left_knee": "unreachable"}, held=True))
    before, after = ({"boot_id": "b", "monotonic_ns": at_ns} for at_ns in (sent_ns // 2, sent_ns + 1))
    stopping.read([{"n": 1, "what": "reset", "held": False, **before}])
    assert (stopping.state, stopping.held) == (StopState.NOT_CONFIRMED, True), "of a stop before ours"
    stopping.read([{"n": 2, "what": "write", **after}])
    stopping.read([{"n": 3, "what": "stop", **after}, {"n": 4, "what": "reset", "held": False, **after}])
    assert (stopping.state, stopping.held) == (StopState.IDLE, False)


def test_a_stop_is_timed_where_it_is_sent_however_late_the_window_notes_it() -> None:
    stopping, future = StopProgress(), Future[Stopped]()
    sent = Sent(time.monotonic_ns() - 3_000_000_000, future)
    future.set_result(ALL)
    number = stopping.sent(at_ns=sent.at_ns)
    stopping.answered(number, ALL, sent.at_ns + 40_000_000)
    assert sent.answered_ns is not None
    assert sent.answered_ns - sent.at_ns >= 3_000_000_000
    assert stopping.text == f"STOP confirmed by all {len(JOINTS)} drives in 40 ms"
    assert time.time() - (stopping.since_s or 0.0) >= 2.9
    stopping.show([sent.at_ns + 20_000_000], {"left_knee": ["quick stop active"]}, offset_ns=0)
    assert stopping.proofs["left_knee"].when == "20 ms"


def test_the_times_of_one_stop_do_not_contradict_each_other() -> None:
    stopping, at_ns, joints = StopProgress(), time.monotonic_ns(), list(JOINTS)
    number = stopping.sent(at_ns=at_ns)
    stopping.show([at_ns + 181_000_000], {joints[0]: ["quick stop active"]}, offset_ns=0)
    stopping.answered(number, ALL, at_ns + 119_000_000)
    late: dict[str, list[str | None]] = {joint: ["quick stop active"] for joint in joints[1:]}
    stopping.show([at_ns + 181_000_000], late, offset_ns=0)
    assert stopping.text.endswith("drives in 119 ms")
    assert stopping.proof.endswith("within 119 ms")
    assert {proof.when for proof in stopping.proofs.values()} == {"119 ms"}


def test_a_stop_has_one_time_that_of_the_drives_where_their_answer_came_later(
    window: MainWindow, bench: Bench
) -> None:
    stopping, at_ns = bench.station.stopping, time.monotonic_ns()
    number = stopping.sent(at_ns=at_ns)
    rows: dict[str, list[str | None]] = {joint: ["quick stop active"] for joint in JOINTS}
    stopping.show([at_ns + 183_000_000], rows, offset_ns=0)
    stopping.answered(number, ALL, at_ns + 1_001_000_000)
    assert stopping.text == f"STOP confirmed by all {len(JOINTS)} drives in 183 ms"
    assert stopping.proof.endswith("within 183 ms")
    window.refresh()
    assert "6 drives in 183 ms" in _outcome(bench.station).parts


def test_an_answer_says_nothing_of_a_drive_that_has_not_confirmed_the_stop() -> None:
    stopping, at_ns = StopProgress(), time.monotonic_ns()
    number = stopping.sent(at_ns=at_ns)
    stopping.answered(number, Stopped({"left_knee": "unreachable"}, held=True), at_ns + 100_000_000)
    stopping.show([at_ns + 900_000_000], {"left_knee": ["quick stop active"]}, offset_ns=0)
    assert stopping.proofs["left_knee"].when == "900 ms"


def test_a_name_that_has_room_beside_the_word_is_not_cut(theme: Theme) -> None:
    button = StopButton("robot_stop")
    button.name("simulated-exo")
    button.show()
    font = QApplication.font()
    font.setBold(False)
    name = QFontMetrics(font).horizontalAdvance("simulated-exo")
    button.setFixedWidth(button._word + button._gap + name + 20)  # 8 + 8 of padding, and a frame
    assert button.lines == ["simulated-exo"]
    assert button.is_whole
    destroy(button)


def test_the_question_of_a_reset_begins_with_a_stop_that_is_not_confirmed(
    window: MainWindow, bench: Bench
) -> None:
    bench.station.stop("test")
    bench.first.answer(Stopped(ALL.drives, held=True, controllers={"gait": "unreachable"}))
    question = ask_reset(window, bench.station)
    assert question.words.text().startswith("STOP NOT CONFIRMED: ")
    assert "First " in question.words.text().partition("Reset the stop")[0]
    question.close()
