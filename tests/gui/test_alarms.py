"""Active alarms in sight: above the tabs, among the events, on cards; their buttons; robots that go."""

import time

import pytest
from PySide6.QtCore import QRect, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QHeaderView,
    QLabel,
    QLineEdit,
    QTabBar,
    QWidget,
)

from gateway.client import ConnectionState, NotConnected
from gateway.wire.component import QualityInfo, Snapshot
from gateway.wire.stop import Reset, Stopped
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.events import LinkChanged, Looked
from server_gui.core.tuning.stop import StopProgress
from server_gui.views.alarms.full_list import AlarmRow
from server_gui.views.confirmation import Question
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.overview.joint_table import JointTable
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Around, Bench, stop_is_whole
from tests.gui.faulty import CAUSE, fault, settle
from tests.gui.foreseen import predicted
from tests.gui.running import wait
from tests.support.desk import JOINTS, looked, telemetry, walking

WHY = "nothing was sent; 127.0.0.1:7420 did not answer hello within 5 s"


def question(window: MainWindow) -> Question:
    (found,) = (one for one in window.findChildren(Question) if one.isVisible())
    return found


def is_whole(label: QLabel) -> bool:
    """Whether all of its text has room in it."""
    needs = label.fontMetrics().boundingRect(
        0, 0, label.width(), 10_000, Qt.TextFlag.TextWordWrap.value, label.text()
    )
    return needs.height() <= label.height() and needs.width() <= label.width()


def opened(window: MainWindow | Around, bench: Bench) -> list[AlarmRow]:
    """The rows of the list of all alarms, which is opened."""
    bench.draw(window)
    window.alarms.more.click()
    bench.draw(window)
    return [row for row in window.alarms.list.rows if not row.isHidden()]


def places(window: MainWindow) -> dict[QWidget, QRect]:
    """Where everything is that a hand may be on its way to."""
    of_strip = {window.alarms, *window.alarms.findChildren(QWidget)}
    found: dict[QWidget, QRect] = {}
    for widget in rules.seen(window):
        is_control = isinstance(widget, QAbstractButton | QTabBar | QLineEdit | QHeaderView)
        if is_control and widget not in of_strip and not window.header.isAncestorOf(widget):
            found[widget] = QRect(widget.mapTo(window, widget.rect().topLeft()), widget.size())
    return found


HAPPENINGS = ("one fault", "a flood", "not confirmed", "read", "over")


def happens(what: str, bench: Bench) -> None:
    """One after the other."""
    match what:
        case "one fault":
            fault(bench)
        case "a flood":
            quality: dict[str, QualityInfo] = {
                name: {"state": "lost", "age_ms": 900.0, "problem": f"{name} does not answer; {WHY}"}
                for name in JOINTS
            }
            values = looked().parameters
            bench.look_again([Looked(Snapshot(0, {}, {}, quality), values, time.monotonic_ns())])
        case "not confirmed":
            bench.station.stop("test")
            bench.first.fail(NotConnected(WHY))
        case "read":
            for one in bench.station.alarms.active:
                bench.station.alarms.acknowledge(one.alarm.key)
        case "over":
            bench.station.stopping = StopProgress()
            bench.look_again([looked()])


@pytest.mark.parametrize(
    ("width", "height", "scale", "tab"),
    [
        (1024, 700, 1.0, 0),
        (1366, 768, 1.0, 0),
        (1366, 768, 1.0, 4),
        (1366, 768, 1.5, 0),
        (1920, 1080, 1.0, 0),
    ],
)
def test_nothing_that_is_clicked_moves_while_alarms_come_and_go(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float, tab: int
) -> None:
    theme.set(scale=scale)
    window.resize(width, height)
    window.tabs.setCurrentIndex(tab)
    bench.look_again([walking(100), looked()])
    for _ in range(3):  # docks find their places, and the overview its arrangement for that
        settle(window, bench)
    before = places(window)
    assert window.robots.cards[0].stop in before or width == 1024
    for what in HAPPENINGS:
        happens(what, bench)
        settle(window, bench)
        now = places(window)
        moved = [rules._path(one) for one, place in now.items() if before.get(one, place) != place]
        assert not moved, f"{what}: {moved}"
        assert stop_is_whole(window)


