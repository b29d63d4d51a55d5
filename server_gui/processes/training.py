"""A training as a process of ours: the window never waits for it, and its end is its own."""

from collections.abc import Callable
from typing import Final

from ml.store.url import checked_url
from server_gui.core.cloud.jobs import Job, Work
from server_gui.core.models.training import Trained, TrainingFailed, TrainingWish, heard
from server_gui.processes.children import Child, ChildFailed

LONGEST_S: Final = 24 * 3600.0


def training(url: str, wish: TrainingWish, done: Callable[[Trained], None]) -> Work:
    """Train as wished from the store at `url`; `done` hears in the job's thread what came of it.

    The work raises `TrainingFailed` where it cannot be trained. Cancelled, it publishes nothing.
    """

    def work(job: Job) -> str:
        known: set[str] = set()

        def find(line: str) -> Trained | None:
            if line in known:
                return None
            known.add(line)
            return heard(line, job)

        with Child("training", wish.arguments(checked_url(url))) as child:
            try:
                found = child.wait_ready(find, LONGEST_S, job.check)
            except ChildFailed as error:
                raise TrainingFailed(str(error)) from error
        done(found)
        return found.said

    return work
