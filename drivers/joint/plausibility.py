"""Plausibility of a joint: a frozen encoder, a jump, torque without motion, a wrong sign.

Judged is what is sampled anyway, some 20 times a second. Nothing that moves says nothing: a joint that stands
in a standing wearer is never wrong.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from drivers.findings import FindingState, active_findings
from drivers.joint.mirror_check import MirrorCheck
from drivers.samples import Finding

FROZEN_S = 0.5
TARGET_MOVED = math.radians(3.0)  # what the target moves by while the position stays the same to the count
MOVING = 0.1  # rad/s that the velocity says on average meanwhile
VELOCITY_S = 1.0  # over so long

JUMP = math.radians(1.5)  # beyond what the speed before and after, and a jerk in between, explain
FASTEST = 10.0  # rad/s where the drive does not tell its velocity, or nobody has looked
JERK = 15.0  # rad/s² by which a joint may have started and stopped in between
MARGIN = 1.5  # of a speed in between over those before and after
LATE_S = 0.05  # by which a sample's stamp may be wrong
LONGEST_STEP_S = 0.1  # between two samples, over which their speeds say how far it went
JUMP_SHOWN_S = 30.0

LOADED_S = 5.0
STILL = math.radians(0.3)
LOADED_SHARE, ALONE_SHARE = 0.5, 1.0  # of the rated torque, with and without a following error that says more
BEHIND = math.radians(2.0)
POSITION_MODES = frozenset({1, 7, 8})  # in which a drive follows a position (6061h)
HOMING = 6
UNSEEN_S = 1.5  # without a sample: nobody knows what was then, so nothing is known to have lasted

_ENCODER = "check its encoder and the encoder's cable"


@dataclass(frozen=True, slots=True)
class Motion:
    """A joint's newest values in SI units; `None` is not known."""

    stamp_ns: int  # of the position
    position: float
    velocity: float | None
    torque: float | None
    following_error: float | None
    mode: int | None  # of operation (6061h)
    enabled: bool


class FrozenCheck(FindingState):
    """The position stays the same to the count although the joint is moved, or is to move."""

    def __init__(self) -> None:
        super().__init__()
        self._start: Motion | None = None
        self._target = (0.0, 0.0)  # lowest and highest following error meanwhile
        self._restart_velocity(0)

    def restart(self) -> None:
        self.clear()
        self._start = None

    def update(self, now: Motion) -> None:
        start = self._start
        if start is None or now.position != start.position:
            self.clear()
            self._begin(now)
        elif self.finding is None and (now.mode, now.enabled) != (start.mode, start.enabled):
            self._begin(now)
        elif self.finding is None and now.enabled:
            self._follow(now, start)

    def _begin(self, now: Motion) -> None:
        self._start = now
        self._target = (math.inf, -math.inf)
        self._restart_velocity(now.stamp_ns)

    def _restart_velocity(self, stamp_ns: int) -> None:
        self._moved, self._moved_since_ns, self._last_ns = 0.0, stamp_ns, stamp_ns

    def _follow(self, now: Motion, start: Motion) -> None:
        if now.following_error is not None and now.mode in POSITION_MODES:
            low, high = self._target
            self._target = min(low, now.following_error), max(high, now.following_error)
        if now.velocity is not None:
            self._moved += now.velocity * (now.stamp_ns - self._last_ns) / 1e9
        self._last_ns = now.stamp_ns
        measured_s = (now.stamp_ns - self._moved_since_ns) / 1e9
        if now.stamp_ns - start.stamp_ns >= FROZEN_S * 1e9:
            self._judge(start.stamp_ns, measured_s)
        if measured_s >= VELOCITY_S:
            self._restart_velocity(now.stamp_ns)

    def _judge(self, since_ns: int, measured_s: float) -> None:
        low, high = self._target
        check = f"{_ENCODER}, and that the joint can move"
        if high - low >= TARGET_MOVED:
            moved = math.degrees(high - low)
            self.note(
                since_ns,
                f"its position stays the same to the count while its target moves by {moved:.0f}°",
                check,
            )
        elif measured_s >= VELOCITY_S and abs(self._moved) >= MOVING * measured_s:
            speed = abs(self._moved) / measured_s
            self.note(
                since_ns,
                f"its position stays the same to the count while it turns at {speed:.2g} rad/s",
                check,
            )


