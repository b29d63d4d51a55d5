"""Newest predictions about one robot for the window, by task, and the rules that hold."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from ml.danger.levels import Level
from ml.danger.monitor import DangerVerdict
from ml.serving.predictor import Prediction
from server_gui.core.follow import frame_time
from server_gui.core.prediction.adaptation import Adapting
from server_gui.core.prediction.news import Endangered, Predicted, PredictionNews, Ruled, Serves
from server_gui.core.settings.prediction import RuleSettings

STALE_S: Final = 2.0  # what is older is no longer so
NOT_YET: Final = "looking for models"
OFF: Final = "prediction is off: write enabled = true into [prediction] of the server's file"


@dataclass(frozen=True, slots=True)
class NewestPrediction:
    """The newest prediction of a task, and when it came."""

    predicted: Predicted
    came_ns: int  # our monotonic clock

    @property
    def prediction(self) -> Prediction:
        """The model's prediction."""
        return self.predicted.prediction

    def age_s(self, now_ns: int | None = None) -> float:
        """Return seconds since the newest sample that it is about."""
        waited_ns = (frame_time.now_ns() if now_ns is None else now_ns) - self.came_ns
        return max(0, waited_ns + (self.predicted.took_ns or 0)) / 1e9

    def is_stale(self, now_ns: int | None = None) -> bool:
        """Return whether it is too old to be called live."""
        return self.age_s(now_ns) > STALE_S


@dataclass(frozen=True, slots=True)
class ShownDanger:
    """The newest danger prediction and its time; `known` is the newest verdict with a known level."""

    said: Endangered
    came_ns: int  # our monotonic clock
    known: DangerVerdict | None = None

    def is_stale(self, now_ns: int | None = None) -> bool:
        """Return whether it is too old to be called live: nothing is known then."""
        now_ns = time.monotonic_ns() if now_ns is None else now_ns
        return now_ns - self.came_ns + (self.said.took_ns or 0) > STALE_S * 1e9

    @property
    def is_known(self) -> bool:
        """Return whether somebody can say now how it is."""
        return not self.is_stale() and self.said.verdict.level is not Level.UNKNOWN

    @property
    def text(self) -> str:
        """In words; of what is old that nobody knows."""
        return "unknown: nothing has been said for some seconds" if self.is_stale() else self.said.text


@dataclass(frozen=True, slots=True)
class Recalled:
    """A prediction from the time of a recording, so long before the instant that is shown."""

    prediction: Prediction
    old_s: float

    def age_s(self) -> float:
        """Return seconds since the newest sample that it is about."""
        return self.old_s

    def is_stale(self) -> bool:
        """Return whether it was too old to be called live then."""
        return self.old_s > STALE_S


Told = NewestPrediction | Recalled


@dataclass(slots=True)
class StationPredictions:
    """For one thread; `take` and `clear` are the only writers, and `revision` rises with each.

    `why` says of each task without a model, or without the newest one, why that is so and what to do.
    `recalled` belongs to who plays a recording; of a robot there is nothing in it.
    """

    by_task: dict[str, NewestPrediction] = field(default_factory=dict)
    recalled: dict[str, Recalled] = field(default_factory=dict)
    danger: ShownDanger | None = None
    adapting: Adapting | None = None  # None: nobody learns from walks here
    elsewhere: str = ""  # what another program here says of what it has learned; empty: nothing
    why: dict[str, str] = field(default_factory=dict)
    off: bool = False
    foresees: bool = False  # whether danger is to be foreseen: then nothing said is not known, and no silence
    revision: int = 0
    _rules: dict[RuleSettings, Ruled] = field(default_factory=dict)
    _looked: bool = False

    @property
    def problem(self) -> str:
        """Why nothing is predicted, as a sentence; empty while a model serves."""
        if self.off:
            return OFF
        if self.told:
            return ""
        return "; ".join(self.why.values()) if self._looked else NOT_YET

    @property
    def told(self) -> Mapping[str, Told]:
        """The shown predictions by task: of a robot live, of a recording those of its time."""
        return {**self.by_task, **self.recalled}

    @property
    def rules(self) -> tuple[Ruled, ...]:
        """Those that hold now, the newest last."""
        return tuple(self._rules.values())

    def take(self, news: PredictionNews) -> None:
        """Take one fact."""
        self.revision += 1
        match news:
            case Predicted():
                self.by_task[news.prediction.task] = NewestPrediction(news, time.monotonic_ns())
            case Endangered():
                self.danger = ShownDanger(news, time.monotonic_ns(), self._known(news.verdict))
            case Adapting():
                self.adapting = news
            case Ruled(began=True):
                self._rules[news.rule] = news
            case Ruled():
                self._rules.pop(news.rule, None)
            case Serves():
                self.why, self._looked = dict(news.why), True
                for task in self.by_task.keys() - news.models.keys():
                    del self.by_task[task]

    def _known(self, verdict: DangerVerdict) -> DangerVerdict | None:
        if verdict.level is not Level.UNKNOWN:
            return verdict
        return None if self.danger is None else self.danger.known

    def clear(self) -> None:
        """Forget everything but danger that was known last: the link has dropped, which ends none."""
        self.revision += 1
        self.by_task.clear()
        self.adapting = None
        self._rules.clear()
        known = None if self.danger is None else self.danger.known
        if self.danger is None or known is None or known.level < Level.ADVICE:
            self.danger = None
        else:
            self.danger = replace(self.danger, came_ns=0)  # so long ago that it is not known to be so still

    def forget_danger(self) -> None:
        """Forget that, too: the robot's computer has started anew."""
        self.revision += 1
        self.danger = None
