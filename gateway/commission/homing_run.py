"""One homing under way: a thread of its own leads the drive up, follows it, and always ends with it disabled.

Whoever started it says again and again that STOP is in reach (`keep`). Where that stays away, where a stop is
asked for, and where anything is not as it was foreseen, the drive is stopped and its power taken, both as its
statusword confirms. The thread is no daemon: a program that ends waits for that.
"""

import concurrent.futures
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TypeVar

from drivers.bus.sender import always
from drivers.errors import DriverError
from drivers.joint import homing
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import WAY_UP
from drivers.joint.homing import Progress, Seen, Setup
from drivers.joint.power import LIMP_STATES, RESET_S
from drivers.joint.quick_stop import StopOutcome
from gateway.commission.axes import nearest
from gateway.commission.power import Power

T = TypeVar("T")

TICK_S = 0.02
KEEP_S = 1.0  # without a word from whoever has STOP in reach
SETTLED_S = 0.3  # what its statusword says of a homing before that may be of the one before
BEGIN_S = 1.0  # for a homing that was asked for to begin
REST_S = 3.0  # for the axis to come to rest when home is known
SPEED_S = 0.2  # over which a speed is measured
TOO_FAST = 2.0  # times the speed that it was given
STOP_S = 3.0  # for a stop to be answered
OUT_OF_REACH = "nobody has STOP in reach any more"
OLD_ZERO = (Progress.UNDER_WAY, Progress.NOT_STARTED)  # what a position counts from beside these
OFF = LIMP_STATES  # what confirms that the axis has no power


