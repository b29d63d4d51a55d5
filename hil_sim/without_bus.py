"""The robot without its bus: the gait's set-points go straight to the servos, four times as fast to simulate.

Motors, joints, wearer and sensors are the same, and so are the faults on them. There is no node to lose, no
frame, and nobody who could stop it: for recordings alone.
"""

from hil_sim.clock import MILLISECOND_NS, SECOND_NS
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.sensors.suite import PERIOD_NS

CYCLE_NS = 10 * MILLISECOND_NS


class BareExoskeleton(Exoskeleton):
    """An `Exoskeleton` that is led by its gait controller's motion, and not by its frames."""

    def power_on(self) -> None:
        """Switch on: the joints follow the motion from the first cycle on."""
        self.clock.every(CYCLE_NS, self._lead)
        self.clock.every(PERIOD_NS, self._measure)
        self._go_on()

    def _lead(self) -> None:
        self.controller.step_motion(CYCLE_NS / SECOND_NS)
        for drive, target in zip(self.drives.values(), self.controller.set_points(), strict=True):
            drive.lead(target)