class JumpCheck(FindingState):
    """The position changes from one sample to the next by more than the joint's speed explains.

    Across a gap in sampling, ours or the drive's, nobody knows its speed: what it can have gone at its
    fastest is no jump then.
    """

    def __init__(self) -> None:
        super().__init__()
        self.was_gap = False  # whether only that has kept the last step from being told as a jump
        self._before: Motion | None = None
        self._is_across = False
        self._jumped_ns = 0

    def restart(self) -> None:
        self.clear()
        self._before = None

    def skip(self) -> None:
        """Skip a time in which nobody saw how it went; what was found stays."""
        self._is_across = True

    def update(self, now: Motion) -> None:
        before, self._before = self._before, now
        across, self._is_across, self.was_gap = self._is_across, False, False
        if self.finding is not None and now.stamp_ns - self._jumped_ns > JUMP_SHOWN_S * 1e9:
            self.clear()
        if before is None or HOMING in (before.mode, now.mode):
            return
        step_s = (now.stamp_ns - before.stamp_ns) / 1e9
        if not 0.0 < step_s <= UNSEEN_S:
            return
        step = now.position - before.position
        way = math.copysign(1.0, step)
        usual = JUMP + JERK * step_s**2 / 4 + _explained(before, now, way, step_s)
        is_unseen = across or step_s > LONGEST_STEP_S
        most = max(usual, JUMP + FASTEST * step_s) if is_unseen else usual
        self.was_gap = across and usual < abs(step) <= most
        if abs(step) > most:
            self._jumped_ns = now.stamp_ns
            jump = f"{abs(math.degrees(step)):.1f}° within {step_s * 1e3:.0f} ms"
            self.note(
                now.stamp_ns,
                f"its position jumped by {jump}, which is not its speed",
                f"{_ENCODER}, and home it again",
            )


def _explained(before: Motion, now: Motion, way: float, step_s: float) -> float:
    """Return the longest way between two samples by their speeds; `way` is the change of the position.

    Less than nothing where it went the other way: a drive pulls back what only its encoder has done.
    """
    if before.velocity is None or now.velocity is None:
        return FASTEST * (step_s + LATE_S)
    along = max(way * before.velocity, way * now.velocity, 0.0)
    back = min(way * (before.velocity + now.velocity) / 2, 0.0)
    return MARGIN * along * (step_s + LATE_S) + back * step_s / 2


class LoadedCheck(FindingState):
    """High torque for a long time without motion: the joint is blocked, or its encoder does not tell."""

    def __init__(self) -> None:
        super().__init__()
        self.rated: float | None = None  # N·m at the joint
        self._start: Motion | None = None

    def restart(self) -> None:
        self.clear()
        self._start = None

    def update(self, now: Motion) -> None:
        if not self._is_loaded(now):
            self.restart()
            return
        start = self._start
        if start is None or abs(now.position - start.position) > STILL:
            self.restart()
            self._start = now
        elif now.stamp_ns - start.stamp_ns >= LOADED_S * 1e9:
            self.note(
                start.stamp_ns,
                f"torque without motion ({abs(now.torque or 0.0):.0f} N·m)",
                "check that the joint can move and its encoder",
            )

    def _is_loaded(self, now: Motion) -> bool:
        if self.rated is None or now.torque is None or not now.enabled:
            return False
        if now.following_error is None or now.mode not in POSITION_MODES:
            return abs(now.torque) >= ALONE_SHARE * self.rated
        return abs(now.torque) >= LOADED_SHARE * self.rated and abs(now.following_error) >= BEHIND


class JointCheck:
    """Watches one joint; the other leg's is `None` where there is none, or its position is not known now."""

    def __init__(self, name: str) -> None:
        self.loaded = LoadedCheck()
        self.mirror: MirrorCheck | None = None
        self._name = name
        self._jump = JumpCheck()
        self._own: tuple[FrozenCheck, JumpCheck, LoadedCheck] = (FrozenCheck(), self._jump, self.loaded)
        self._last_ns = 0

    def compare_with(self, other: str) -> None:
        """Judge it against the same joint of the other leg too."""
        self.mirror = MirrorCheck(self._name, other)

    def restart(self) -> None:
        """Forget everything seen before the drive's restart."""
        for check in self._own:
            check.restart()
        if self.mirror is not None:
            self.mirror.restart()

    def skip(self) -> None:
        """Forget the motion until now: samples may have waited, or nobody has looked."""
        self._jump.skip()

    @property
    def was_gap(self) -> bool:
        """Whether only a gap in sampling explains where the joint is now."""
        return self._jump.was_gap

    def update(self, now: Motion, other: Callable[[], float | None]) -> None:
        """Take the present values; a position as old as the last one is ignored."""
        if now.stamp_ns == self._last_ns:
            self._jump.was_gap = False
            return
        unseen_ns, self._last_ns = now.stamp_ns - self._last_ns, now.stamp_ns
        for check in self._own:
            if unseen_ns > UNSEEN_S * 1e9 and check.finding is None:
                check.restart()
            check.update(now)
        if self.mirror is not None and (position := other()) is not None:
            self.mirror.update(now.stamp_ns, now.position, position)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Problems, with what to check."""
        return active_findings(self._own if self.mirror is None else (*self._own, self.mirror))
