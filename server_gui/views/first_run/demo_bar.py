"""Bar of the demo: let the simulated robot walk, break something, repair it, look around."""

from collections.abc import Callable
from typing import Final

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QMenu, QPushButton, QToolBar, QWidget

from server_gui.core.alarms.marks import ENABLED
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.station import Station
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.threads.background import Background
from server_gui.core.tuning.stop import StopState
from server_gui.processes.demo_robot import DemoRobot
from server_gui.processes.sim_control import Listed, SimControl, SimulatorRefuses
from server_gui.views.first_run.fault_menu import fill, words
from server_gui.views.first_run.tour import Tour
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

TOURED: Final = "toured"  # kept: the tour begins by itself only until somebody has left it
HELD: Final = "A stop is held: end it first with “Reset stop…” above. Then this lets the robot walk again."
ENDS: Final = " (which also ends the stop that is held)"
GONE: Final = frozenset({Kind.LOST, Kind.PART_STALE})
WIDE: Final = 1200  # at text of 100 %: the tour has room beside the buttons
REPAIR: Final = "Repair all"
WALKING: Final = "It walks, with every drive enabled"
WALKS: Final = "Tells the simulated controller to start and the wearer to walk, as after a stop or a fault"


def walks(station: Station) -> bool:
    """Return whether nothing is left to start: its wearer walks, and every drive is enabled."""
    robot = station.robot
    words = {robot.word(f"{joint}.state") for joint in robot.names("joint")}
    return station.is_live and bool(station.processing.derived().gait.walking) and words == {ENABLED}


