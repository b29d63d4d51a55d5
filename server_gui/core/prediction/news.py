"""News of predictions about a robot: small frozen facts, to be shown or recorded."""

from collections.abc import Mapping
from dataclasses import dataclass

from ml.danger.detector import DETECTORS
from ml.danger.levels import Level
from ml.danger.monitor import DangerVerdict
from ml.registry.card import Card
from ml.serving.predictor import Prediction
from ml.serving.trust import Trust
from server_gui.core.prediction.adaptation import Adapting
from server_gui.core.prediction.state import Quality
from server_gui.core.settings.prediction import Action, RuleSettings


@dataclass(frozen=True, slots=True)
class Predicted:
    """A model's prediction for a robot now.

    `utc_ns` is when the window ended; `took_ns` how long after that the prediction was there, None where the
    robot's clock is not known. `quality` is how right the model was on this robot within the last days, None
    where nobody has labelled any of that. `learned_from` is the wearer whose walk the model has learned from,
    too, where it was adapted live.
    """

    robot: str
    prediction: Prediction
    card: Card
    trust: Trust
    utc_ns: int
    took_ns: int | None
    quality: Quality | None = None
    learned_from: str = ""


@dataclass(frozen=True, slots=True)
class Endangered:
    """A robot's danger now; times as in `Predicted`. Rules take the verdict as `prediction`."""

    robot: str
    verdict: DangerVerdict
    prediction: Prediction
    utc_ns: int
    took_ns: int | None

    @property
    def text(self) -> str:
        """In words: the level, the number, who speaks, and why."""
        verdict = self.verdict
        if verdict.number is None:
            return "unknown: its detectors lack data, or learn what is usual (half a minute and more)"
        speak = f"{verdict.speaking} of {len(DETECTORS)} detectors speak"
        return "; ".join([f"{verdict.level.word}, {verdict.number:.2f}, {speak}", *verdict.why])


def turn(before: Level, verdict: DangerVerdict) -> str | None:
    """Return a note for the recording, if advice or a worse level begins or ends.

    None where nothing has happened.
    """
    if verdict.level is before or max(verdict.level, before) < Level.ADVICE:
        return None
    if verdict.level is Level.UNKNOWN:
        return f"danger: not known any more, after {before.word}"
    if verdict.level < Level.ADVICE:
        return f"danger: {before.word} is over"
    return f"danger: {verdict.level.word}: {verdict.reasons}"


@dataclass(frozen=True, slots=True)
class Ruled:
    """A rule begins (or ends) to hold with this prediction; `objection` says why it stops no robot."""

    robot: str
    rule: RuleSettings
    began: bool
    cause: Predicted | Endangered
    objection: str | None = None

    @property
    def stops(self) -> bool:
        """Whether the robot is to be stopped now."""
        return self.began and self.rule.action is Action.STOP and self.objection is None

    @property
    def text(self) -> str:
        """In words."""
        took_ns = self.cause.took_ns
        after = "" if took_ns is None else f", {took_ns / 1e6:.0f} ms after the sample"
        said = f"{self.cause.prediction.label} {self.cause.prediction.probability:.2f}"
        what = f"rule {self.rule.name} ({self.rule.action.value})"
        if not self.began:
            return f"{what} is over: {said}"
        refused = self.rule.action is Action.STOP and self.objection is not None
        return f"{what} holds: {said}{after}" + (f"; NOT STOPPED, {self.objection}" if refused else "")


@dataclass(frozen=True, slots=True)
class Serves:
    """Models that serve a robot from now on, by task.

    `why` says of each task without a model, or whose newest one was refused, why, and what to do.
    """

    robot: str
    models: Mapping[str, Card]
    why: Mapping[str, str]


PredictionNews = Predicted | Endangered | Ruled | Serves | Adapting
