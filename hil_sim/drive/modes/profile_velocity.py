"""Profile velocity: ramps to the target velocity and keeps it (CiA 402-2 §12)."""

import math

from hil_sim.drive import objects as od
from hil_sim.drive.modes.mode import BIT_12, TARGET_REACHED, Dwell, Mode
from hil_sim.drive.motion import VelocityRamp
from hil_sim.drive.servo import Servo
from hil_sim.drive.settings import Control
from hil_sim.node.dictionary import Key


def within_limits(servo: Servo, wanted: float) -> float:
    """Return a velocity (rad/s) within the limits that does not run over the end of the software range."""
    settings = servo.settings
    left = settings.high_limit - servo.position if wanted > 0.0 else servo.position - settings.low_limit
    most = min(settings.max_velocity, math.sqrt(2.0 * settings.deceleration * max(left, 0.0)))
    return min(max(wanted, -most), most)


class ProfileVelocity(Mode):
    """A new target velocity takes effect at once, and so do new ramps."""

    def enter(self) -> None:
        super().enter()
        self._reached, self._stopped = Dwell(), Dwell()
        self.resume()

    def resume(self) -> None:
        self.servo.use(Control.VELOCITY)
        self._ramp = VelocityRamp(0.0, 0.0, 0.0)
        self._follow()
        self.servo.motion = self._ramp

    def target_written(self, key: Key, changed: bool) -> None:
        if changed and key == od.TARGET_VELOCITY:
            self._reached.restart()

    def _follow(self) -> None:
        settings = self.servo.settings
        wanted = self.objects.number(od.TARGET_VELOCITY) / settings.counts_per_radian
        target = within_limits(self.servo, wanted)
        self.clipped = target != wanted
        ramp = self._ramp
        ramp.target, ramp.acceleration, ramp.deceleration = (
            target,
            settings.acceleration,
            settings.deceleration,
        )

    def update(self, elapsed_s: float) -> None:
        settings, velocity = self.servo.settings, self.servo.velocity
        self._stopped.update(velocity, settings.velocity_threshold, elapsed_s)
        if not self.halted:
            self._follow()
            self._reached.update(self._ramp.target - velocity, settings.velocity_window, elapsed_s)

    def status(self) -> int:
        reached = self.servo.at_rest if self.halted else self._reached.reached
        return TARGET_REACHED * reached | BIT_12 * self._stopped.reached