@dataclass(frozen=True, slots=True)
class Plan:
    """What it may do, in counts of the zero before homing."""

    setup: Setup
    low: int
    high: int
    fastest: float  # counts/s
    lag: float  # counts that it may follow behind
    time_s: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of it. `off` is whether the drive has confirmed that it has no power."""

    problem: str | None
    off: bool
    state: str
    before: int | None = None  # counts where it was when the homing was begun
    after: int | None = None  # counts where home was reached

    @property
    def text(self) -> str:
        """Of the drive now."""
        if self.off:
            return f"the drive is stopped and disabled, as its statusword says ({self.state})"
        return f"the drive has NOT confirmed that it is disabled ({self.state}): press the emergency stop"


class Ended(Exception):
    """Why it must not go on."""


class HomingRun:
    """Between `start` and `end`. `said` are words of how far it is, `moved` the counts it has gone."""

    def __init__(self, power: Power, plan: Plan) -> None:
        self.said = "the drive is led up"
        self.moved = 0
        self._power = power
        self._plan = plan
        self._why: str | None = None  # to stop
        self._kept = time.monotonic()
        self._before: int | None = None
        self._after: int | None = None
        self._progress: Progress | None = None  # at the last look
        self._way: deque[tuple[float, int]] = deque()
        self._outcome = Outcome("it was not begun", off=True, state="not asked for anything")
        self._thread = threading.Thread(target=self._run, name="homing", daemon=False)

    @property
    def done(self) -> bool:
        return not self._thread.is_alive()

    def start(self) -> None:
        self._kept = time.monotonic()
        self._thread.start()

    def keep(self) -> None:
        """Somebody has STOP in reach, now. One gap that was too long ends it: nobody saw what came in it."""
        now = time.monotonic()
        if now - self._kept > KEEP_S:
            self.stop(OUT_OF_REACH)
        self._kept = now

    def stop(self, why: str) -> None:
        """End it now; the first reason counts."""
        self._why = self._why or why

    def end(self) -> Outcome:
        """Stop it where it goes on, and wait until the drive is disabled, or did not confirm that in time."""
        while not self.done:
            self.stop("it was given up")
            try:
                self._thread.join()
            except KeyboardInterrupt:
                continue  # that is what is being done
        return self._outcome

    # In the thread.

    def _run(self) -> None:
        problem: str | None = "internal error"
        self._outcome = Outcome(problem, off=False, state="not read")
        mode: bytes | None = None
        try:
            mode = self._wait(self._power.drive.ask(homing.mode_of))
            self._set_up()
            self._enable()
            self._home()
            problem = None
        except (Ended, DriverError) as error:
            problem = str(error)
        except Exception as error:  # noqa: BLE001 - whatever it is, the drive is stopped
            problem = f"internal error: {type(error).__name__}: {error}"
        finally:
            off, state = self._disable()
            if off and mode is not None:
                problem = self._leave(mode) or problem
            self._outcome = Outcome(problem, off, state, self._before, self._after)

    def _set_up(self) -> None:
        led = self._wait(self._power.drive.look())
        if led.problem is not None:
            raise Ended(led.problem)
        if led.state not in WAY_UP:
            raise Ended(f"the drive is in {'no known state' if led.state is None else led.state.words}")
        self._wait(self._power.drive.ask(lambda axis: homing.set_up(axis, self._plan.setup)))

    def _enable(self) -> None:
        """The explicit act: one transition at a time, each confirmed, as long as nothing is in the way."""
        for origin in WAY_UP:
            led = self._wait(self._power.drive.step_up(origin, self._wanted, (homing.HOMING,)))
            if led.problem is not None:
                raise Ended(f"the drive could not be enabled: {led.problem} (is its STO released?)")

    def _home(self) -> None:
        self._before = self._wait(self._power.drive.ask(homing.look)).position
        led = self._wait(self._power.drive.home(self._wanted))
        if led.problem is not None:
            raise Ended(f"homing was not begun: {led.problem}")
        begun = time.monotonic()
        attained: float | None = None
        while True:
            seen = self._wait(self._power.drive.ask(homing.look))
            now = time.monotonic()
            self._judge(seen, now - begun)
            if seen.progress is Progress.COMPLETE and now - begun > SETTLED_S:
                # Once more: that position was read before it said so, and may count from the old zero.
                self._after = self._wait(self._power.drive.ask(homing.look)).position
                return
            if seen.progress is Progress.ATTAINED:
                attained = attained or now
                if now - attained > REST_S:
                    raise Ended("home is known, and the joint does not come to rest")
            self._rest(TICK_S)

    def _judge(self, seen: Seen, since_s: float) -> None:
        plan, progress = self._plan, seen.progress
        if seen.state is not DriveState.OPERATION_ENABLED:
            state = "no state of CiA 402" if seen.state is None else seen.state.words
            raise Ended(f"the drive has left operation by itself: {state}{self._error_code()}")
        if progress.failed and since_s > SETTLED_S:
            raise Ended(f"the drive says that homing has failed (statusword bit 13: {progress.words})")
        if progress is Progress.NOT_STARTED and since_s > BEGIN_S:
            raise Ended("the drive does not begin to home, or has interrupted it")
        if since_s > plan.time_s:
            raise Ended(f"home was not found within {plan.time_s:.0f} s")
        if seen.lag is not None and abs(seen.lag) > plan.lag:
            raise Ended(f"the joint is {abs(seen.lag)} counts behind what the drive wants (60F4h)")
        near = nearest(seen.position, self._before or 0)
        if progress in OLD_ZERO:
            if not plan.low <= near <= plan.high:
                raise Ended("the joint has left the way that was told")
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
            raise Ended(f"the joint moves at {speed:.0f} counts/s, not {self._plan.fastest:.0f} at most")

    def _error_code(self) -> str:
        try:
            code = self._power.drive.ask(lambda axis: axis.read(0x603F, 2)).result(STOP_S)
        except (DriverError, TimeoutError):
            return ""
        return f", error code {int.from_bytes(code, 'little'):04X}h (603Fh)"

    # Down, in any case.

    def _disable(self) -> tuple[bool, str]:
        """Quick stop, else no voltage, else NMT stop; then to a state without power, and read once more."""
        drive = self._power.drive
        self.said = "the drive is being stopped"
        stopped = self._asked(drive.quick_stop) is StopOutcome.CONFIRMED
        if not stopped and self._asked(drive.disable_voltage) is not StopOutcome.CONFIRMED:
            drive.nmt_stop()
        state = self._state()
        if state is not None and state not in OFF:
            self._asked(lambda: drive.reset(always))
            state = self._state()
        return state in OFF, "it does not answer" if state is None else state.words

    def _state(self) -> DriveState | None:
        led = self._asked(self._power.drive.look)
        return None if led is None else led.state

    def _asked(self, ask: "Callable[[], Future[T]]") -> T | None:
        """Its answer; `None` where there is none in time. Our heartbeat goes on meanwhile."""
        try:
            future = ask()
            until = time.monotonic() + RESET_S + STOP_S
            while not future.done() and time.monotonic() < until:
                self._power.heartbeat.feed()
                concurrent.futures.wait([future], TICK_S)
            return future.result(0)
        except Exception:  # noqa: BLE001 - the next way to stop it is tried all the same
            return None

    def _leave(self, mode: bytes) -> str | None:
        """The mode that it had before."""
        try:
            self._power.drive.ask(lambda axis: homing.leave(axis, mode)).result(STOP_S)
        except (DriverError, TimeoutError) as error:
            return f"it is disabled, and still in the mode homing: {error}"
        return None

    # Waiting.

    def _objection(self) -> str | None:
        if self._why is not None:
            return self._why
        if time.monotonic() - self._kept > KEEP_S:
            return OUT_OF_REACH
        return self._power.objection

    def _wanted(self) -> bool:
        return self._objection() is None

    def _check(self) -> None:
        if (why := self._objection()) is not None:
            raise Ended(why)
        self._power.heartbeat.feed()

    def _wait(self, future: "Future[T]") -> T:
        while not future.done():
            self._check()
            concurrent.futures.wait([future], TICK_S)
        self._check()
        return future.result()

    def _rest(self, seconds: float) -> None:
        self._check()
        threading.Event().wait(seconds)
