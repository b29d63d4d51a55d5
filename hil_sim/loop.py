"""The one loop: lets simulated time follow real time, and serves the doors to the outside in between."""

import os
import selectors
import socket
import time
from collections.abc import Callable

from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock

# Real time passes in steps of so long: what happens in one is handled in one go, at its end. SYNC's periods
# are multiples of it, so that SYNC always comes at the same place of a step, and evenly.
_STEP_NS = 500_000
# A machine that slept, or had no time for us, does not make the robot rush through what it missed.
_CATCH_UP_NS = 200 * MILLISECOND_NS
_LONGEST_WAIT_NS = _CATCH_UP_NS / 2  # where little happens, waiting for it is not missing it
_FAST_SLICE_NS = 10 * MILLISECOND_NS


class Loop:
    """Runs `clock`; `speed` is simulated over real time, `None` as fast as it goes.

    Used by one thread; only `stop` may be called by others, and by signal handlers.
    """

    def __init__(self, clock: Clock, speed: float | None = 1.0) -> None:
        self.clock = clock
        self.speed = speed
        self.skipped_ns = 0  # simulated, left out because it came too late
        self._step_ns = round(_STEP_NS * (speed or 1.0))
        self._selector = (
            selectors.SelectSelector()
        )  # it waits to the microsecond; others in whole milliseconds
        self._each_turn: list[Callable[[], None]] = []
        self._stopped = False
        self._late_ns = 0
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._selector.register(self._wake, selectors.EVENT_READ, lambda _: os.eventfd_read(self._wake))

    def watch(self, file: socket.socket | int, events: int, ready: Callable[[int], object]) -> None:
        """Call `ready` with the events that `file` shows; a second call changes the events."""
        try:
            self._selector.modify(file, events, ready)
        except KeyError:
            self._selector.register(file, events, ready)

    def forget(self, file: socket.socket | int) -> None:
        self._selector.unregister(file)

    def each_turn(self, action: Callable[[], None]) -> None:
        """Call `action` after simulated events, before waiting."""
        self._each_turn.append(action)

    def stop(self) -> None:
        """End `run` soon; from any thread."""
        self._stopped = True
        os.eventfd_write(self._wake, 1)

    def close(self) -> None:
        self._selector.close()
        os.close(self._wake)

    def take_late_ns(self) -> int:
        """Return by how much the latest event since the last call came late, with what was left out."""
        late_ns, self._late_ns = self._late_ns, 0
        return late_ns

    def run(self, until_ns: int | None = None) -> None:
        """Run until `stop`, or until simulated time reaches `until_ns`."""
        self._anchor(self.clock.now_ns)
        while not self._stopped and (until_ns is None or self.clock.now_ns < until_ns):
            target = self._target_ns()
            self._note_late(target)
            self.clock.run_until(target if until_ns is None else min(target, until_ns))
            for action in self._each_turn:
                action()
            for key, events in self._selector.select(self._wait_s()):
                key.data(events)

    def _anchor(self, simulated_ns: int) -> None:
        self._real_start_ns = time.monotonic_ns()
        self._simulated_start_ns = simulated_ns - simulated_ns % self._step_ns

    def _target_ns(self) -> int:
        """Return the simulated time that should be reached now."""
        now_ns = self.clock.now_ns
        if self.speed is None:
            return now_ns + _FAST_SLICE_NS
        elapsed_ns = time.monotonic_ns() - self._real_start_ns
        target = self._simulated_start_ns + round(elapsed_ns * self.speed)
        if target - now_ns > _CATCH_UP_NS * max(self.speed, 1.0):
            self.skipped_ns += target - now_ns
            self._late_ns += target - now_ns
            self._anchor(now_ns)
            return now_ns
        return target - (target - self._simulated_start_ns) % self._step_ns

    def _note_late(self, target_ns: int) -> None:
        due_ns = self.clock.next_due_ns()
        if due_ns is not None and self.speed is not None:
            self._late_ns = max(self._late_ns, target_ns - due_ns)

    def _wait_s(self) -> float | None:
        if self.speed is None:
            return 0.0
        due_ns = self.clock.next_due_ns()
        if due_ns is None:
            return None
        steps = -((self._simulated_start_ns - due_ns) // self._step_ns)
        wake_ns = self._real_start_ns + round(steps * self._step_ns / self.speed)
        return min(max(wake_ns - time.monotonic_ns(), 0), _LONGEST_WAIT_NS) / SECOND_NS
