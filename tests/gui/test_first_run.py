"""The first minutes: what the empty window offers, the splash, breaking the simulated robot, the tour."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMenu, QPushButton

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.first_steps import FirstStep, FirstSteps
from server_gui.processes.demo_robot import DemoRobot
from server_gui.processes.sim_control import ActiveFault, FaultKind, Listed, SimControl, SimulatorRefuses
from server_gui.processes.simulated import RobotPart
from server_gui.views.first_run.demo_bar import DemoBar
from server_gui.views.first_run.fault_menu import fill, grouped
from server_gui.views.first_run.opening import Opening
from server_gui.views.first_run.splash import Splash
from server_gui.views.first_run.tour import STOPS
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.robots.pairing import PairingDialog
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy, stop_is_whole
from tests.gui.faulty import fault
from tests.gui.rules import settle
from tests.gui.running import wait
from tests.support.desk import JOINTS, looked, telemetry, walking

LEGS = ("left_knee", "right_knee")
KINDS = {
    "node_lost": FaultKind((*LEGS, "gait"), "No frame of the node any more."),
    "overcurrent": FaultKind(LEGS, "EMCY 2310h.", momentary=True),
    "sensor_unplugged": FaultKind(("left_insole", "right_insole", "trunk"), "The port hangs up."),
    "bus_cut": FaultKind(("bus",), "The gateway's cable is out."),
}


class FakeControl(SimControl):
    """A simulator that does what it is asked."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.active: tuple[ActiveFault, ...] = ()
        self.problem = ""

    def listed(self) -> Listed:
        return Listed(KINDS, self.active)

    def break_(self, fault: str, on: str) -> None:
        if self.problem:
            raise SimulatorRefuses(self.problem)
        self.active = (*self.active, ActiveFault(fault, on))

    def mend(self) -> None:
        self.active = ()

    def walk(self) -> None:
        self.asked.append("walk")


class Running(DemoRobot):
    """A simulated robot that needs no processes."""

    runs = True

    @property
    def is_running(self) -> bool:
        return self.runs


class Demo:
    """The bar below the header, drawn with whatever its thread has posted."""

    def __init__(self, window: MainWindow, bench: Bench, theme: Theme) -> None:
        self.control, self.own, self.posted = FakeControl(), Running(), list[Callable[[], None]]()
        station = bench.desk.stations[0]
        self.bar = DemoBar(window, self.own, self.control, station, theme, self.posted.append)
        self._window, self._bench = window, bench

    def draw(self) -> None:
        while self.posted:
            self.posted.pop(0)()
        self.bar.refresh()
        self._bench.draw(self._window)

    def until(self, so: Callable[[], object], what: str) -> None:
        def drawn() -> bool:
            self.draw()
            return bool(so())

        wait(drawn, what)


@pytest.fixture
def demo(window: MainWindow, bench: Bench, theme: Theme) -> Iterator[Demo]:
    made = Demo(window, bench, theme)
    made.until(made.bar.breaking.isEnabled, "knew the faults")
    yield made
    assert made.bar.end(30.0)


def click(button: QPushButton) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def below(menu: QMenu, *path: str) -> QMenu:
    for title in path:
        (found,) = [action.menu() for action in menu.actions() if action.text() == title]
        assert isinstance(found, QMenu)
        menu = found
    return menu


