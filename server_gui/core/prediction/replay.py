"""A recorded session, predicted again: what models say of it, what they said live, what of it is right."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from msgspec import Struct

from ml.errors import UnusableData
from ml.registry.card import check_robot
from ml.registry.registry import Registry
from ml.robot.learned import Learned
from ml.robot.task import TASKS
from ml.serving.predictor import Prediction, replayed
from ml.serving.trust import Trust, Trusting
from ml.store import NoSuchTable, Store, sessions
from ml.store.labels import Label
from ml.store.sessions import Session
from ml.store.tables import PREDICTIONS
from ml.training.recorded import Recorded, recorded
from ml.training.truth import NOBODY
from server_gui.core.prediction.model_loading import Model
from server_gui.core.prediction.scoring import Decisions, compared, counted, quality
from server_gui.core.prediction.state import Quality
from server_gui.core.settings.prediction import PredictionSettings


class Live(Struct, frozen=True):
    """Comparison of a replay with the same model's live predictions."""

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
    flattered: bool  # by that: the model has learned from this session
    trust: Trust  # over its last minute
    truth: Mapping[int, str] = field(default_factory=dict)  # stamp → class, where somebody has said it


def replay(
    store: Store, session: Session, settings: PredictionSettings, models: Sequence[str] = ()
) -> list[Replayed]:
    """Replay every task, by the models that serve the robot now or by those named.

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
    labels = [Label.of(row) for row in sessions.labels(store, session)]
    said = Decisions(stamps_ns, [one.label for one in found], [one.values for one in found])
    was, said_of_it = compared(labels, rows, model.learned.task, model.learned.classes, said)
    counts = counted(was, said_of_it)
    return Replayed(
        model,
        found,
        rows.to_utc(stamps_ns).tolist() if found else [],
        _live(store, session, model, found),
        quality(counts) if counts else None,
        session.session in model.card.learned,
        _trust(model, found, rows),
        {stamp: str(name) for stamp, name in zip(stamps_ns.tolist(), was, strict=True) if name != NOBODY},
    )


def _live(store: Store, session: Session, model: Model, found: Sequence[Prediction]) -> Live:
    """Compare with the live predictions of the session up to here; the store may have more by now."""
    try:
        rows = sessions.rows_of(store, session, PREDICTIONS)
    except NoSuchTable:
        rows = []
    until_ns = found[-1].stamp_ns if found and session.ended is None else math.inf
    said = {
        row["stamp_ns"]: row["label"]
        for row in rows
        if row["model"] == model.card.id and row["stamp_ns"] <= until_ns
    }
    same = sum(said.get(one.stamp_ns) == one.label for one in found)
    return Live(len(said), same)


def _trust(model: Model, found: Sequence[Prediction], rows: Recorded) -> Trust:
    """Return it as it was shown at the session's end."""
    trusting = Trusting(model.learned.recipe.channels, model.card.ranges)
    newest = np.searchsorted(rows.stamps_ns, [one.stamp_ns for one in found], side="right") - 1
    trusting.take(found, rows.values[newest])
    return trusting.trust
