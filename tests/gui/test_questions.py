"""Questions lie beside what is looked at before they are answered."""

import itertools
import time

import pytest
from PySide6.QtCore import QPoint, QRect, QSize
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget

from gateway.wire.stop import Stopped
from server_gui.views.confirmation import LOOK_MS, Question, ask
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.recording_chip import ask_name
from server_gui.views.robots.reset import _ask_again
from server_gui.views.theme import Theme
from server_gui.views.widgets.free_place import free_place
from server_gui.views.widgets.stop_button import StopButton
from tests.gui import rules
from tests.gui.fakes import Bench, destroy
from tests.gui.faulty import fault
from tests.gui.running import wait
from tests.support.desk import JOINTS, looked, telemetry, walking

ROOM = QRect(0, 0, 100, 100)
SIZE = QSize(40, 40)
HELD = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)


@pytest.mark.parametrize(
    ("kept", "place"),
    [
        ([], (29, 60)),
        ([[QRect(0, 90, 100, 10)]], (29, 50)),
        ([[QRect(0, 50, 60, 50)]], (60, 60)),
        ([[QRect(0, 0, 100, 100)], [QRect(0, 50, 100, 50)]], (29, 10)),
        ([[QRect(0, 70, 100, 30)], [QRect(0, 0, 100, 69)]], (29, 30)),
    ],
)
def test_a_place_covers_the_first_least_and_is_low(kept: list[list[QRect]], place: tuple[int, int]) -> None:
    assert free_place([SIZE], ROOM, kept).topLeft().toTuple() == place


def on_screen(widget: QWidget) -> QRect:
    seen = widget.visibleRegion().boundingRect()
    return seen.translated(widget.mapToGlobal(QPoint(0, 0)))


def covered(question: Question, widgets: list[QWidget]) -> list[QWidget]:
    taken = question.frameGeometry()
    return [one for one in widgets if one.isVisible() and on_screen(one).intersects(taken)]


