"""Work on recordings that takes long: one after another in a thread, with progress, cancelled when asked."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from ml.store.errors import StoreError
from server_gui.core.fleet.control_socket import NobodyCollects
from server_gui.core.recording.errors import RecordingError
from server_gui.core.threads.background import Background

log = logging.getLogger(__name__)

KEPT: Final = 100  # jobs that are remembered


class JobFailed(Exception):
    """The work cannot be done; the message says why, and what to do."""


KNOWN: Final = (JobFailed, StoreError, RecordingError, NobodyCollects, OSError)


class JobState(Enum):
    """State of a job."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class Cancelled(Exception):
    """Somebody does not want it any more."""


@dataclass(slots=True)
class Job:
    """One piece of work; written by its thread, read by any. `total` is None where nobody knows."""

    name: str
    state: JobState = JobState.WAITING
    done: int = 0
    total: int | None = None
    unit: str = ""
    said: str = ""  # what came of it
    ended_s: float | None = None  # on our monotonic clock
    cancelled: threading.Event = field(default_factory=threading.Event)

    def expect(self, total: int, unit: str) -> None:
        """Set how much there is to do, in rows, files or bytes."""
        self.done, self.total, self.unit = 0, total, unit
        self.check()

    def advance(self, count: int) -> None:
        """Count what is done; raises `Cancelled` where nobody wants the rest."""
        self.done += count
        self.check()

    def check(self) -> None:
        """Check for cancellation; raises `Cancelled`."""
        if self.cancelled.is_set():
            raise Cancelled

    def cancel(self) -> None:
        """End it at its next step: it is not wanted any more."""
        self.cancelled.set()

    @property
    def is_over(self) -> bool:
        """Whether nothing of it is still to come."""
        return self.state not in (JobState.WAITING, JobState.RUNNING)


Work = Callable[[Job], str]  # tells what came of it


class Jobs:
    """The newest first. What goes wrong with a job stands on it, and ends no other."""

    def __init__(self, told: Callable[[Job], None] = lambda _: None, thread: str = "jobs") -> None:
        """`told` hears in the jobs' thread of each that is over."""
        self.jobs: deque[Job] = deque(maxlen=KEPT)
        self._told = told
        self._thread = Background(thread)

    def add(self, name: str, work: Work) -> Job:
        """Do this when its turn comes."""
        job = Job(name)
        self.jobs.appendleft(job)
        self._thread.do(lambda: self._run(job, work))
        return job

    def close(self, within_s: float) -> bool:
        """Break off what is under way, forget the rest; False where that takes longer. Idempotent."""
        for job in self.jobs:
            job.cancel()
        return self._thread.close(within_s)

    def _run(self, job: Job, work: Work) -> None:
        try:
            job.check()
            job.state = JobState.RUNNING
            job.said = work(job)
            job.state = JobState.DONE
        except Exception as error:  # noqa: BLE001 - the other jobs go on, whatever a library raises
            job.state, job.said = _failed(job, error)
        job.ended_s = time.monotonic()
        self._told(job)


def _failed(job: Job, error: Exception) -> tuple[JobState, str]:
    """Return the end of a job that raised.

    Libraries may hand a `Cancelled` on as an error of their own.
    """
    if job.cancelled.is_set():
        return JobState.CANCELLED, "cancelled"
    if isinstance(error, KNOWN):
        return JobState.FAILED, str(error)
    log.error("%s: internal error", job.name, exc_info=error)
    return JobState.FAILED, f"internal error, {type(error).__name__}"  # its text may quote keys