def test_walking_is_offered_where_it_is_over_and_no_stop_is_held_and_the_simulator_runs(
    demo: Demo, bench: Bench
) -> None:
    bench.station.stopping.held = True
    demo.draw()
    assert not demo.bar.walk.isEnabled()
    assert "reset it" in demo.bar.said.text()
    bench.station.stopping.held = False
    demo.draw()
    assert demo.bar.walk.isEnabled(), "nobody knows yet whether it walks"
    bench.station.take([walking(600)])
    demo.draw()
    assert not demo.bar.walk.isEnabled()
    assert "It walks" in demo.bar.walk.toolTip()
    fault(bench)
    demo.draw()
    assert not demo.bar.walk.isEnabled(), "five drives were enabled beside the one in fault"
    assert demo.bar.walk.toolTip() == "In fault: left knee. Clear the fault first"
    assert demo.control.active == ()
    words = "Simulated robot. Tripped: left knee. Clear fault, then Start walking"
    assert demo.bar.said.text() == words, "called whole once the cause is over"
    bench.station.stopping.held = True
    demo.draw()
    held = "Clear fault (which also ends the stop that is held), then Start walking"
    assert demo.bar.said.text() == f"Simulated robot. Tripped: left knee. {held}"
    bench.station.stopping.held = False
    now_ns = time.monotonic_ns()
    off: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    bench.station.take([telemetry([now_ns], off, now_ns), looked(state="lost", problem="no heartbeat")])
    demo.draw()
    assert not demo.bar.walk.isEnabled()
    assert demo.bar.walk.toolTip() == "Silent: left knee. Repair all first"
    bench.station.take([telemetry([now_ns], off, now_ns), looked()])
    demo.draw()
    click(demo.bar.walk)
    demo.until(lambda: demo.control.asked == ["walk"], "told it to walk")
    demo.own.runs, demo.own.problem = False, "the simulator has ended (killed by SIGKILL)"
    demo.draw()
    assert "has ended: the simulator has ended (killed by SIGKILL)" in demo.bar.said.text()
    assert not demo.bar.walk.isEnabled()
    assert not demo.bar.breaking.isEnabled()


# --- without a robot


def test_an_empty_window_offers_to_add_a_robot_to_simulate_one_and_to_open_a_recording(
    qt: QApplication, theme: Theme, tmp_path: Path
) -> None:
    bench = Bench(Desk())
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    window = MainWindow(bench.desk, theme, kept)
    window.show()
    bench.draw(window)
    assert window.empty.isVisible()
    added, asked = list[str](), list[str]()
    window.added.connect(added.append)
    window.simulator.connect(lambda: asked.append("simulator"))
    empty = window.empty
    empty.recordings.connect(lambda: asked.append("recordings"))
    empty.address.setText("nowhere:never")
    click(empty.add)
    assert (added, empty.wrong.isVisible()) == ([], True)
    empty.address.setText(" 192.0.2.7:7420 ")
    QTest.keyClick(empty.address, Qt.Key.Key_Return)
    assert (added, empty.wrong.isVisible()) == (["192.0.2.7:7420"], False)
    click(empty.start)
    assert not empty.start.isEnabled()
    click(empty.open)
    assert asked == ["simulator", "recordings"]
    destroy(window)


@pytest.mark.parametrize("typed", ["192.0.2.7:7420", "gwrms://192.0.2.7:7420#ABCD"])
def test_an_empty_window_pairs_with_a_robot_by_what_was_typed(
    qt: QApplication, theme: Theme, tmp_path: Path, typed: str
) -> None:
    window = MainWindow(Desk(), theme, QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat))
    window.show()
    added = list[str]()
    window.added.connect(added.append)
    window.empty.address.setText(typed)
    click(window.empty.add if "//" in typed else window.empty.pair)
    (dialog,) = window.robots.findChildren(PairingDialog)
    assert (dialog.isVisible(), dialog.address.text(), added) == (True, typed, [])
    dialog.paired.emit("192.0.2.7:7420")
    assert added == ["192.0.2.7:7420"]
    destroy(window)


@pytest.mark.parametrize(("width", "height", "scale"), [(1024, 700, 1.0), (1024, 700, 1.5), (1366, 768, 1.5)])
def test_the_three_offers_are_whole_on_small_screens_and_with_large_text(
    qt: QApplication, theme: Theme, tmp_path: Path, width: int, height: int, scale: float
) -> None:
    bench = Bench(Desk())
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    window = MainWindow(bench.desk, theme, kept)
    window.resize(width, height)
    window.show()
    theme.set(scale=scale)
    bench.draw(window)
    bench.draw(window)
    for button in (window.empty.add, window.empty.start, window.empty.open):
        assert button.width() >= button.sizeHint().width()
        right = button.mapTo(window.empty, QPoint(button.width(), 0)).x()
        assert right <= window.empty.visibleRegion().boundingRect().right() + 1
    destroy(window)


