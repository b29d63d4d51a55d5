"""What was said against what labels say was so: the one way in which predictions are right or wrong."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ml.robot.task import ABNORMAL, UNKNOWN, Task
from ml.serving.grid import Stamps
from ml.store.labels import Label, Source
from ml.training.recorded import Recorded
from ml.training.truth import NOBODY, Names, Said, activities
from server_gui.core.prediction.state import Quality

Counts = Counter[tuple[str, str]]  # what it was, what was said → decisions


def truth(
    labels: Iterable[Label], clock: Recorded, task: Task, classes: Sequence[str], stamps_ns: Stamps
) -> Names:
    """What was so when decisions (n,), in time's order, are about: of these classes, or NOBODY.

    `clock` relates the labels' times to the robot's. What a model itself has labelled proves nothing.
    """
    known = [one for one in labels if one.source is not Source.PSEUDO]
    if not known or not len(stamps_ns):
        return np.full(len(stamps_ns), NOBODY)
    times = np.array([(one.began_utc_ns, one.ended_utc_ns) for one in known], np.int64)
    begins, ends = clock.at_utc(times[:, 0]).tolist(), clock.at_utc(times[:, 1]).tolist()
    spans = zip(begins, ends, known, strict=True)
    said = [Said(begin, end, one.label, one.source) for begin, end, one in spans]
    names, which = np.unique(activities(said, stamps_ns - task.delay_ms * 1_000_000)[0], return_inverse=True)
    folded = (task.fold.get(str(name), NOBODY) for name in names)
    return np.array([name if name in classes else NOBODY for name in folded])[which]


def counted(was: Names, said: Sequence[str]) -> Counts:
    """How often what was said of what, where somebody knows."""
    pairs = zip(was.tolist(), said, strict=True)
    return Counter((so, label) for so, label in pairs if so != NOBODY)


def quality(counts: Mapping[tuple[str, str], int]) -> Quality:
    """What of that was right."""
    confusion: dict[str, dict[str, int]] = {}
    for (was, said), count in sorted(counts.items()):
        confusion.setdefault(was, {})[said] = count
    labelled = sum(counts.values())
    right = sum(said.get(was, 0) for was, said in confusion.items())
    unsaid = sum(said.get(UNKNOWN, 0) + said.get(ABNORMAL, 0) for said in confusion.values())
    return Quality(labelled, right, labelled - right - unsaid, unsaid, confusion)
