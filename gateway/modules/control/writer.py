"""The thread in which everything is written: one job after another, what is more urgent first.

A job that takes long lets what is more urgent pass, in the middle of it.
"""

import heapq
import itertools
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, TypeVar

from gateway.process.futures import failed
from gateway.wire.framing import ErrorKind, refuse

T = TypeVar("T")


class Turn(IntEnum):
    """Priority of jobs; first come, first served among equals."""

    CLAIM = 0  # what a stop has set
    TRIAL = 1  # confirmed, or taken back
    WRITE = 2


@dataclass(order=True, slots=True)
class _Job:
    turn: Turn
    number: int
    work: Callable[[], Any] = field(compare=False)
    future: Future[Any] = field(compare=False, default_factory=Future)

    def do(self) -> None:
        try:
            done = self.work()
        except Exception as error:  # noqa: BLE001 - it belongs to whoever waits for the future
            self.future.set_exception(error)
        else:
            self.future.set_result(done)


class Writer:
    """Begins with its first job. Any thread may submit."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._jobs: list[_Job] = []
        self._numbers = itertools.count()
        self._thread: threading.Thread | None = None
        self._closed = False

    def submit(self, work: Callable[[], T], turn: Turn) -> "Future[T]":
        """Do it when its turn comes; the future's callbacks run in the writer's thread."""
        with self._changed:
            if self._closed:
                return failed(refuse(ErrorKind.UNAVAILABLE, "the gateway is ending"))
            job = _Job(turn, next(self._numbers), work)
            heapq.heappush(self._jobs, job)
            self._changed.notify()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="write")
                self._thread.start()
        return job.future

    def let_pass(self, turn: Turn) -> None:
        """Run waiting jobs that are more urgent; for a job of this turn, in its own thread."""
        while (job := self._take(turn)) is not None:
            job.do()

    def close(self) -> None:
        """Run the submitted jobs, and end."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join()

    def _take(self, turn: Turn) -> _Job | None:
        with self._changed:
            return heapq.heappop(self._jobs) if self._jobs and self._jobs[0].turn < turn else None

    def _run(self) -> None:
        while (job := self._next()) is not None:
            job.do()

    def _next(self) -> _Job | None:
        with self._changed:
            self._changed.wait_for(lambda: self._jobs or self._closed)
            return heapq.heappop(self._jobs) if self._jobs else None
