"""A loop: sockets, timers, callbacks from other threads. Idle, it sleeps in one call."""

import contextlib
import heapq
import itertools
import logging
import os
import select
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

log = logging.getLogger(__name__)

# What a file can be watched for; that its peer is gone is told in any case.
READ, WRITE, HANGUP = select.POLLIN, select.POLLOUT, select.POLLHUP | select.POLLERR

FEW_TIMERS = 256
TIMERS_NS = 5_000_000  # what the timers of one turn may take; those that are left follow in the next

Callback = Callable[[], object]


class Timer:
    """A callback that runs once, unless cancelled before."""

    __slots__ = ("callback",)

    def __init__(self, callback: Callback) -> None:
        self.callback: Callback | None = callback

    def cancel(self) -> None:
        self.callback = None


class Poll:
    """Interface of `select.epoll`, for systems without it."""

    def __init__(self) -> None:
        poll = select.poll()
        self.register, self.modify, self.unregister = poll.register, poll.modify, poll.unregister
        self._poll = poll.poll

    def poll(self, timeout: float | None = None) -> list[tuple[int, int]]:
        return self._poll(None if timeout is None else timeout * 1000)

    def close(self) -> None:
        """Do nothing."""


_POLL: Callable[[], Any] = getattr(select, "epoll", Poll)


class Loop:
    """Waits in one system call for sockets, timers and callbacks from other threads.

    Everything but `post` and `stop` belongs to the thread that runs the loop. A callback that raises is
    logged and does not end the loop: one client's trouble is not another's.
    """

    def __init__(self) -> None:
        self._poll = _POLL()
        self._watched: dict[int, tuple[int, Callable[[int], object]]] = {}
        self._ready: deque[Callback] = deque()
        self._timers: list[tuple[int, int, Timer]] = []
        self._many = FEW_TIMERS  # so many timers that the cancelled ones are looked for
        self._order = itertools.count()
        self.turns = 0  # so far
        self._stopping = False
        self._woken = False
        self._thread: int | None = None
        self._wake_reader, self.wake_writer = os.pipe()
        os.set_blocking(self._wake_reader, False)
        os.set_blocking(self.wake_writer, False)
        self.watch(self._wake_reader, READ, lambda _events: self._drain())

    def watch(self, file: Any, events: int, callback: Callable[[int], object]) -> None:
        """Call `callback(events)` when `file` is ready for one of `events`; no events ends it."""
        descriptor = file if isinstance(file, int) else file.fileno()
        before = self._watched.get(descriptor)
        if not events:
            if self._watched.pop(descriptor, None) is not None:
                self._poll.unregister(descriptor)
            return
        self._watched[descriptor] = events, callback
        if before is None:
            self._poll.register(descriptor, events)
        elif before[0] != events:
            self._poll.modify(descriptor, events)

    def post(self, callback: Callback) -> None:
        """Run `callback` in the loop's next turn; may be called from any thread."""
        self._ready.append(callback)
        # The order matters: a loop that clears the flag after this append also sees the append.
        if not self._woken and threading.get_ident() != self._thread:
            self._wake()

    def call(self, callback: Callback) -> None:
        """Run `callback` in the loop: at once when this is its thread, else in its next turn."""
        if threading.get_ident() == self._thread:
            self._call(callback)
        else:
            self.post(callback)

    def call_later(self, delay_s: float, callback: Callback) -> Timer:
        """Run `callback` once after `delay_s`."""
        timer = Timer(callback)
        if len(self._timers) > self._many:
            self._forget_cancelled()
        due_ns = time.monotonic_ns() + max(0, round(delay_s * 1e9))
        heapq.heappush(self._timers, (due_ns, next(self._order), timer))
        return timer

    def _forget_cancelled(self) -> None:
        """Remove cancelled timers, so that they never outnumber the others."""
        self._timers = [one for one in self._timers if one[2].callback is not None]
        heapq.heapify(self._timers)
        self._many = max(FEW_TIMERS, 2 * len(self._timers))

    def stop(self) -> None:
        """Let `run` return after its turn; may be called from any thread."""
        self._stopping = True
        self._wake()

    def run(self) -> None:
        """Serve until `stop`."""
        self._thread = threading.get_ident()
        while not self._stopping:
            self._turn()

    def close(self) -> None:
        """Give the descriptors back; what is posted later wakes nobody, as they may be others' by then."""
        self._woken = True
        self._poll.close()
        os.close(self._wake_reader)
        os.close(self.wake_writer)

    def _turn(self) -> None:
        self.turns += 1
        for descriptor, found in self._poll.poll(self._patience_s()):
            watched = self._watched.get(descriptor)
            if watched is not None:
                self._call(watched[1], found)
        now_ns = time.monotonic_ns()
        until_ns = now_ns + TIMERS_NS
        while self._timers and self._timers[0][0] <= now_ns and time.monotonic_ns() < until_ns:
            callback = heapq.heappop(self._timers)[2].callback
            if callback is not None:
                self._call(callback)
        # Only what is there now: what these callbacks post waits until the sockets were looked at again.
        for _ in range(len(self._ready)):
            self._call(self._ready.popleft())

    def _patience_s(self) -> float | None:
        if self._ready:
            return 0.0
        while self._timers and self._timers[0][2].callback is None:
            heapq.heappop(self._timers)
        if not self._timers:
            return None
        return max(0, self._timers[0][0] - time.monotonic_ns()) / 1e9

    def _wake(self) -> None:
        self._woken = True
        with contextlib.suppress(BlockingIOError):  # full of wake-ups already
            os.write(self.wake_writer, b"\0")

    def _drain(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self._wake_reader, 4096)  # what is left wakes it again
        # Only now: a flag cleared before reading could stay set for a byte that was read with the others,
        # and nobody would wake the loop again.
        self._woken = False

    @staticmethod
    def _call(callback: Callable[..., object], *args: object) -> None:
        try:
            callback(*args)
        except Exception:  # the loop outlives every callback's error
            log.exception("a callback of the gateway failed")
