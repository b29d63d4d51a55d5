"""Start of the window until the simulated robot walks: it counts the steps, and ends the splash."""

from typing import TYPE_CHECKING, Final

from server_gui.core.desk.first_steps import STARTS, FirstStep, FirstSteps
from server_gui.processes.demo_robot import DemoRobot
from server_gui.processes.simulated import RobotPart
from server_gui.views.first_run.splash import Splash

if TYPE_CHECKING:  # it takes long to import, and the splash does not wait for it
    from server_gui.core.desk.station import Station

STEPS: Final = {RobotPart.SIMULATOR: FirstStep.SIMULATOR, RobotPart.GATEWAY: FirstStep.GATEWAY}
LONGEST_S: Final = 60.0  # that a splash stands there


class Opening:
    """`look` is called now and then, while the robot starts and after that."""

    def __init__(self, own: DemoRobot, steps: FirstSteps, splash: Splash) -> None:
        self.own = own
        self._steps = steps
        self._splash = splash
        self.is_over = False

    @property
    def words(self) -> str:
        """What the window says meanwhile."""
        step = self._steps.now
        return STARTS if step is None else f"{STARTS} Next: {step.value}"

    def look(self, station: "Station | None" = None, *, window: bool = False) -> None:
        """Count what is so; `window`: it is there."""
        if self.is_over:
            return
        for part in self.own.ready:
            self._steps.reach(STEPS[part])
        if window and FirstStep.WINDOW not in self._steps.took_s:
            self._steps.reach(FirstStep.WINDOW)
            self._splash.close()  # it would lie over the window, which says the rest itself
        if station is not None and station.robot.parts and station.is_live:
            self._steps.reach(FirstStep.DATA)
            if station.processing.derived().gait.walking:
                self._steps.reach(FirstStep.WALK)
        self._splash.refresh()
        too_long = self._steps.elapsed_s > LONGEST_S
        if too_long or self.own.problem or self._steps.now is None:
            self.is_over = True
            self._splash.close()
