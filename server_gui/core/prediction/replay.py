"""A recorded session, predicted again: what models say of it, what they said live, what of it is right."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from msgspec import Struct

from ml.errors import UnusableData
from ml.registry.card import check_robot
from ml.registry.registry import Registry
from ml.robot.learned import Learned
from ml.robot.task import ABNORMAL, TASKS, UNKNOWN
from ml.serving.grid import Stamps
from ml.serving.predictor import Prediction, replayed
from ml.serving.trust import Trust, Trusting
from ml.store import NoSuchTable, Store, sessions
from ml.store.labels import Label
from ml.store.sessions import Session
from ml.store.tables import PREDICTIONS
from ml.training.recorded import Recorded, recorded
from ml.training.truth import NOBODY, Said, activities
from server_gui.core.prediction.serving import Model
from server_gui.core.prediction.settings import PredictionSettings


class Quality(Struct, frozen=True):
    """How predictions compare with labels: of `labelled` decisions, what was right, wrong, and not said."""

    labelled: int
    right: int
    wrong: int
    unsaid: int  # unknown or abnormal
    confusion: dict[str, dict[str, int]]  # what it was → what was said → decisions


class Live(Struct, frozen=True):
    """How a replay compares with what the same model said live."""

    decisions: int  # that were made live
    same: int  # with the same label


@dataclass(frozen=True, slots=True)
class Replayed:
    """One task of a session."""

    model: Model
    predictions: Sequence[Prediction]
    utc_ns: Sequence[int]  # of each
    live: Live
    quality: Quality | None  # None where nobody has labelled anything
    trust: Trust  # over its last minute
    truth: Mapping[int, str] = field(default_factory=dict)  # stamp → class, where somebody has said it


def replay(
    store: Store, session: Session, settings: PredictionSettings, models: Sequence[str] = ()
) -> list[Replayed]:
    """Every task's replay, by the models that serve the robot now, or by those named.

    Raises:
        UnusableModel: a model cannot be used, or not for this robot.
        UnusableData: nothing serves this robot, or the session is too short for every model.

    """
    chosen = _chosen(Registry(store.url), session, models)
    if not chosen:
        raise UnusableData(
            f"no model serves {session.robot}: gwrms train TASK --promote, or name one with --model"
        )
    found = [_replayed(store, session, model, settings.every_ns(model.card.task)) for model in chosen]
    if not any(one.predictions for one in found):
        channels = ", ".join(chosen[0].learned.recipe.channels)
        raise UnusableData(
            f"{session.session} has no 2 s without a gap of every channel that its models need: {channels}"
        )
    return found


def _chosen(registry: Registry, session: Session, models: Sequence[str]) -> list[Model]:
    units = session.units
    served = (registry.serving(task, session.robot, units.keys()) for task in TASKS)
    found = []
    for name in models or (one for one in served if one is not None):
        card, state = registry.load(name)
        check_robot(card, session.robot, units)
        found.append(Model(card, Learned.restored(state)))
    return found


def _replayed(store: Store, session: Session, model: Model, every_ns: int) -> Replayed:
    channels = model.learned.recipe.channels
    rows = recorded(store, session.robot, session.session, channels)
    found = replayed(model.card.id, model.learned, rows.stamps_ns, rows.values, every_ns)
    stamps_ns = np.array([one.stamp_ns for one in found], np.int64)
    truth = _truth(sessions.labels(store, session), rows, model, stamps_ns)
    return Replayed(
        model,
        found,
        rows.to_utc(stamps_ns).tolist() if found else [],
        _live(store, session, model, found),
        _quality(found, truth) if truth else None,
        _trust(model, found, rows),
        truth,
    )


def _live(store: Store, session: Session, model: Model, found: Iterable[Prediction]) -> Live:
    try:
        rows = sessions.happenings(store, session, PREDICTIONS)
    except NoSuchTable:
        rows = []
    said = {row["stamp_ns"]: row["label"] for row in rows if row["model"] == model.card.id}
    same = sum(said.get(one.stamp_ns) == one.label for one in found)
    return Live(len(said), same)


def _truth(
    rows: Sequence[Mapping[str, object]],
    recording: Recorded,
    model: Model,
    stamps_ns: Stamps,
) -> dict[int, str]:
    """What was so when each decision is about, by its stamp, as classes of the task."""
    labels = [Label.of(row) for row in rows]
    task = model.learned.task
    if not labels or not len(stamps_ns) or not task.fold:
        return {}
    times = np.array([(one.began_utc_ns, one.ended_utc_ns) for one in labels], np.int64)
    begins, ends = recording.at_utc(times[:, 0]).tolist(), recording.at_utc(times[:, 1]).tolist()
    spans = zip(begins, ends, labels, strict=True)
    said = [Said(begin, end, one.label, one.source) for begin, end, one in spans]
    names, _ = activities(said, stamps_ns - task.delay_ms * 1_000_000)
    folded = [task.fold.get(str(name), NOBODY) for name in names]
    known = zip(stamps_ns.tolist(), folded, strict=True)
    return {stamp_ns: name for stamp_ns, name in known if name in model.learned.classes}


def _quality(found: Iterable[Prediction], truth: Mapping[int, str]) -> Quality:
    confusion: dict[str, dict[str, int]] = {}
    for one in found:
        if (was := truth.get(one.stamp_ns)) is not None:
            said = confusion.setdefault(was, {})
            said[one.label] = said.get(one.label, 0) + 1
    labelled = sum(sum(said.values()) for said in confusion.values())
    right = sum(said.get(was, 0) for was, said in confusion.items())
    unsaid = sum(said.get(UNKNOWN, 0) + said.get(ABNORMAL, 0) for said in confusion.values())
    return Quality(labelled, right, labelled - right - unsaid, unsaid, confusion)


def _trust(model: Model, found: Sequence[Prediction], rows: Recorded) -> Trust:
    """As it was shown at the session's end."""
    trusting = Trusting(model.learned.recipe.channels, model.card.ranges)
    newest = np.searchsorted(rows.stamps_ns, [one.stamp_ns for one in found], side="right") - 1
    trusting.take(found, rows.values[newest])
    return trusting.trust
