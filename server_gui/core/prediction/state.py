"""Report on prediction, for `gwrms collect --status` and others; needs no scikit-learn."""

from collections.abc import Collection
from datetime import datetime
from typing import Final

from msgspec import Struct

from gateway.amounts import counted

WITHIN_DAYS: Final = 7  # of predictions that are compared with labels
FEW: Final = 30  # decisions, of which a percentage would look as if it were known
# Decisions follow each other so closely that thousands of one walk say hardly more than one of them, so that
# an interval over their number (Wilson's) would be much too narrow. What counts is time, and another day.
LEAST_S: Final = 60
LEAST_RECORDINGS: Final = 2
TOO_LITTLE: Final = "too little labelled to tell"


class Quality(Struct, frozen=True):
    """Accuracy by labels: of `labelled` decisions, the right, the wrong, and the abstentions.

    They were made within `seconds` in `recordings`; 0 where it is not known in how many.
    """

    labelled: int
    right: int
    wrong: int
    unsaid: int  # unknown or abnormal
    confusion: dict[str, dict[str, int]]  # what it was → what was said → decisions
    seconds: int = 0
    recordings: int = 0

    @property
    def is_enough(self) -> bool:
        """Whether it rests on enough to say how right a model is, not only how right it was there."""
        return self.seconds >= LEAST_S and self.recordings >= LEAST_RECORDINGS

    @property
    def basis(self) -> str:
        """How much it rests on, in words."""
        return f"{self.duration} in {counted(self.recordings, 'recording')}"

    @property
    def duration(self) -> str:
        """How long was labelled, in words."""
        return f"{self.seconds} s" if self.seconds < LEAST_S else f"{self.seconds // 60} min"

    @property
    def last_week(self) -> str:
        """How right a model is, in words and by what; that too little was labelled where that is so."""
        if not self.is_enough:
            return f"{TOO_LITTLE}: {self.basis}; it takes {LEAST_S // 60} min in {LEAST_RECORDINGS}"
        right, wrong, unsaid = self.shares
        return f"{right} right, {wrong} wrong, {unsaid} not said of {self.basis}"

    @property
    def shares(self) -> tuple[str, str, str]:
        """Right, wrong and not said: in percent, or counts where there are too few decisions for that."""
        counts = (self.right, self.wrong, self.unsaid)
        if self.labelled < FEW:
            right, wrong, unsaid = (f"{count} of {self.labelled}" for count in counts)
        else:
            right, wrong, unsaid = (f"{share(count, self.labelled, 1)} %" for count in counts)
        return right, wrong, unsaid

    def lone_class(self, classes: Collection[str]) -> str | None:
        """Return the only class that was labelled, of a model that knows more: no proof of those."""
        return next(iter(self.confusion)) if len(self.confusion) == 1 < len(classes) else None

    @property
    def text(self) -> str:
        """In words."""
        if self.labelled < FEW:
            counts = f"{self.right} right, {self.wrong} wrong, {self.unsaid} not said"
            return f"of {self.labelled} labelled decisions {counts}"
        right, wrong, unsaid = self.shares
        return f"{right} right, {wrong} wrong, {unsaid} not said of {self.labelled} labelled"


def share(count: int, of: int, digits: int) -> str:
    """Return a percentage; all or nothing is said only of all or nothing."""
    least = 10.0**-digits
    percent = 100 * count / of
    return f"{min(max(percent, least), 100.0 - least) if 0 < count < of else percent:.{digits}f}"


Figures = dict[str, dict[str, dict[str, Quality]]]  # by robot, task and model


class TaskReport(Struct, frozen=True):
    """Present prediction of one task of a robot; seconds, UTC. `took_s` is from sample to prediction."""

    model: str
    made: datetime
    label: str
    probability: float
    utc_s: float
    took_s: float | None
    trust: str
    novelty: float
    abnormal: float  # of the last minute's decisions
    unknown: float
    drifted: tuple[str, ...]  # channels


class DangerReport(Struct, frozen=True):
    """What was said of a robot's danger last, in words, and the UTC (s) of that."""

    text: str
    utc_s: float


class PredictingState(Struct, frozen=True):
    """State of prediction: predictions by robot and task, and problems of models, in words."""

    robots: dict[str, dict[str, TaskReport]] = {}
    problems: tuple[str, ...] = ()
    labelled: Figures | None = None  # None: nobody has looked yet
    judged: int = 0  # decisions since the start
    skipped: int = 0  # decisions that were due while too much was to do
    adapting: dict[str, str] = {}  # by robot, in words; "" where there is nothing to say
    dangers: dict[str, DangerReport] = {}  # by robot, where danger is on and something was said
