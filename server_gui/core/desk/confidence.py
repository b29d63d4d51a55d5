"""Confidence in a prediction, in words that a wearer's therapist understands."""

from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from typing import Final

from ml.registry.card import DataSource
from ml.serving.trust import TrustLevel
from server_gui.core.alarms.undriven import undriven
from server_gui.core.desk.station import Station
from server_gui.core.models.names import class_name, told_task
from server_gui.core.prediction.newest_predictions import NewestPrediction, Recalled, Told
from server_gui.core.prediction.state import TOO_LITTLE, Quality, share
from server_gui.core.tuning.stop import ENABLED, is_off

NOT_SEEN: Final = ("lost", "stale")
SOURCES: Final = {
    DataSource.SIMULATED: "learned in the simulator",
    DataSource.RECORDED: "learned from recordings",
    DataSource.MIXED: "learned from recordings and the simulator",
}


class Worth(Enum):
    """What it is worth."""

    CHECKED = "checked"  # people have labelled enough of late of what this model was to say
    UNCHECKED = "not checked"
    DOUBTFUL = "doubtful"


@dataclass(frozen=True, slots=True)
class Confidence:
    """`wordings` say it, the fullest first."""

    worth: Worth
    wordings: tuple[str, ...]


def belief(told: Told) -> Confidence:
    """Return the confidence in what a model says."""
    if isinstance(told, Recalled):
        return Confidence(Worth.UNCHECKED, (f"said then by {told_task(told.prediction.model)}", "said then"))
    predicted = told.predicted
    if predicted.trust.level is TrustLevel.DRIFTED:
        return Confidence(Worth.DOUBTFUL, (_drifted(told), "unlike its learning", "do not rely on it"))
    if predicted.trust.level is TrustLevel.UNSURE:
        return Confidence(Worth.DOUBTFUL, ("mostly unsure here: do not rely on it", "mostly unsure"))
    quality = predicted.quality
    if quality is None or not quality.labelled:
        card = predicted.card
        about = f"{SOURCES[card.source]} {_ago(card.made)}"
        if predicted.learned_from:
            about = f"learned from {predicted.learned_from}"
        return Confidence(Worth.UNCHECKED, (f"not yet checked on this robot, {about}", "not yet checked"))
    if not quality.is_enough:
        return Confidence(Worth.UNCHECKED, (f"{TOO_LITTLE} ({quality.basis})", TOO_LITTLE))
    if (lone := quality.lone_class(predicted.card.classes)) is not None:
        said = f"only {class_name(lone)} was labelled"
        return Confidence(Worth.UNCHECKED, (f"{said}, which proves nothing of the rest", said))
    return Confidence(Worth.CHECKED, _checked(quality))


def not_judged(station: Station) -> str:
    """Return why what the robot does now is no sign of anything: it does not drive its wearer."""
    return undriven(station.robot, station.stopping) or _not_known(station)


def _not_known(station: Station) -> str:
    """Return that too little is known of the drives: of those that are, none is enabled."""
    robot = station.robot
    told = [name for joint in robot.names("joint") if (name := f"{joint}.state") in robot.state_words]
    words = [robot.word(channel) for channel in told]
    unknown = sum(word != ENABLED and not is_off(word) for word in words)
    if not unknown or ENABLED in words:
        return ""
    return f"{unknown} of {len(words)} drives not known, no other is enabled"


def blind(station: Station) -> str:
    """Return which components a model does not see now: without them nothing is like what it has learned."""
    missing = [part.name.replace("_", " ") for part in station.robot.not_ok() if part.state in NOT_SEEN]
    return f"nothing comes from {', '.join(missing)}" if missing else ""


def _checked(quality: Quality) -> tuple[str, ...]:
    short = f"right {share(quality.right, quality.labelled, 0)} % last week"
    return f"{short} ({quality.basis})", short


def _drifted(told: NewestPrediction) -> str:
    channels = ", ".join(told.predicted.trust.drifted[:2])
    return f"unlike what it has learned{f' ({channels})' if channels else ''}: do not rely on it"


def _ago(made: datetime) -> str:
    days = (datetime.now(UTC) - made).days
    return "today" if days < 1 else "yesterday" if days == 1 else f"{days} days ago"
