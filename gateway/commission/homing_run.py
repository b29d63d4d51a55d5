"""One homing under way: what is written before it, and how it is followed until home is found."""

import time
from collections import deque
from dataclasses import dataclass

from drivers.joint import homing
from drivers.joint.cia402 import DriveState
from drivers.joint.homing import AxisReading, HomingProgress, Setup
from gateway.commission.axes import nearest
from gateway.commission.power import Power
from gateway.commission.powered_run import TICK_S, PoweredRun, RunEnded

SETTLED_S = 0.3  # what its statusword says of a homing before that may be of the one before
BEGIN_S = 1.0  # for a homing that was asked for to begin
REST_S = 3.0  # for the axis to come to rest when home is known
SPEED_S = 0.2  # over which a speed is measured
TOO_FAST = 2.0  # times the speed that it was given
OLD_ZERO = (HomingProgress.UNDER_WAY, HomingProgress.NOT_STARTED)  # what a position counts from beside these


@dataclass(frozen=True, slots=True)
class HomingLimits:
    """Limits of homing, in counts of the zero before."""

    setup: Setup
    low: int
    high: int
    fastest: float  # counts/s
    lag: float  # counts that it may follow behind
    time_s: float


class HomingRun(PoweredRun):
    """Between `start` and `end`; `moved` are the counts it has gone."""

    name = "homing"
    still_in = (homing.HOMING,)

    def __init__(self, power: Power, plan: HomingLimits) -> None:
        super().__init__(power)
        self.moved = 0
        self._plan = plan
        self._progress: HomingProgress | None = None  # at the last look
        self._way: deque[tuple[float, int]] = deque()

    def _set_up(self) -> None:
        self._wait(self._power.drive.ask(lambda axis: homing.set_up(axis, self._plan.setup)))

    def _act(self) -> None:
        self._before = self._wait(self._power.drive.ask(homing.look)).position
        led = self._wait(self._power.drive.home(self._wanted))
        if led.problem is not None:
            raise RunEnded(f"homing was not begun: {led.problem}")
        begun = time.monotonic()
        attained: float | None = None
        while True:
            seen = self._wait(self._power.drive.ask(homing.look))
            now = time.monotonic()
            self._judge(seen, now - begun)
            if seen.progress is HomingProgress.COMPLETE and now - begun > SETTLED_S:
                # Once more: that position was read before it said so, and may count from the old zero.
                self._after = self._wait(self._power.drive.ask(homing.look)).position
                return
            if seen.progress is HomingProgress.ATTAINED:
                attained = attained or now
                if now - attained > REST_S:
                    raise RunEnded("home is known, and the joint does not come to rest")
            self._rest(TICK_S)

    def _judge(self, seen: AxisReading, since_s: float) -> None:
        plan, progress = self._plan, seen.progress
        if seen.state is not DriveState.OPERATION_ENABLED:
            state = "no state of CiA 402" if seen.state is None else seen.state.words
            raise RunEnded(f"the drive has left operation by itself: {state}{self._error_code()}")
        if progress.failed and since_s > SETTLED_S:
            raise RunEnded(f"the drive says that homing has failed (statusword bit 13: {progress.words})")
        if progress is HomingProgress.NOT_STARTED and since_s > BEGIN_S:
            raise RunEnded("the drive does not begin to home, or has interrupted it")
        if since_s > plan.time_s:
            raise RunEnded(f"home was not found within {plan.time_s:.0f} s")
        if seen.lag is not None and abs(seen.lag) > plan.lag:
            raise RunEnded(f"the joint is {abs(seen.lag)} counts behind what the drive wants (60F4h)")
        near = nearest(seen.position, self._before or 0)
        if progress in OLD_ZERO:
            if not plan.low <= near <= plan.high:
                raise RunEnded("the joint has left the way that was told")
            self.said, self.moved = "it looks for home", near - (self._before or 0)
        if progress is self._progress:
            self._judge_speed(near)
        else:  # its position may count from another zero now, from the next look on
            self._progress = progress
            self._way.clear()

    def _judge_speed(self, position: int) -> None:
        """Units that were misread show here."""
        now = time.monotonic()
        self._way.append((now, position))
        first, was = self._way[0]
        if now - first < SPEED_S:
            return
        self._way.popleft()
        speed = abs(position - was) / (now - first)
        if speed > TOO_FAST * self._plan.fastest:
            raise RunEnded(f"the joint moves at {speed:.0f} counts/s, not {self._plan.fastest:.0f} at most")
