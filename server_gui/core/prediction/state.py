"""Report on prediction, for `gwrms collect --status` and others; needs no scikit-learn."""

from datetime import datetime
from typing import Final

from msgspec import Struct

WITHIN_DAYS: Final = 7  # of predictions that are compared with labels
FEW: Final = 30  # decisions, of which a percentage would look as if it were known


class Quality(Struct, frozen=True):
    """Accuracy by labels: of `labelled` decisions, the right, the wrong, and the abstentions."""

    labelled: int
    right: int
    wrong: int
    unsaid: int  # unknown or abnormal
    confusion: dict[str, dict[str, int]]  # what it was → what was said → decisions

    @property
    def shares(self) -> tuple[str, str, str]:
        """Right, wrong and not said: in percent, or counts where there are too few decisions for that."""
        counts = (self.right, self.wrong, self.unsaid)
        if self.labelled < FEW:
            right, wrong, unsaid = (f"{count} of {self.labelled}" for count in counts)
        else:
            right, wrong, unsaid = (f"{100 * count / self.labelled:.1f} %" for count in counts)
        return right, wrong, unsaid

    @property
    def text(self) -> str:
        """In words."""
        right, wrong, unsaid = self.shares
        return f"{right} right, {wrong} wrong, {unsaid} not said of {self.labelled} labelled"


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