class DemoBar(QToolBar):
    """Below the header; every question to the simulator waits in a thread of its own, which `end` joins."""

    def __init__(
        self,
        window: MainWindow,
        own: DemoRobot,
        control: SimControl,
        station: Station,
        theme: Theme,
        deliver: Deliver,
    ) -> None:
        super().__init__("Simulated robot")
        self._own, self._control, self._station = own, control, station
        self._theme = theme
        self._kept = window.kept
        self._deliver = deliver
        self._asking = Background("simulator")
        self._listed = Listed({}, ())
        self._failed = ""
        self.setObjectName("Simulated robot")
        self.setMovable(False)
        self.setFloatable(False)
        self.toggleViewAction().setEnabled(False)  # it cannot be closed: what is broken is to be repaired
        self.walk, self.mend, self.again = (
            QPushButton("Start walking"),
            QPushButton(REPAIR),
            QPushButton("Tour"),
        )
        self.breaking = QPushButton("Break something")
        self.faults = QMenu(self.breaking)
        self.said = WrappingLabel("dim")
        self.tour = Tour(window, theme)
        self._build()
        window.addToolBar(self)
        self._ask(lambda: None)
        if not window.kept.value(TOURED, defaultValue=False, type=bool):
            self._begin_tour()

    def end(self, within_s: float) -> bool:
        """Ask no more; False where a question hangs."""
        return self._asking.close(within_s)

    def refresh(self) -> None:
        """Show how it is now."""
        held = self._station.stopping.held
        why_not = HELD if held else WALKING if walks(self._station) else self._why_not()
        self.walk.setEnabled(not why_not and self._own.is_running)
        set_tip(self.walk, why_not or WALKS)
        self.breaking.setEnabled(bool(self._listed.faults) and self._own.is_running)
        self.mend.setEnabled(bool(self._listed.active) and self._own.is_running)
        set_text(self.said, self._words(held=held))
        self.tour.refresh()

    # --- inside

    def _why_not(self) -> str:
        """Return why it would be wrong to walk now: what does not stop, or is in fault."""
        if self._station.stopping.state in (StopState.SENT, StopState.NOT_CONFIRMED):
            return "A STOP is not confirmed yet"
        tripped = self._tripped()
        if tripped:
            return f"In fault: {', '.join(map(words, tripped))}. Clear the fault first"
        joints = self._station.robot.names("joint")
        gone = [
            one.subject for one in self._station.alarms.each if one.kind in GONE and one.subject in joints
        ]
        return f"Silent: {', '.join(map(words, gone))}. {REPAIR} first" if gone else ""

    def _build(self) -> None:
        self.walk.clicked.connect(lambda: self._ask(self._control.walk))
        self.mend.clicked.connect(lambda: self._ask(self._control.mend))
        self.mend.setToolTip(
            "End every active fault. A drive that has tripped stays off until its fault is cleared"
        )
        self.again.clicked.connect(self._begin_tour)
        self.again.setToolTip("The parts of the window, in five steps")
        self.breaking.setMenu(self.faults)
        self.faults.aboutToShow.connect(self._fill)
        self.breaking.setToolTip("The simulator's faults by name, as gwrms sim-fault makes them")
        self.tour.left.connect(self._toured)
        row = QHBoxLayout()
        row.setContentsMargins(10, 0, 10, 0)
        row.setSpacing(6)
        for button in (self.walk, self.breaking, self.mend, self.again):
            button.setObjectName("section")  # low: what is below needs the height
            row.addWidget(button)
        row.addWidget(self.said, 1)
        page = QWidget()
        page.setObjectName("dock")
        self._way = QBoxLayout(QBoxLayout.Direction.TopToBottom, page)
        self._way.setContentsMargins(0, 0, 0, 0)
        self._way.setSpacing(0)
        self._way.addLayout(row)
        self._way.addWidget(self.tour, 1)
        self.addWidget(page)
        if (around := self.layout()) is not None:
            around.setContentsMargins(0, 0, 0, 0)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Have the tour beside the buttons where the window is wide, else below them."""
        is_wide = self.width() >= self._theme.px(WIDE)
        way = QBoxLayout.Direction.LeftToRight if is_wide else QBoxLayout.Direction.TopToBottom
        if way is not self._way.direction():
            self._way.setDirection(way)
        self.said.setVisible(not is_wide or self.tour.isHidden())

    def _begin_tour(self) -> None:
        self.again.setEnabled(False)
        self.tour.begin()
        self._fit()

    def _toured(self) -> None:
        self.again.setEnabled(True)
        self._fit()
        self._kept.setValue(TOURED, True)

    def _words(self, *, held: bool) -> str:
        if self._own.problem:
            return f"The simulated robot has ended: {self._own.problem}"
        if self._failed:
            return f"Not done: {self._failed}"
        broken = ", ".join(f"{words(one.name)} on {words(one.on)}" for one in self._listed.active)
        tripped = ", ".join(map(words, self._tripped()))
        of_several = len(self._station.neighbours) > 1
        robot = f"Simulated robot, {self._station.title}" if of_several else "Simulated robot"
        said = f"Broken: {broken}" if broken else f"{robot}; nothing was broken here"
        if tripped:
            clear = f"Clear fault{ENDS if held else ''}"
            how = f"{REPAIR}, then {clear}" if broken else clear
            return f"{said if broken else robot}. Tripped: {tripped}. {how}, then Start walking"
        whose = f"A stop of {self._station.title} is held" if of_several else ""
        whose = whose or "A stop is held"
        return f"{said}. {whose}: reset it, then Start walking" if held else said

    def _tripped(self) -> list[str]:
        """Drives in fault: they stay so after what had tripped them is over, which may be at once."""
        return [one.subject for one in self._station.alarms.each if one.kind is Kind.FAULT]

    def _ask(self, work: Callable[[], None]) -> None:
        """Do this in the thread, and look then what is broken."""

        def asked() -> Listed:
            work()
            return self._control.listed()

        when_done(self._asking.do(asked), self._deliver, self._know, self._refused)

    def _know(self, listed: Listed) -> None:
        self._listed, self._failed = listed, ""

    def _fill(self) -> None:
        """Never while it is open."""
        fill(self.faults, self._listed, lambda fault, on: self._ask(lambda: self._control.break_(fault, on)))

    def _refused(self, error: Exception) -> None:
        self._failed = str(error) if isinstance(error, SimulatorRefuses) else type(error).__name__