def test_what_to_check_is_on_the_strip_and_what_may_be_done_whole_in_the_list_with_large_text(
    theme: Theme, window: MainWindow, bench: Bench
) -> None:
    theme.set(scale=1.5)
    window.resize(1024, 700)
    fault(bench)
    settle(window, bench)
    assert "0x2310" in window.alarms.headline.text()
    assert "→ check that" in window.alarms.details.text()
    assert is_whole(window.alarms.headline)
    assert is_whole(window.alarms.details)
    window.panels_button.click()
    settle(window, bench)
    window.alarms.list.turn()
    settle(window, bench)
    row = window.alarms.list.rows[0]
    for button in (row.clear, row.show_signal, row.acknowledge):
        assert button.isVisible()
        assert button.visibleRegion().boundingRect() == button.rect(), button.text()


def test_rows_that_are_opened_under_the_pointer_are_whole_also_where_a_headline_grows(
    theme: Theme, window: MainWindow, bench: Bench
) -> None:
    theme.set(scale=1.5)
    window.resize(1024, 700)
    fault(bench)
    settle(window, bench)
    window.panels_button.click()
    settle(window, bench)
    window.alarms.list.setAttribute(Qt.WidgetAttribute.WA_UnderMouse)
    window.alarms.list.turn()
    for words in ("", "; 42 % of its PDOs are missing", "; and this goes on for a line or two" * 8):
        bench.look_again([looked(state="fault", problem=f"the drive is in fault: {CAUSE}{words}")])
        settle(window, bench)
        shown = [row for row in window.alarms.list.rows if row.isVisible()]
        for label in (label for row in shown for label in (row.headline, row.details)):
            assert is_whole(label) or label.isHidden(), (words, label.text())
        for row in shown:
            for button in (row.clear, row.show_signal, row.acknowledge):
                assert button.isHidden() or button.height() >= button.sizeHint().height(), words
    tip = window.alarms.list.rows[0].toolTip().replace("\n", " ")
    assert "and this goes on for a line or two; and" in tip, "what has no room stands nowhere"


def test_the_list_of_alarms_is_whole_when_it_is_first_seen_beside_the_panels(
    theme: Theme, window: MainWindow, bench: Bench
) -> None:
    theme.set(scale=1.5)
    window.resize(1024, 700)
    fault(bench)
    settle(window, bench)
    window.panels_button.click()
    settle(window, bench)
    window.alarms.list.turn()
    window.refresh()
    assert window.alarms.list.room < 500
    assert rules.cut_words(window, window.alarms.list.findChildren(QLabel)) == []


