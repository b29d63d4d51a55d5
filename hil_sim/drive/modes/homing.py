"""Homing: find where the joint is by switches and the encoder's index (CiA 402-2 §11).

The home position then counts as 607Ch, in method 37 and in every other.
"""

from enum import Enum

from hil_sim.drive import objects as od
from hil_sim.drive.modes.mode import BIT_12, BIT_13, TARGET_REACHED, Mode
from hil_sim.drive.modes.searching import METHODS, Search, Seeking
from hil_sim.drive.options import Ramp

START = 1 << 4  # of the controlword
NO_METHOD = 0


class _State(Enum):
    IDLE = TARGET_REACHED  # not started, or interrupted
    SEARCHING = 0
    ATTAINED = BIT_12  # home is known, the joint comes to rest
    COMPLETE = BIT_12 | TARGET_REACHED
    FAILED = BIT_13


class Homing(Mode):
    """Runs the searches of the method one after the other, from the rising edge of bit 4."""

    follows_position = True

    def enter(self) -> None:
        super().enter()
        self._state = _State.IDLE
        self._left: list[Search] = []
        self._seeking: Seeking | None = None

    def command(self, controlword: int, risen: int) -> None:
        super().command(controlword, risen)
        if risen & START and not self.halted:
            self._start()
        elif not controlword & START and self._state is _State.SEARCHING:
            self.halt()

    def halt(self) -> None:
        super().halt()
        if self._state is _State.SEARCHING:
            self._state = _State.IDLE

    def _start(self) -> None:
        method = self.objects.number(od.HOMING_METHOD)
        if method not in METHODS:
            self._state = _State.FAILED
            return
        self._state = _State.SEARCHING
        self.servo.hold()
        self._left = METHODS[method].searches(self.servo.joint)
        self._next(self.servo.position)

    def _next(self, found: float) -> None:
        """Begin the next search; after the last one `found` is home."""
        if self._left:
            self._seeking = Seeking(self.servo, self._left.pop(0))
            self.servo.motion = self._seeking
            return
        self.servo.stop(Ramp.SLOW_DOWN)
        self.servo.home(self.servo.settings.home_offset - found)
        self._state = _State.ATTAINED

    def update(self, elapsed_s: float) -> None:  # noqa: ARG002 - the shape of a mode
        seeking = self._seeking
        if self._state is _State.SEARCHING and seeking is not None:
            if seeking.found is not None:
                self._next(seeking.found)
            elif seeking.blocked:
                self.servo.stop(Ramp.QUICK_STOP)
                self._state = _State.FAILED
        elif self._state is _State.ATTAINED and self.servo.at_rest:
            self._state = _State.COMPLETE

    def status(self) -> int:
        resting = TARGET_REACHED if self._state is _State.FAILED and self.servo.at_rest else 0
        return self._state.value | resting
