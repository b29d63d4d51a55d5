"""Profile position: set-points with a handshake, one under way and one waiting (CiA 402-2 §10)."""

from hil_sim.drive import objects as od
from hil_sim.drive.modes.mode import BIT_12, TARGET_REACHED, Dwell, Mode
from hil_sim.drive.motion import Profile

# Bits of the controlword.
NEW_SETPOINT = 1 << 4
CHANGE_IMMEDIATELY = 1 << 5
RELATIVE = 1 << 6
CHANGE_ON_SETPOINT = 1 << 9


class ProfilePosition(Mode):
    """Each set-point is a trapezoid of velocity; a relative one counts from the set-point before it."""

    follows_position = True

    def enter(self) -> None:
        super().enter()
        self._acknowledged = False
        self._waiting: Profile | None = None
        self._target = self.servo.reference.position
        self._now: Profile | None = None
        self._arrival = Dwell()

    def command(self, controlword: int, risen: int) -> None:
        super().command(controlword, risen)
        immediately = bool(controlword & CHANGE_IMMEDIATELY)
        if risen & NEW_SETPOINT and (immediately or self._waiting is None):
            self._take(controlword, immediately)
        self._acknowledged = bool(controlword & NEW_SETPOINT)

    def _take(self, controlword: int, immediately: bool) -> None:
        profile = self._profile(bool(controlword & RELATIVE))
        if immediately or self._now is None or self._now.done:
            self._waiting = None
            self._start(profile)
        else:
            self._waiting = profile
            self._now.through = bool(controlword & CHANGE_ON_SETPOINT)

    def _profile(self, relative: bool) -> Profile:
        settings = self.servo.settings
        wanted = self.objects.number(od.TARGET_POSITION) / settings.counts_per_radian
        if relative:
            wanted += self._target
        self._target = min(max(wanted, settings.low_limit), settings.high_limit)
        self.clipped = self._target != wanted
        return Profile(self._target, settings.profile_velocity, settings.acceleration, settings.deceleration)

    def _start(self, profile: Profile) -> None:
        self._now = profile
        self._arrival.restart()
        if not self.halted:
            self.servo.motion = profile

    def resume(self) -> None:
        self.servo.hold()
        if self._now is not None:
            self.servo.motion = self._now

    def update(self, elapsed_s: float) -> None:
        if self._now is None or self.halted:
            return
        if self._now.done and self._waiting is not None:
            profile, self._waiting = self._waiting, None
            self._start(profile)
        if self._now.done:
            error = self._now.target - self.servo.position
            self._arrival.update(error, self.servo.settings.position_window, elapsed_s)

    def status(self) -> int:
        arrived = self.servo.at_rest if self.halted or self._now is None else self._arrival.reached
        acknowledged = self._acknowledged or self._waiting is not None
        return TARGET_REACHED * arrived | BIT_12 * acknowledged