@pytest.mark.parametrize(
    ("width", "height", "scale"),
    [(1024, 700, 1.0), (1024, 700, 1.5), (1366, 768, 1.0), (1366, 768, 1.5), (1920, 1080, 1.0)],
)
def test_the_joint_table_is_whole_beside_an_alarm(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    theme.set(scale=scale)
    fault(bench)
    bench.station.take_prediction(predicted("steady", {"steady": 0.99, "fall": 0.01}, "falling"))
    window.resize(width, height)
    settle(window, bench)
    table = window.tabs.overview.findChild(JointTable)
    assert isinstance(table, JointTable)
    assert table.visibleRegion().boundingRect().height() == table.height()


def test_without_an_alarm_the_strip_says_so_where_that_is_known(around: Around, bench: Bench) -> None:
    bench.look_again([walking(100), looked()])
    around.alarms.refresh()
    assert around.alarms.headline.text() == "No alarms"
    bench.station.robot.parts.clear()
    around.alarms.refresh()
    assert around.alarms.headline.text() == "Alarms not known"


def test_a_headline_is_whole_when_the_text_has_grown(window: MainWindow, bench: Bench, theme: Theme) -> None:
    window.resize(1366, 768)
    fault(bench)
    for scale in (1.0, 2.0, 0.8):
        theme.set(scale=scale)
        settle(window, bench)
        headline = window.alarms.headline
        assert is_whole(headline), scale
        assert headline.visibleRegion().boundingRect().height() == headline.height(), scale
        rows = opened(window, bench)
        assert rows, scale
        settle(window, bench)
        for row in rows:
            assert is_whole(row.headline), scale
            assert is_whole(row.details), scale
        window.alarms.more.click()  # it is closed again


def test_while_the_list_is_open_no_row_moves(around: Around, bench: Bench) -> None:
    fault(bench)
    (row,) = (row for row in opened(around, bench) if "left knee" in row.headline.text())
    place = around.alarms.list.rows.index(row)
    bench.station.stop("test")
    bench.first.fail(NotConnected(WHY))
    settle(around, bench)
    assert "left knee" in around.alarms.list.rows[place].headline.text(), "a worse one came before it"
    now_ns = time.monotonic_ns()
    bench.look_again([telemetry([now_ns + 5], {"left_knee.state": [5.0]}, now_ns), looked()])
    settle(around, bench)
    assert row.headline.text().endswith("(over)")
    assert not row.buttons.isVisible()
    around.alarms.list.turn()
    assert all("left knee" not in row.headline.text() for row in opened(around, bench))


def test_under_the_pointer_no_row_moves_because_a_text_grows_or_buttons_go(
    around: Around, bench: Bench
) -> None:
    fault(bench)
    bench.station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    rows = opened(around, bench)
    assert len(rows) > 1
    settle(around, bench)
    around.alarms.list.setAttribute(Qt.WidgetAttribute.WA_UnderMouse)
    settle(around, bench)
    before = [row.geometry() for row in rows]
    words = "the drive is in fault: " + "which took some time to say what has happened to it, " * 12
    bench.look_again([looked(state="fault", problem=words)])
    rows[0].acknowledge.click()
    settle(around, bench)
    assert [row.geometry() for row in rows] == before
    for row in rows:
        assert is_whole(row.details) or row.details.isHidden()
    assert any(row.toolTip() for row in rows), "what has no room stands nowhere"
    around.alarms.list.setAttribute(Qt.WidgetAttribute.WA_UnderMouse, False)
    settle(around, bench)
    assert not any(row.toolTip() for row in rows)


def test_a_click_that_was_meant_for_another_alarm_acknowledges_none(
    around: Around, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault(bench)
    bench.draw(around)
    monkeypatch.setattr("server_gui.views.alarms.strip.HOLD_S", 0.0)
    bench.draw(around)
    assert around.alarms.buttons.acknowledge.isEnabled()
    monkeypatch.setattr("server_gui.views.alarms.strip.HOLD_S", 1e9)
    bench.desk.recording.alarms.acknowledge((Kind.FAULT, ""))
    bench.station.alarms.acknowledge((Kind.FAULT, "left_knee"))
    bench.station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    bench.draw(around)
    assert "STOPPED" in around.alarms.headline.text()
    assert not around.alarms.buttons.acknowledge.isEnabled()


def test_a_fault_is_the_same_on_strip_card_header_and_events(around: Around, bench: Bench) -> None:
    fault(bench)
    bench.draw(around)
    mark = bench.station.mark
    assert (mark.shape, mark.colour, mark.word) == ("square", "bad", "left knee fault")
    header = around.header._chips["robot"]
    assert header.detail_text.startswith("left knee fault"), "its other drives are well"
    assert around.alarms.texts[0].startswith(f"fault: left knee: {CAUSE}\nsince ")
    assert "→ check that the joint moves freely" in around.alarms.texts[0]
    assert around.robots.cards[0].texts[1] == f"fault: left knee: {CAUSE}"
    assert CAUSE in around.alarms.headline.text()
    assert around.events.pinned[0].mark == bench.station.alarms.active[0].alarm.mark


def test_the_signal_of_a_fault_is_shown_and_it_is_cleared_after_a_question_that_says_who_loses_torque(
    window: MainWindow, bench: Bench
) -> None:
    fault(bench)
    bench.draw(window)
    window.alarms.buttons.show_signal.click()
    assert window.tabs.currentIndex() == 1
    drawn = [plot.drawn for plot in window.tabs.signals.plots]
    assert drawn == [(f"left_knee.{name}",) for name in ("current", "torque", "position", "velocity")]
    assert window.tabs.signals.pause.isChecked()
    left, right = window.tabs.signals.plots[0].plot.window_s
    assert -8.0 < left <= -5.0
    assert right <= 0.0
    now_ns = time.monotonic_ns()
    bench.station.take([telemetry([now_ns + 2], {"right_hip.state": [4.0]}, now_ns)])
    bench.draw(window)
    window.alarms.buttons.clear.click()
    assert bench.first.named("reset") == [], "nothing is done before it is answered"
    asked = question(window)
    assert QApplication.activeModalWidget() is None, "STOP would be out of reach"
    assert "None is enabled" in asked.words.text()
    assert "STILL ENABLED, and without torque then: right hip" in asked.words.text()
    asked.act.click()
    assert [name for name, _ in bench.first.asked if name != "show_processes"] == ["reset"]


def test_what_is_acknowledged_is_one_line_until_it_is_over(around: Around, bench: Bench) -> None:
    fault(bench)
    opened(around, bench)[0].acknowledge.click()
    (text,) = (text for text in around.alarms.texts if CAUSE in text)
    assert text.startswith("fault: left knee: ")
    assert text.partition("\n")[0].endswith("acknowledged)")


@pytest.mark.parametrize(
    ("width", "height", "scale"), [(1024, 700, 1.0), (1366, 768, 1.5), (1920, 1080, 1.0)]
)
def test_a_stop_that_is_not_confirmed_is_whole_with_its_reason(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    theme.set(scale=scale)
    window.resize(width, height)
    bench.station.stop("test")
    bench.first.fail(NotConnected(WHY))
    settle(window, bench)
    settle(window, bench)
    row = window.alarms
    assert row.headline.text() == "STOP NOT CONFIRMED: use the hardware stop · no link, nothing was sent"
    assert WHY.partition("; ")[2] in row.texts[0]
    if width > 1900:
        assert WHY.partition("; ")[2] in row.details.text()
    assert row.property("tone") == "urgent"
    assert is_whole(row.headline)
    assert row.headline.visibleRegion().boundingRect().size() == row.headline.size()
    assert stop_is_whole(window)


def test_the_result_of_a_stop_leaves_the_alarms_in_sight(around: Around, bench: Bench) -> None:
    fault(bench)
    bench.station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    bench.draw(around)
    assert around.header.outcome_text == "STOP confirmed"
    assert CAUSE in around.alarms.headline.text()
    assert len(around.alarms.texts) == 2


def test_a_held_stop_is_reset_after_a_question_about_that_robot_once_it_is_answered(
    window: MainWindow, bench: Bench
) -> None:
    bench.station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    bench.draw(window)
    window.header.reset_button.click()
    QTest.keyClick(question(window), Qt.Key.Key_Escape)
    assert bench.first.named("reset") == []
    window.header.reset_button.click()
    asked = question(window)
    assert "exo-01" in asked.windowTitle()
    bench.desk.select(bench.add("other", 7421))
    asked.act.click()
    assert len(bench.first.named("reset")) == 1, "another robot was reset"
    bench.first.answer(Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False))
    bench.desk.select(bench.station)
    now_ns = time.monotonic_ns()
    off: dict[str, list[float | None]] = {f"{joint}.state": [5.0] for joint in JOINTS}
    bench.station.take([telemetry([now_ns + 1], off, now_ns)])
    window.alarms.refresh()
    assert any("to go on: enable the drives" in text for text in window.alarms.texts)


def test_a_robot_is_chosen_by_keyboard_and_removed_after_a_question(window: MainWindow, bench: Bench) -> None:
    other = bench.add("exo-02", 7421)
    bench.draw(window)
    QTest.keyClick(window.robots.cards[1], Qt.Key.Key_Return)
    assert bench.desk.selected is other
    removed: list[object] = []
    window.removed.connect(removed.append)
    window.robots.cards[1].remove.click()
    assert "Nothing of it is stopped" in question(window).words.text()
    question(window).act.click()
    assert removed == [other]
    bench.desk.remove(other)
    bench.draw(window)
    assert [card.station for card in window.robots.cards] == [bench.station]


def test_alarms_of_two_robots_are_named(around: Around, bench: Bench) -> None:
    fault(bench)
    other = bench.add("exo-02", 7421)
    other.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    bench.draw(around)
    assert [text.partition(" · ")[0] for text in around.alarms.texts] == ["exo-01", "exo-02"]


def test_words_have_room_beside_the_buttons_that_come_with_them(window: MainWindow, bench: Bench) -> None:
    bench.look_again([walking(10), looked()])
    bar = window.alarms._words.verticalScrollBar()
    for width in (1200, 1480):
        window.resize(width, 900)
        bench.station.stopping.held = False
        bench.draw(window)
        bench.station.stopping.held = True
        window.refresh()
        assert window.alarms.told
        wait(lambda: not bar.isVisible(), "laid the words out without a scroll bar")


def test_after_a_reset_how_to_go_on_stands_before_warnings_and_after_what_is_bad(
    around: Around, bench: Bench
) -> None:
    received_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {f"{joint}.state": [1.0] for joint in JOINTS}
    bench.station.take(
        [telemetry([received_ns], columns, received_ns), looked(state="stale", problem="late")]
    )
    bench.station.stopping.was_reset(held=False)
    bench.look_again([looked(state="stale", problem="late")])
    settle(around, bench)
    assert around.alarms.told[0][1].alarm.kind is Kind.RESET
    assert "enable the drives" in " ".join(around.alarms.texts)
    assert bench.station.mark.word == "left knee stale", "its mark is that of the worst"
    bench.look_again([looked(state="lost", problem="gone")])
    settle(around, bench)
    assert around.alarms.told[0][1].alarm.mark.word == "lost"
