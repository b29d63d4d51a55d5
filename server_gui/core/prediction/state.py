"""How prediction goes, for `gwrms collect --status` and whoever shows it; needs no scikit-learn."""

from datetime import datetime

from msgspec import Struct


class TaskReport(Struct, frozen=True):
    """What is predicted of one task of a robot now; seconds, UTC. `took_s` is from sample to prediction."""

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


class PredictingState(Struct, frozen=True):
    """How prediction goes; what is predicted by robot and task, and what is wrong with models, in words."""

    robots: dict[str, dict[str, TaskReport]] = {}
    problems: tuple[str, ...] = ()
    judged: int = 0  # decisions since the start
    skipped: int = 0  # decisions that were due while too much was to do