# --- with a simulated one


def test_faults_are_chosen_by_name_and_device_and_shown_until_mended_and_refusals_said(demo: Demo) -> None:
    demo.bar.faults.aboutToShow.emit()
    menu = below(demo.bar.faults, "Node on the bus", "node lost")
    assert [action.text() for action in menu.actions()] == ["left knee", "right knee", "gait"]
    assert menu.menuAction().toolTip() == "No frame of the node any more."
    assert not demo.bar.mend.isEnabled()
    menu.actions()[0].trigger()
    demo.until(lambda: "Broken: node lost on left knee" in demo.bar.said.text(), "said what is broken")
    click(demo.bar.mend)
    demo.until(lambda: "nothing was broken" in demo.bar.said.text(), "mended it")
    demo.control.problem = "node_lost is already on left_knee; clear it first"
    demo.bar.faults.aboutToShow.emit()
    below(demo.bar.faults, "Node on the bus", "node lost").actions()[0].trigger()
    demo.until(lambda: "Not done: node_lost is already on" in demo.bar.said.text(), "said why")


def test_what_is_on_already_cannot_be_broken_again(qt: QApplication) -> None:
    menu = QMenu()
    broken = {"bus_cut": FaultKind(("bus",), "Out.", active=("bus",))}
    fill(menu, Listed(broken, ()), lambda fault, on: None)
    (action,) = below(menu, "The bus itself").actions()
    assert (action.isChecked(), action.isEnabled()) == (True, False)
    destroy(menu)


def test_a_fault_that_nobody_has_grouped_is_in_the_menu_all_the_same() -> None:
    found = grouped(KINDS | {"moonlight": FaultKind(("moon",), "Bright.")})
    assert list(found) == [
        "Node on the bus",
        "Drive of a joint",
        "The bus itself",
        "IMU or a sensor",
        "Others",
    ]
    assert sum(len(kinds) for kinds in found.values()) == len(KINDS) + 1


def test_the_tour_has_five_steps_and_is_not_offered_again_once_it_was_left(
    demo: Demo, window: MainWindow, bench: Bench, theme: Theme
) -> None:
    tour = demo.bar.tour
    assert tour.isVisible()
    assert len(STOPS) == 5
    seen = [tour.words.text()]
    while tour.isVisible():
        assert window.header.stop.visibleRegion().boundingRect() == window.header.stop.rect()
        click(tour.next)
        demo.draw()
        seen.append(tour.words.text())
    assert [words.split(",")[0] for words in seen[:5]] == [f"{number} of 5" for number in range(1, 6)]
    again = Demo(window, bench, theme)
    again.draw()
    assert not again.bar.tour.isVisible()
    click(again.bar.again)
    again.draw()
    assert again.bar.tour.isVisible()
    click(again.bar.tour.skip)
    assert not again.bar.tour.isVisible()
    assert again.bar.end(30.0)


@pytest.mark.parametrize(("width", "height", "scale"), [(1024, 700, 1.0), (1024, 700, 1.5), (1366, 768, 1.5)])
def test_stop_demo_and_tour_are_whole_on_small_screens(
    demo: Demo, window: MainWindow, theme: Theme, width: int, height: int, scale: float
) -> None:
    window.resize(width, height)
    theme.set(scale=scale)
    demo.draw()
    assert (window.width(), window.height()) == (width, height)
    assert stop_is_whole(window)
    bar, tour = demo.bar, demo.bar.tour
    for button in (bar.walk, bar.breaking, bar.mend, bar.again, tour.next, tour.skip):
        assert button.width() >= button.sizeHint().width(), button.text()
        assert window.rect().contains(button.mapTo(window, button.rect().bottomRight())), button.text()
    for place in range(len(STOPS)):
        tour.go(place)
        demo.draw()
        assert tour._outline.isVisible()
        assert not tour._outline.geometry().intersects(window.statusBar().geometry()), STOPS[place].title