@pytest.mark.parametrize("scale", [1.0, 1.5])
@pytest.mark.parametrize("size", [(1366, 768), (1024, 700)])
def test_stops_their_results_and_the_joints_stay_in_sight_beside_the_question_of_a_reset(
    window: MainWindow,
    bench: Bench,
    theme: Theme,
    size: tuple[int, int],
    scale: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("server_gui.views.confirmation.in_sight", lambda _: window.geometry())
    theme.set(scale=scale)
    window.resize(*size)
    bench.station.take([walking(300), looked(state="fault", problem="overcurrent, 0x2310")])
    bench.station.stop("test")
    bench.first.answer(HELD)
    joints = window.tabs.overview._joints
    for dock, asked in itertools.product(window.docks[:2], (window.header.reset, window.alarms.cleared)):
        window.bring(dock)
        for _ in range(3):
            bench.draw(window)
            rules.settle()
        asked.emit(bench.station)
        question = next(one for one in window.findChildren(Question) if one.isVisible())
        results = [window.header, window.alarms, *window.robots.cards]
        assert covered(question, [*window.findChildren(StopButton), *results]) == []
        assert window.geometry().contains(question.geometry())
        is_long = asked is window.alarms.cleared and scale > 1.0  # there is no room beside all of it
        assert is_long or covered(question, [joints]) == []
        destroy(question)


@pytest.mark.parametrize("is_open", [False, True])
def test_a_question_leaves_the_result_of_stop_all_in_sight_whichever_comes_first(
    window: MainWindow, bench: Bench, monkeypatch: pytest.MonkeyPatch, is_open: bool
) -> None:
    monkeypatch.setattr("server_gui.views.confirmation.in_sight", lambda _: window.geometry())
    window.resize(1366, 768)
    bench.station.take([walking(300), looked()])
    bench.add("exo-02", 7421).take([walking(300), looked()])

    def draw() -> None:
        for _ in range(3):
            bench.draw(window)
            rules.settle()

    def stop_all() -> None:
        bench.desk.stop_all("test")
        for commands in bench.commands:
            commands.answer(HELD)

    def ask() -> None:
        window.robots.cards[0].remove.click()

    draw()
    for step in (ask, stop_all) if is_open else (stop_all, ask):
        step()
        draw()
    (question,) = (one for one in window.findChildren(Question) if one.isVisible())
    assert window.stopped_all.isVisible()
    kept = [window.stopped_all, *window.findChildren(StopButton)]
    wait(lambda: covered(question, kept) == [], "left them in sight")


@pytest.mark.parametrize(("size", "scale"), [((1024, 700), 1.0), ((1024, 700), 2.0), ((1366, 768), 2.0)])
def test_a_question_leaves_stops_that_come_with_another_panel(
    window: MainWindow,
    bench: Bench,
    theme: Theme,
    monkeypatch: pytest.MonkeyPatch,
    size: tuple[int, int],
    scale: float,
) -> None:
    """Opened beside the parameters, it lay over STOP ALL as soon as the robots were looked at."""
    monkeypatch.setattr("server_gui.views.confirmation.in_sight", lambda _: window.geometry())
    theme.set(scale=scale)
    window.resize(*size)
    bench.station.take([walking(300), looked()])
    bench.add("exo-02", 7421).take([walking(300), looked()])
    window.bring(window.docks[1])
    bench.draw(window)
    rules.settle()
    window.header.reset.emit(bench.station)
    (question,) = (one for one in window.findChildren(Question) if one.isVisible())
    window.bring(window.docks[0])

    def is_beside() -> bool:
        bench.draw(window)
        return window.robots.all_stop.isVisible() and covered(question, window.findChildren(StopButton)) == []

    wait(is_beside, "left every STOP in sight")


def test_a_question_leaves_a_stop_under_which_the_window_is_resized(
    window: MainWindow, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.views.confirmation.in_sight", lambda _: window.geometry())
    bench.station.take([walking(300), looked()])
    window.resize(1366, 768)
    window.header.reset.emit(bench.station)
    (question,) = (one for one in window.findChildren(Question) if one.isVisible())
    before = question.frameGeometry()
    window.resize(1360, 760)
    QTest.qWait(3 * LOOK_MS)
    assert question.frameGeometry() == before, "it covers nothing: it stays"
    stop = next(one for one in window.findChildren(StopButton) if one.isVisible())
    question.move(on_screen(stop).topLeft())
    window.resize(1024, 700)
    wait(lambda: covered(question, window.findChildren(StopButton)) == [], "left every STOP in sight")


def test_a_question_about_what_is_over_goes_by_itself(window: MainWindow, bench: Bench) -> None:
    """A fault had long been cleared, and a card said still that it could not be."""
    over = list[bool]()
    question = ask(
        window, "NOT cleared", "left_knee stays in fault", "Again", lambda: None, is_moot=lambda: bool(over)
    )
    QTest.qWait(3 * LOOK_MS)
    assert question.isVisible()
    over.append(True)
    wait(lambda: not window.findChildren(Question), "went")


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_a_question_with_two_fields_has_room_for_all_of_its_words(
    window: MainWindow, theme: Theme, scale: float
) -> None:
    theme.set(scale=scale)
    window.resize(1280, 742)
    ask_name(window, lambda _name, _wearer: None)
    (question,) = window.findChildren(Question)
    QTest.qWait(LOOK_MS)
    needed = question.words.heightForWidth(question.words.width())
    assert question.words.height() >= needed
    assert question.act.geometry().bottom() < question.height()
    foot = window.mapToGlobal(window.rect().bottomLeft()).y()
    assert question.mapToGlobal(question.rect().bottomLeft()).y() <= foot, "its buttons are below the edge"


def test_a_card_about_a_fault_stays_while_nobody_knows_its_drive(window: MainWindow, bench: Bench) -> None:
    """It went with the drive that fell silent, as if its fault were over."""
    fault(bench)
    _ask_again(window, bench.station, "left_knee stays in fault", ())
    for left_knee, stays in ((None, True), (6.0, False)):
        now_ns = time.monotonic_ns()
        states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
        states["left_knee.state"] = [left_knee]
        bench.station.take([telemetry([now_ns], states, now_ns), looked()])
        if stays:
            QTest.qWait(3 * LOOK_MS)
            assert window.findChildren(Question)
    wait(lambda: not window.findChildren(Question), "went")
