"""Cyclic synchronous position, velocity and torque: the master's trajectory, sampled at each SYNC.

CiA 402-2 §14–16. After it was enabled the drive stays where it is until a target has been written; bit 12 of
the statusword says that it follows the targets.
"""

from typing import ClassVar

from hil_sim.drive import objects as od
from hil_sim.drive.modes.mode import BIT_12, Mode
from hil_sim.drive.modes.profile_velocity import within_limits
from hil_sim.drive.motion import Motion, TrackPosition, TrackTorque, TrackVelocity
from hil_sim.drive.servo import Offsets
from hil_sim.drive.settings import Control
from hil_sim.node.dictionary import Key


class Cyclic(Mode):
    """Common part of the three modes; 60B1h and 60B2h feed forward unless they offset the target."""

    target: ClassVar[Key]
    control: ClassVar[Control]

    def enter(self) -> None:
        super().enter()
        self._targeted = False
        self._closed = False

    def target_written(self, key: Key, changed: bool) -> None:  # noqa: ARG002 - the same target is one too
        self._targeted |= key == self.target

    def synchronise(self) -> None:
        if not self._targeted or self.halted:
            return
        if not self._closed:
            self._closed = True
            self.servo.use(self.control)
        self.servo.motion = self._track(self.servo.settings.interpolation_s)
        self.servo.offsets = self._offsets()

    def resume(self) -> None:
        self._closed = False

    def _track(self, period_s: float) -> Motion:
        raise NotImplementedError

    def _offsets(self) -> Offsets:
        return Offsets(self._velocity(od.VELOCITY_OFFSET), self._torque(od.TORQUE_OFFSET))

    def _velocity(self, key: Key) -> float:
        return self.objects.number(key) / self.servo.settings.counts_per_radian

    def _torque(self, key: Key) -> float:
        return self.objects.number(key) / 1000.0 * self.servo.settings.rated_torque

    def _clip(self, wanted: float, target: float) -> float:
        self.clipped = target != wanted
        return target

    def status(self) -> int:
        return BIT_12 * (not self.halted)


class CyclicPosition(Cyclic):
    """607Ah + 60B0h, within the software limits."""

    follows_position = True
    target = od.TARGET_POSITION
    control = Control.POSITION

    def _track(self, period_s: float) -> Motion:
        settings, number = self.servo.settings, self.objects.number
        wanted = (number(od.TARGET_POSITION) + number(od.POSITION_OFFSET)) / settings.counts_per_radian
        target = self._clip(wanted, min(max(wanted, settings.low_limit), settings.high_limit))
        return TrackPosition(target, period_s)


class CyclicVelocity(Cyclic):
    """60FFh + 60B1h, within the speed limits and the software range."""

    target = od.TARGET_VELOCITY
    control = Control.VELOCITY

    def _track(self, period_s: float) -> Motion:
        wanted = self._velocity(od.TARGET_VELOCITY) + self._velocity(od.VELOCITY_OFFSET)
        return TrackVelocity(self._clip(wanted, within_limits(self.servo, wanted)), period_s)

    def _offsets(self) -> Offsets:
        return Offsets(torque=self._torque(od.TORQUE_OFFSET))


class CyclicTorque(Cyclic):
    """6071h + 60B2h, within the torque limits."""

    target = od.TARGET_TORQUE
    control = Control.TORQUE

    def _track(self, period_s: float) -> Motion:
        settings = self.servo.settings
        wanted = self._torque(od.TARGET_TORQUE) + self._torque(od.TORQUE_OFFSET)
        target = min(max(wanted, settings.lowest_torque), settings.highest_torque)
        return TrackTorque(self._clip(wanted, target), period_s)

    def _offsets(self) -> Offsets:
        return Offsets()
