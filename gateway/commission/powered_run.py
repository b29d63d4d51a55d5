"""A run under power: a thread of its own leads one drive up, lets it act, and always ends with it disabled.

Whoever started it says again and again that STOP is in reach (`keep`). Where that stays away, where a stop is
asked for, and where anything is not as it was foreseen, the drive is stopped and its power taken, both as its
statusword confirms. The thread is no daemon: a program that ends waits for that.
"""

import concurrent.futures
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TypeVar

from drivers.bus.sender import always
from drivers.errors import DriverError
from drivers.joint import homing
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import WAY_UP
from drivers.joint.power import LIMP_STATES, RESET_S
from drivers.joint.quick_stop import StopOutcome
from gateway.commission.power import Power

T = TypeVar("T")

TICK_S = 0.02
KEEP_S = 1.0  # without a word from whoever has STOP in reach
STOP_S = 3.0  # for a stop to be answered
OUT_OF_REACH = "nobody has STOP in reach any more"
OFF = LIMP_STATES  # what confirms that the axis has no power


@dataclass(frozen=True, slots=True)
class PoweredRunResult:
    """Result of the run. `off` is whether the drive has confirmed that it has no power."""

    problem: str | None
    off: bool
    state: str
    before: int | None = None  # counts where it was when the homing was begun
    after: int | None = None  # counts where home was reached

    @property
    def text(self) -> str:
        """State of the drive in words."""
        if self.off:
            return f"the drive is stopped and disabled, as its statusword says ({self.state})"
        return f"the drive has NOT confirmed that it is disabled ({self.state}): press the emergency stop"


class NotStopped(Exception):
    """A drive has not confirmed that it is disabled."""


class RunEnded(Exception):
    """The run must end; with the reason."""


class PoweredRun:
    """Between `start` and `end`. `said` are words of how far it is.

    Who derives from it says what is written before the drive is enabled (`_set_up`), in which modes of
    operation it is enabled without a setpoint (`still_in`), and what it does then (`_act`).
    """

    name = "powered run"
    still_in: tuple[int, ...] = ()

    def __init__(self, power: Power) -> None:
        self.said = "the drive is led up"
        self._power = power
        self._why: str | None = None  # to stop
        self._kept = time.monotonic()
        self._before: int | None = None
        self._after: int | None = None
        self._outcome = PoweredRunResult("it was not begun", off=True, state="not asked for anything")
        self._thread = threading.Thread(target=self._run, name=self.name, daemon=False)

    @property
    def done(self) -> bool:
        return not self._thread.is_alive()

    def start(self) -> None:
        self._kept = time.monotonic()
        self._thread.start()

    def keep(self) -> None:
        """Note that somebody has STOP in reach now. A gap that was too long ends it: nobody saw what came."""
        now = time.monotonic()
        if now - self._kept > KEEP_S:
            self.stop(OUT_OF_REACH)
        self._kept = now

    def stop(self, why: str) -> None:
        """End it now; the first reason counts."""
        self._why = self._why or why

    def end(self) -> PoweredRunResult:
        """Stop it where it goes on, and wait until the drive is disabled, or did not confirm that in time."""
        while True:
            try:
                while not self.done:
                    self.stop("it was given up")
                    self._thread.join()
                return self._outcome
            except KeyboardInterrupt:
                continue  # that is what is being done

    # In the thread.

    def _run(self) -> None:
        problem: str | None = "internal error"
        self._outcome = PoweredRunResult(problem, off=False, state="not read")
        mode: bytes | None = None
        try:
            mode = self._wait(self._power.drive.ask(homing.mode_of))
            self._ready()
            self._set_up()
            self._enable()
            self._act()
            problem = None
        except (RunEnded, DriverError) as error:
            problem = str(error)
        except Exception as error:  # noqa: BLE001 - whatever it is, the drive is stopped
            problem = f"internal error: {type(error).__name__}: {error}"
        finally:
            off, state = self._disable()
            if off and mode is not None:
                left = (self._leave(mode), self._restore())
                problem = "; ".join(one for one in (problem, *left) if one) or None
            self._outcome = PoweredRunResult(problem, off, state, self._before, self._after)

    def _set_up(self) -> None:
        """Write the prerequisites, while the drive has no power."""
        raise NotImplementedError

    def _act(self) -> None:
        """Do the work under power; return when it is over."""
        raise NotImplementedError

    def _restore(self) -> str | None:
        """Give the drive back what it had, without power; what is not as it was, in words."""
        return None

    def _ready(self) -> None:
        """Check that powering up may begin; raises `RunEnded`."""
        led = self._wait(self._power.drive.look())
        if led.problem is not None:
            raise RunEnded(led.problem)
        if led.state not in WAY_UP:
            raise RunEnded(f"the drive is in {'no known state' if led.state is None else led.state.words}")

    def _enable(self) -> None:
        """Enable the drive: one transition at a time, each confirmed, as long as nothing prevents it."""
        for origin in WAY_UP:
            led = self._wait(self._power.drive.step_up(origin, self._wanted, self.still_in))
            if led.problem is not None:
                raise RunEnded(f"the drive could not be enabled: {led.problem} (is its STO released?)")

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

    def _asked(self, ask: "Callable[[], Future[T]]", within_s: float = RESET_S + STOP_S) -> T | None:
        """Return its answer; `None` where there is none in time. Our heartbeat goes on meanwhile."""
        try:
            future = ask()
            until = time.monotonic() + within_s
            while not future.done() and time.monotonic() < until:
                self._power.heartbeat.feed()
                concurrent.futures.wait([future], TICK_S)
            return future.result(0)
        except Exception:  # noqa: BLE001 - the next way to stop it is tried all the same
            return None

    def _leave(self, mode: bytes) -> str | None:
        """Return the mode that it had before."""
        try:
            self._power.drive.ask(lambda axis: homing.leave(axis, mode)).result(STOP_S)
        except (DriverError, TimeoutError) as error:
            return f"it is disabled, and still in another mode: {error}"
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
            raise RunEnded(why)
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
