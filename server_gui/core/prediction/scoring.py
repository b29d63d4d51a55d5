"""Comparison of predictions with labels: the only measure of right and wrong."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ml.errors import UnusableModel
from ml.features.windows import Samples
from ml.registry.registry import Registry
from ml.robot.task import ABNORMAL, SIDES, STRIDE, UNKNOWN, Task
from ml.serving.grid import Stamps
from ml.store.labels import Label, LabelSource
from ml.training.judging import WITHIN
from ml.training.recorded import Recorded
from ml.training.truth import NOBODY, LabelSpan, Names, activities, phases
from server_gui.core.prediction.state import Quality

STILL: Final = "no stride"  # what it was, where a phase was said and no leg steps
OFF: Final = "another phase"  # what was said, where the phase of a leg is not within a tenth of the cycle
Counts = Counter[tuple[str, str]]  # what it was, what was said → decisions


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """Predictions at stamps (n,), in time's order: labels, and of gait_phase the phases (n, 2)."""

    stamps_ns: Stamps
    labels: Sequence[str]
    values: Sequence[Mapping[str, float]]

    @property
    def phases(self) -> Samples:
        """Phases of the left and the right leg, NaN without a prediction."""
        return np.array([[one.get(side, np.nan) for side in SIDES] for one in self.values]).reshape(-1, 2)


def compared(
    labels: Iterable[Label], clock: Recorded, task: Task, classes: Sequence[str], said: Decisions
) -> tuple[Names, Sequence[str]]:
    """Return the true class at each decision, or NOBODY, and the predicted one, both in these classes.

    `clock` relates the labels' times to the robot's. What a model itself has labelled proves nothing.
    """
    known = [one for one in labels if one.source is not LabelSource.PSEUDO]
    if not known or not said.labels:
        return np.full(len(said.labels), NOBODY), said.labels
    times = np.array([(one.began_utc_ns, one.ended_utc_ns) for one in known], np.int64)
    begins, ends = clock.at_utc(times[:, 0]).tolist(), clock.at_utc(times[:, 1]).tolist()
    spans = zip(begins, ends, known, strict=True)
    spoken = [LabelSpan(begin, end, one.label, one.source) for begin, end, one in spans]
    about_ns = said.stamps_ns - task.delay_ms * 1_000_000
    if task.fold:
        return _classes(activities(spoken, about_ns)[0], task, classes), said.labels
    return _phases(*phases(spoken, about_ns), said)


def _classes(names: Names, task: Task, classes: Sequence[str]) -> Names:
    known, which = np.unique(names, return_inverse=True)
    folded = (task.fold.get(str(name), NOBODY) for name in known)
    return np.array([name if name in classes else NOBODY for name in folded])[which]


def _phases(true: Samples, sources: Names, said: Decisions) -> tuple[Names, Sequence[str]]:
    """Right is within a tenth of the cycle of both legs; where no leg steps, only what is said counts."""
    known, steps = sources != NOBODY, np.isfinite(true.sum(axis=1))
    stride = np.array(said.labels) == STRIDE
    apart: Samples = np.abs((said.phases - np.where(steps[:, None], true, 0.0) + 0.5) % 1.0 - 0.5)
    off = ~(apart <= WITHIN).all(axis=1)
    was = np.where(known & steps, STRIDE, np.where(known & stride, STILL, NOBODY))
    return was, np.where(stride & steps & off, OFF, said.labels).tolist()


def proven_classes(registry: Registry, model: str, session: str) -> Sequence[str]:
    """Return the classes that a model knows; none where this session can prove nothing of it."""
    try:
        card = registry.card(model)
    except UnusableModel:
        return ()  # it is gone
    return () if session in card.learned else card.classes


def counted(was: Names, said: Sequence[str]) -> Counts:
    """Count the pairs of truth and prediction, where the truth is known."""
    pairs = zip(was.tolist(), said, strict=True)
    return Counter((so, label) for so, label in pairs if so != NOBODY)


def labelled_seconds(was: Names, stamps_ns: Stamps) -> int:
    """Return in how many seconds of the robot's clock there are decisions of which the truth is known."""
    return len(np.unique(stamps_ns[was != NOBODY] // 1_000_000_000))


def quality(counts: Mapping[tuple[str, str], int], seconds: int = 0, recordings: int = 0) -> Quality:
    """Return the accuracy from such counts, made within `seconds` in `recordings`."""
    confusion: dict[str, dict[str, int]] = {}
    for (was, said), count in sorted(counts.items()):
        confusion.setdefault(was, {})[said] = count
    labelled = sum(counts.values())
    right = sum(said.get(was, 0) for was, said in confusion.items())
    unsaid = sum(said.get(UNKNOWN, 0) + said.get(ABNORMAL, 0) for said in confusion.values())
    return Quality(labelled, right, labelled - right - unsaid, unsaid, confusion, seconds, recordings)
