"""A training in a process of its own, `gwrms train`: what is asked of it, and what it says."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import msgspec

from server_gui.core.cloud.jobs import Job, JobFailed
from server_gui.core.models.names import EVERY, task_name

UNITS: Final = {
    "reading sessions": "sessions read",
    "learning": "rounds of learning",
    "judging": "judged",
}

NOT_BETTER: Final = "not better"  # the verdict with which nothing is promoted
NOT_COMPARED: Final = "not compared"  # with which the reasons say so themselves
WORDS: Final = {
    "macro_f1": "F1",
    "rmse_percent": "error of the place in the gait cycle",
    "calibration_error": "how far its probabilities are off",
    "abstained": "how often it says “unknown”",
}


class Progress(msgspec.Struct, frozen=True):
    """Progress of a training."""

    what: str
    done: int
    total: int


class Trained(msgspec.Struct, frozen=True):
    """Result of a training: the model's id, the model that it may replace, and the judgement."""

    model: str
    verdict: str
    why: tuple[str, ...]
    over: str = ""
    left_out: dict[str, str] = {}
    remarks: tuple[str, ...] = ()

    @property
    def reasons(self) -> str:
        """Return why, with figures by their names for people."""
        return "; ".join(self._why)

    @property
    def may_serve(self) -> bool:
        """Whether the window offers to promote it."""
        return self.verdict != NOT_BETTER

    @property
    def said(self) -> str:
        """Return verdict and reasons in words."""
        if self.verdict == NOT_COMPARED:
            return " ".join(f"{why[:1].upper()}{why[1:]}." for why in self._why)
        return f"{self.verdict.capitalize()}: {self.reasons}"

    @property
    def _why(self) -> list[str]:
        why = list(self.why)
        for figure, words in WORDS.items():
            why = [each.replace(figure, words) for each in why]
        return why


class _Wrong(msgspec.Struct, frozen=True):
    message: str


class _Line(msgspec.Struct, frozen=True):
    """Any line that it prints."""

    progress: Progress | None = None
    error: _Wrong | None = None
    model: str | None = None


class TrainingFailed(JobFailed):
    """It cannot be trained; the message says what is missing."""


@dataclass(frozen=True, slots=True)
class TrainingWish:
    """The requested training, on the store's labelled sessions; `robot` "": all robots."""

    task: str
    robot: str = ""
    held_out: Sequence[str] = ()

    @property
    def title(self) -> str:
        """Return its name among jobs."""
        return f"Train {task_name(self.task).lower()} for {self.robot or EVERY}"

    def arguments(self, url: str) -> list[str]:
        """Return the command."""
        robot = ["--robot", self.robot] if self.robot else []
        held_out = [word for who in self.held_out for word in ("--held-out", who)]
        return ["train", self.task, "--json", "--progress", "--url", url, *robot, *held_out]


def heard(line: str, job: Job) -> Trained | None:
    """Take a line that it printed; return what came of it, once it says so.

    Raises:
        TrainingFailed: it says that it cannot be.

    """
    try:
        said = msgspec.json.decode(line, type=_Line)
    except msgspec.DecodeError:
        return None  # a warning of a library
    if said.error is not None:
        raise TrainingFailed(said.error.message)
    if said.progress is not None:
        job.expect(said.progress.total, UNITS.get(said.progress.what, said.progress.what))
        job.done = said.progress.done
    return None if said.model is None else msgspec.json.decode(line, type=Trained)
