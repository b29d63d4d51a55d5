"""`[prediction]` and `[[rules]]` of the server's file; what cannot work is said in words."""

from collections.abc import Iterable, Mapping
from enum import Enum
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Annotated, Final

from msgspec import Meta, Struct

from gateway.tables.finding import unknown
from ml.robot.classes import ABNORMAL, CLASSES

EVERY_MS: Final[Mapping[str, int]] = MappingProxyType({"activity": 100, "gait_phase": 40, "falling": 40})
DANGER: Final = "danger"  # no model's task: rules may speak of it as of one
DANGER_LEVELS: Final = ("early_warning", "advice", "alarm", "stop")
STEP_MS: Final = 20  # decisions are made at points of the models' grid
RELEASE: Final = 0.8  # of `at_least`, where a rule does not say it


class PredictionSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """`[prediction]`: live predictions of robots' status."""

    enabled: bool = True  # predict live
    danger: bool = False  # detect danger, too: docs explanation/danger
    every_ms: dict[str, Annotated[int, Meta(ge=STEP_MS, le=10_000, multiple_of=STEP_MS)]] = {}  # by task
    poll_s: Annotated[float, Meta(ge=1, le=3600)] = 10.0  # period of looking for newly promoted models

    def __post_init__(self) -> None:
        _refuse(_strange("every_ms", self.every_ms, CLASSES))

    def every_ns(self, task: str) -> int:
        """Return the time between two decisions of a task."""
        return self.every_ms.get(task, EVERY_MS[task]) * 1_000_000


class Action(Enum):
    """Action of a rule."""

    ALARM = "alarm"  # says so, and records it
    STOP = "stop"  # also asks the robot's gateway to stop every drive


class RuleSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """One of `[[rules]]`: it triggers once the probability of `label` is at least `at_least` for `for_ms`.

    It acts once, and again only after the probability was below `release`. A prediction "abnormal" counts
    with the probability 1.
    """

    task: str  # such as "falling", or "danger"
    label: str  # a class of the task
    at_least: Annotated[float, Meta(gt=0, le=1, extra={"unit": ""})]  # threshold of the probability
    for_ms: Annotated[int, Meta(ge=0, le=60_000)] = 0  # time above the threshold
    release: Annotated[float, Meta(ge=0, le=1)] | None = None  # None: four fifths of `at_least`
    robot: str = "*"  # a name or glob
    action: Action = Action.ALARM  # "stop" also stops every drive of the robot, by models of `[promoters]`

    def __post_init__(self) -> None:
        classes = {**{task: (*labels, ABNORMAL) for task, labels in CLASSES.items()}, DANGER: DANGER_LEVELS}
        labels = classes.get(self.task, (self.label,))
        wrong = [*_strange("task", [self.task], classes), *_strange("label", [self.label], labels)]
        if self.release is not None and self.release > self.at_least:
            wrong.append(f"release {self.release:g} is above at_least {self.at_least:g}")
        _refuse(wrong)

    @property
    def name(self) -> str:
        """Name of the rule in alarms."""
        return f"{self.task} {self.label} ≥ {self.at_least:g} for {self.for_ms} ms"

    @property
    def ends_below(self) -> float:
        """How probable the label still is while it holds."""
        return RELEASE * self.at_least if self.release is None else self.release

    def concerns(self, robot: str) -> bool:
        """Return whether it is about this robot."""
        return fnmatchcase(robot, self.robot)


def _strange(key: str, found: Iterable[str], allowed: Iterable[str]) -> list[str]:
    names = list(allowed)
    return [f"{key} {unknown(name, names)}" for name in found if name not in names]


def _refuse(wrong: list[str]) -> None:
    if wrong:
        raise ValueError("\n".join(wrong))