# --- the splash


def test_the_splash_says_which_step_is_done_and_ends_as_the_window_is_there_which_says_the_rest(
    qt: QApplication, theme: Theme, bench: Bench
) -> None:
    own, steps = Running(), FirstSteps()
    splash = Splash(steps, theme)
    splash.show()
    opening = Opening(own, steps, splash)
    opening.look()
    assert splash.texts[0] == "▸ Simulator: six drives, two insoles, an IMU"
    own.ready = (RobotPart.SIMULATOR,)
    opening.look()
    assert splash.texts[0].startswith("✓ Simulator")
    assert splash.texts[1].startswith("▸ Gateway")
    own.ready = (RobotPart.SIMULATOR, RobotPart.GATEWAY)
    opening.look(bench.desk.stations[0], window=True)
    assert steps.now is FirstStep.DATA  # nothing has come of the robot yet
    assert not splash.isVisible(), "it would lie over the window"
    assert not opening.is_over
    assert opening.words.endswith("Next: First data from every component")
    for step in FirstStep:
        steps.reach(step)
    opening.look(bench.desk.stations[0], window=True)
    assert opening.is_over
    assert not splash.isVisible()
    destroy(splash)


def test_a_start_that_fails_or_a_click_ends_the_splash(qt: QApplication, theme: Theme) -> None:
    own, steps = Running(), FirstSteps()
    splash = Splash(steps, theme)
    splash.show()
    own.problem = "the simulator has ended"
    Opening(own, steps, splash).look()
    assert not splash.isVisible()
    splash.show()
    assert splash.isVisible()
    QTest.mouseClick(splash, Qt.MouseButton.LeftButton)
    assert not splash.isVisible()
    destroy(splash)


def test_beside_the_demos_bar_a_small_laptop_shows_all_of_the_overview(
    demo: Demo, window: MainWindow, bench: Bench
) -> None:
    window.resize(1366, 768)
    bench.station.take([walking(300, age_s=-3600.0)])
    for is_touring in (True, False):
        for _ in range(3):
            demo.draw()
            settle()
        assert demo.bar.tour.isVisible() is is_touring
        assert demo.bar.said.isVisible() is not is_touring
        assert demo.bar.height() <= 40
        click(demo.bar.tour.skip)
    assert window.tabs.overview.sections.isHidden()
    assert min(plot.plot._lines.height() for plot in window.tabs.overview._plots) >= 70


@pytest.mark.parametrize("width", [1680, 1000])
def test_panels_wait_for_the_first_robot(
    qt: QApplication, theme: Theme, bench: Bench, tmp_path: Path, width: int
) -> None:
    station = bench.desk.stations[0]
    bench.desk.remove(station)
    window = MainWindow(bench.desk, theme, QSettings(str(tmp_path / "k.ini"), QSettings.Format.IniFormat))
    window.resize(width, 900)
    window.show()
    bench.draw(window)
    assert not [dock for dock in window.docks if dock.isVisible()]
    assert window.header.stop.isVisible()
    assert window.empty.address.isVisible()
    window.resize(2680 - width, 900)
    bench.draw(window)
    assert not [dock for dock in window.docks if dock.isVisible()], "nor where there is another room"
    bench.desk.add(station)
    bench.draw(window)
    assert all(not dock.isHidden() for dock in window.docks)
    destroy(window)


def test_an_address_is_whole_in_the_field_for_the_first_robot(
    qt: QApplication, theme: Theme, bench: Bench, tmp_path: Path
) -> None:
    theme.set(scale=1.5)
    bench.desk.remove(bench.desk.stations[0])
    window = MainWindow(bench.desk, theme, QSettings(str(tmp_path / "k.ini"), QSettings.Format.IniFormat))
    window.resize(1024, 700)
    window.show()
    bench.draw(window)
    field = window.empty.address
    assert field.width() > field.fontMetrics().horizontalAdvance("192.168.100.200:7420") + 8
    destroy(window)
