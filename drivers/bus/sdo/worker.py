"""One node's SDO worker: a thread that does one job after another, urgent ones first.

Two transfers to one node at a time corrupt each other, so everything that is asked of a node goes through
its worker. A job is a function that is given the channel; an urgent one interrupts what is running. What was
interrupted runs again afterwards, or goes on where it asks for that, except that a write in flight fails as
unknown. Urgent jobs are done in the order in which they were asked for, and none interrupts another.
"""

import heapq
import itertools
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from drivers.bus.sdo.channel import Interrupted, SdoChannel
from drivers.errors import Unavailable
from drivers.realtime_priority import make_realtime

T = TypeVar("T")
Job = Callable[[SdoChannel], T]
Current = Callable[[], bool]

URGENT, USUAL = 0, 1  # priorities


@dataclass(order=True, slots=True)
class _Task:
    priority: int
    number: int  # first come, first served
    job: Job[Any] = field(compare=False)
    current: Current | None = field(compare=False, default=None)
    future: Future[Any] = field(compare=False, default_factory=Future)


@dataclass(slots=True)
class _Repeated:
    period_s: float
    job: Job[Any]
    due: float
    task: _Task | None = None


class SdoWorker:
    """Does jobs between `start` and `stop`; what is asked outside of that fails with `Unavailable`."""

    def __init__(self, channel: SdoChannel) -> None:
        self.channel = channel
        self._changed = threading.Condition()
        self._tasks: list[_Task] = []
        self._repeated: list[_Repeated] = []
        self._numbers = itertools.count()
        self._running: _Task | None = None
        self._open = False
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin; idempotent."""
        with self._changed:
            if self._open:
                return
            self._open = True
        self._thread = threading.Thread(target=self._run, name=f"sdo {self.channel.label}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Fail what is left with `Unavailable`, forget what was to be repeated, and end the thread."""
        with self._changed:
            self._open = False
            self._repeated.clear()
            self.channel.interrupt()
        self.wake()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def submit(
        self,
        job: Job[T],
        *,
        urgent: bool = False,
        ahead: bytes | None = None,
        wake: bool = True,
        current: Current | None = None,
    ) -> Future[T]:
        """Do `job` when its turn comes; the future's callbacks run in the worker's thread.

        `ahead` is the first request of an urgent job: it is sent now, by the caller's thread, if no other
        urgent job has the channel. With `wake=False` the worker may not notice before `wake` is called: who
        sends requests to many nodes has no use for their threads in between. A job with `current` is long: it
        is not begun again after urgent ones but goes on, until `current` says that it has become worthless;
        then its next transfer raises `Unavailable`.
        """
        task = _Task(URGENT if urgent else USUAL, next(self._numbers), job, current)
        with self._changed:
            if not self._open:
                task.future.set_exception(self._closed())
                return task.future
            interrupts = urgent and not self._has_urgent()
            heapq.heappush(self._tasks, task)
            if wake:
                self._changed.notify()
            if interrupts:
                self.channel.interrupt(ahead)
        if urgent and wake:
            self.channel.wake()
        return task.future

    def wake(self) -> None:
        """Let the worker look what there is to do."""
        with self._changed:
            self._changed.notify()
        self.channel.wake()

    def repeat(self, period_s: float, job: Job[object]) -> Callable[[], None]:
        """Do `job` every `period_s`, never twice at once; returns how to end it. Its errors are its own.

        It goes on after urgent jobs: beside one stop after another it still gets somewhere.
        """
        repeated = _Repeated(period_s, job, time.monotonic())
        with self._changed:
            self._repeated.append(repeated)
            self._changed.notify()

        def end() -> None:
            with self._changed:
                if repeated in self._repeated:
                    self._repeated.remove(repeated)
                if repeated.task is not None:
                    repeated.task.future.cancel()  # where it only waits

        return end

    def _has_urgent(self) -> bool:
        return self._urgent_waits() or (self._running is not None and self._running.priority == URGENT)

    def _urgent_waits(self) -> bool:
        return bool(self._tasks) and self._tasks[0].priority == URGENT

    def _closed(self) -> Unavailable:
        return Unavailable(f"{self.channel.label}: its bus is not open, nothing can be asked of it")

    def _run(self) -> None:
        make_realtime()  # a stop waits for what this holds
        while (task := self._next()) is not None:
            self._do(task)
        for task in self._tasks:
            if _begin(task.future):
                task.future.set_exception(self._closed())
        self._tasks.clear()

    def _do(self, task: _Task) -> None:
        if not _begin(task.future):
            return
        try:
            result = task.job(self.channel)
        except Interrupted:
            self._put_back(task)
        except Exception as error:  # noqa: BLE001 - it belongs to whoever waits for the future
            task.future.set_exception(error)
        else:
            task.future.set_result(result)

    def _next(self) -> _Task | None:
        with self._changed:
            self._running = None
            while self._open:
                wait_s = self._queue_due()
                if self._tasks:
                    return self._give_channel(heapq.heappop(self._tasks))
                self._changed.wait(wait_s)
            return None

    def _pause(self, long: _Task) -> None:
        """Within a long job that was interrupted: do what is urgent, then let it go on."""
        while (task := self._next_urgent(long)) is not long:
            self._do(task)

    def _next_urgent(self, long: _Task) -> _Task:
        with self._changed:
            if not self._open:
                raise Interrupted
            return self._give_channel(heapq.heappop(self._tasks) if self._urgent_waits() else long)

    def _give_channel(self, task: _Task) -> _Task:
        self._running = task
        if task.current is None:
            self.channel.resume(urgent=task.priority == URGENT)
        else:
            self.channel.resume(current=task.current, pause=partial(self._pause, task))
        return task

    def _put_back(self, task: _Task) -> None:
        with self._changed:
            heapq.heappush(self._tasks, task)

    def _queue_due(self) -> float | None:
        """Queue what is to be repeated now; returns the time until the next."""
        now = time.monotonic()
        for repeated in self._repeated:
            if repeated.due <= now and (repeated.task is None or repeated.task.future.done()):
                repeated.task = _Task(USUAL, next(self._numbers), repeated.job, lambda: True)
                heapq.heappush(self._tasks, repeated.task)
                repeated.due = max(repeated.due + repeated.period_s, now)
        waiting = [r.due for r in self._repeated if r.task is None or r.task.future.done()]
        return max(0.0, min(waiting) - now) if waiting else None


def _begin(future: Future[Any]) -> bool:
    """Return whether its job is still wanted; one that was interrupted has begun already."""
    return future.running() or future.set_running_or_notify_cancel()
