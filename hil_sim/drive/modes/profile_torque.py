"""Profile torque: ramps to the target torque and keeps it (CiA 402-2 §13)."""

from hil_sim.drive import objects as od
from hil_sim.drive.modes.mode import TARGET_REACHED, Mode
from hil_sim.drive.motion import TorqueRamp
from hil_sim.drive.settings import Control
from hil_sim.node.dictionary import Key


class ProfileTorque(Mode):
    """Target 6071h by the slope 6087h; halt takes the torque to zero by the same slope."""

    def enter(self) -> None:
        super().enter()
        self.servo.use(Control.TORQUE)
        self._ramp = TorqueRamp()
        self._follow()
        self.servo.motion = self._ramp

    def halt(self) -> None:
        self._follow()

    def resume(self) -> None:
        self._follow()

    def target_written(self, key: Key, changed: bool) -> None:
        if changed and key == od.TARGET_TORQUE:
            self._ramp.done = False

    def _follow(self) -> None:
        settings = self.servo.settings
        wanted = self.objects.number(od.TARGET_TORQUE) / 1000.0 * settings.rated_torque
        target = min(max(wanted, settings.lowest_torque), settings.highest_torque)
        self.clipped = target != wanted
        self._ramp.aim(0.0 if self.halted else target, settings.torque_slope)

    def update(self, elapsed_s: float) -> None:  # noqa: ARG002 - the shape of a mode
        self._follow()

    def status(self) -> int:
        return TARGET_REACHED * self._ramp.done
