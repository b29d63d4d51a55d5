"""What models say of a robot, in marks and words for header and overview; also that they do not know."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Final

from ml.registry.card import Source
from ml.robot.task import ABNORMAL, UNKNOWN
from ml.serving.trust import Level, Trust
from server_gui.core.desk.leg_phase import LegPhase, phase_at
from server_gui.core.desk.station import Station
from server_gui.core.prediction.current import Recalled, Told
from server_gui.core.prediction.state import WITHIN_DAYS
from server_gui.core.processing.gait_events import Leg
from server_gui.views.marks import Mark

ACTIVITY, FALLING, GAIT_PHASE = "activity", "falling", "gait_phase"
STEADY: Final = "steady"
LEAST: Final = 0.01  # what is less probable is not worth a word
SOURCES: Final = {
    Source.SIMULATED: "simulated model",
    Source.RECORDED: "from recordings",
    Source.MIXED: "recordings and simulator",
}
TITLES: Final = {ACTIVITY: "Does", FALLING: "Balance", GAIT_PHASE: "Stride"}


@dataclass(frozen=True, slots=True)
class Line:
    """A mark, what it says, and where that comes from."""

    mark: Mark
    text: str
    detail: str = ""


def said(shown: Told) -> Line:
    """Return what a model says now: the label and how probable, or that it does not know."""
    prediction = shown.prediction
    if shown.is_stale():
        return Line(Mark("ring", "old", "old"), "No prediction now", f"the last {shown.age_s():.0f} s ago")
    word, detail = label_text(prediction.label), _detail(shown)
    if prediction.label == ABNORMAL:
        return Line(Mark("triangle", "warn", ABNORMAL), word, f"novelty {prediction.novelty:.1f} · {detail}")
    if prediction.label == UNKNOWN:
        return Line(Mark("ring", "dim", UNKNOWN), word, detail)
    if prediction.values:
        word = " · ".join(
            f"{name[0].upper()} {100 * value:.0f} %" for name, value in prediction.values.items()
        )
    falls = prediction.task == FALLING and prediction.label != STEADY
    mark = Mark("square", "bad", prediction.label) if falls else Mark("diamond", "accent", prediction.label)
    return Line(mark, f"{word}  {prediction.probability:.2f}", detail)


def status(station: Station) -> Line | None:
    """Return the one line of the header: a fall before all, then activity; None without a model."""
    shown = station.predictions.told
    falling = shown.get(FALLING)
    if falling is not None and not falling.is_stale():
        line = said(falling)
        if line.mark.colour == "bad":
            return _as_predicted(line)
    return _as_predicted(said(shown[ACTIVITY])) if ACTIVITY in shown else None


def lines(station: Station) -> Iterator[Line]:
    """Yield the overview's lines: tasks with their models, rules that hold, faults of devices."""
    predictions = station.predictions
    told_by_task = predictions.told
    for task, title in TITLES.items():
        if task in told_by_task:
            shown = told_by_task[task]
            line = said(shown)
            told = filter(None, (line.detail, model_text(shown), quality_text(shown)))
            yield Line(line.mark, f"{title}: {line.text}", " · ".join(told))
    if predictions.problem:
        yield Line(Mark("ring", "old", "no model"), "Not predicted", predictions.problem)
    for rule in predictions.rules:
        yield Line(Mark("triangle", "warn", "rule"), f"Rule {rule.rule.action.value}", rule.text)
    wrong = station.robot.not_ok()
    for part in wrong:
        yield Line(
            Mark("square", "bad", part.state), f"{part.name} {part.state}", part.problem or "no reason known"
        )
    if not wrong and station.robot.parts:
        yield Line(Mark("disc", "good", "ok"), "Devices: every one is ok")


def model_phases(station: Station) -> dict[Leg, LegPhase | None]:
    """Return where each leg is in its stride by a model; None where it does not know."""
    shown = station.predictions.told.get(GAIT_PHASE)
    if shown is None or shown.is_stale() or shown.prediction.label in (UNKNOWN, ABNORMAL):
        return dict.fromkeys(Leg)
    values = shown.prediction.values
    percents = {leg: 100.0 * values[leg.value] for leg in Leg if leg.value in values}
    return {leg: LegPhase(percents[leg], phase_at(percents[leg])) if leg in percents else None for leg in Leg}


def label_text(label: str) -> str:
    """Return a label for people."""
    return label.replace("_", " ").capitalize()


def model_text(shown: Told) -> str:
    """Return which model, how old, from what it has learned; of a recording, that it was said then."""
    if isinstance(shown, Recalled):
        return f"said then by {shown.prediction.model}"
    card = shown.predicted.card
    days = (datetime.now(UTC) - card.made).days
    age = "new today" if days < 1 else "1 day old" if days == 1 else f"{days} days old"
    return f"{card.id}, {age}, {SOURCES[card.source]}"


def quality_text(shown: Told) -> str:
    """Return how right the model was on this robot of late, where somebody has labelled that."""
    if isinstance(shown, Recalled) or shown.predicted.quality is None:
        return ""
    return f"last {WITHIN_DAYS} days: {shown.predicted.quality.text}"


def _as_predicted(line: Line) -> Line:
    """As it is said where other things stand beside it."""
    return replace(line, detail=" · ".join(filter(None, ("predicted", line.detail))))


def _detail(shown: Told) -> str:
    """What speaks against believing it, and the runner-up, where there is one."""
    prediction = shown.prediction
    doubt = "" if isinstance(shown, Recalled) else _doubt(shown.predicted.trust)
    others = sorted(prediction.probabilities.items(), key=lambda item: -item[1])
    if prediction.label in (UNKNOWN, ABNORMAL):
        runner = f"likeliest {label_text(others[0][0]).lower()} {others[0][1]:.2f}" if others else ""
    else:
        others = [item for item in others if item[0] != prediction.label and item[1] >= LEAST]
        runner = f"next {label_text(others[0][0]).lower()} {others[0][1]:.2f}" if others else ""
    return " · ".join(filter(None, (doubt, runner)))


def _doubt(trust: Trust) -> str:
    if trust.level is Level.DRIFTED:
        channels = ", ".join(trust.drifted[:2])
        return f"DRIFTED: {channels or 'unlike what it has learned'}"
    return "" if trust.level is Level.GOOD else f"trust {trust.level.value}"
