"""`sim-walks`: the shipped models on people whom they do not know, who walk differently, group by group.

Nothing is learned from the recording, but for what a minute of each wearer adapts; what comes later judges
the phase before and after. The worst group and the worst third of the wearers count, not the mean.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from ml.benchmarks import metrics
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.phase import percent
from ml.benchmarks.search import Search
from ml.benchmarks.sim import WHOLE, recipe_of
from ml.errors import UnusableData
from ml.registry.card import Card
from ml.registry.registry import SHIPPED, Registry
from ml.robot.learn import WITHIN
from ml.robot.learned import ABNORMAL_FROM, NONE, Learned
from ml.robot.task import ACTIVITY, GAIT_PHASE, SIDES, Task
from ml.training.adapting import taught
from ml.training.simulated import SimulatedSession, examples, read, stepping

MINUTE_NS: Final = 60_000_000_000  # of a recording, whatever its wearer does in it
LEAST_LATER: Final = 100  # decisions in steps, to judge an adapted model by
STEPS: Final = {"activity": 10, "gait_phase": 3}  # grid samples between decisions: 200 and 60 ms
WHY: Final = (
    "synthetic: simulated people (gwrms sim-record --walks), judged by the shipped models, which have learned"
    " from others who walk in the same ways. adapted: the phase after the first minute of each recording has"
    " taught it."
)

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """One session: of its decisions whose activity is known, and of those in which both legs step."""

    walks: str
    truth: npt.NDArray[np.int_]  # index into the classes
    likeliest: npt.NDArray[np.int_]
    unknown: npt.NDArray[np.bool_]  # nothing, or "abnormal", is said
    error: Floats  # (m, 2) of the phases, of the cycle
    before: Floats  # (k, 2) the same after the first minute; none where too little comes then
    after: Floats  # (k, 2) of the adapted model
    covered: Flags  # (n,) the truth of the activity is in the conformal set
    missed_before: Flags  # (k,) a phase is said, and a leg is off by more than a tenth
    missed_after: Flags


def evaluate(path: Path, search: Search) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Every session by itself, then by groups of walks."""
    sessions = sorted(read(path), key=lambda session: session.walks)
    registry = Registry(SHIPPED.as_uri())
    activity, phase = (_shipped(registry, task, sessions) for task in (ACTIVITY, GAIT_PHASE))
    with threadpool_limits(1):  # the same bits on every computer
        found = [_found(session, activity, phase) for session in sessions]
    classes = len(activity.classes)
    groups = {
        name: _figures(list(of_it), classes) for name, of_it in groupby(found, key=lambda one: one.walks)
    }
    macro_f1 = [one["macro_f1"] for one in groups.values()]
    rmse = [one["rmse_percent"] for one in groups.values() if not math.isnan(one["rmse_percent"])]
    figures = {
        "worst_walks_macro_f1": min(macro_f1),
        "worst_walks_rmse_percent": max(rmse, default=math.nan),
        "macro_f1": float(np.mean(macro_f1)),
        "rmse_percent": float(np.mean(rmse)) if rmse else math.nan,
    }
    people = len({session.subject for session in sessions})
    settings = "none: the models are those that come with GWRMS"
    return Outcome(figures | _adaptation(found), people, groups, "walks", settings=settings, notes=(WHY,))


def _shipped(registry: Registry, task: Task, sessions: Sequence[SimulatedSession]) -> Learned:
    """Return the model of a robot with every sensor.

    Raises:
        UnusableData: a session lacks a sensor, or its wearer is one whom the model has learned from.

    """
    model = registry.serving(task.name, channels=set(recipe_of(task, WHOLE).channels))
    if model is None:
        raise UnusableData(f"no model of {task.name} comes with this installation")
    card, state = registry.load(model)
    _check_people(card, sessions)
    return Learned.restored(state)


def _check_people(card: Card, sessions: Sequence[SimulatedSession]) -> None:
    known = {name.split("-")[2] for name in (*card.learned, *card.held_out)}  # sim-SEED-PERSON[-WALKS]
    both = sorted({session.subject for session in sessions} & known, key=int)
    if both:
        raise UnusableData(
            f"{card.task} has learned from simulated people {', '.join(both)}: record others, as in"
            " gwrms sim-record --subjects 101-104"
        )


def _found(session: SimulatedSession, activity: Learned, phase: Learned) -> Found:
    doing = examples(ACTIVITY, activity.recipe, [session], STEPS["activity"])
    names = np.array([ACTIVITY.fold.get(label, "") for label in doing.label])
    rows = np.isin(names, activity.classes)
    said = activity.judge(doing.features[rows])
    place = {name: number for number, name in enumerate(activity.classes)}

    seen = examples(GAIT_PHASE, phase.recipe, [session], STEPS["gait_phase"])
    truth, known = stepping(seen.label, seen.phase)
    steps = known & ~np.isnan(truth).any(axis=1)
    early = seen.time_ns - session.stamps_ns[0] < MINUTE_NS
    later = steps & ~early
    error, missed = _errors(phase, seen.features[steps], truth[steps])
    if later.sum() < LEAST_LATER:
        later = np.zeros_like(later)
    before, missed_before = error[later[steps]], missed[later[steps]]
    after, missed_after = before, missed_before
    if later.any():
        own = taught(phase, seen.features[known & early], truth[known & early])
        after, missed_after = _errors(own, seen.features[later], truth[later])
    doing_now = np.array([place[name] for name in names[rows]], dtype=np.int_)
    return Found(
        session.walks,
        doing_now,
        said.probabilities.argmax(axis=1),
        (said.label == NONE) | (said.novelty >= ABNORMAL_FROM),
        error,
        before,
        after,
        activity.together(said.probabilities)[np.arange(len(doing_now)), doing_now],
        missed_before,
        missed_after,
    )


def _errors(model: Learned, features: npt.NDArray[np.float32], truth: Floats) -> tuple[Floats, Flags]:
    """Return both legs' errors (n, 2), and whether a phase is said that is off by more than a tenth (n,)."""
    verdicts = model.judge(features)
    phases = np.stack([verdicts.values[side] for side in SIDES], axis=1)
    error = metrics.circular_error(phases, truth)
    return error, (verdicts.label != NONE) & (np.abs(error) > WITHIN).any(axis=1)


def _figures(found: Sequence[Found], classes: int) -> dict[str, float]:
    truth, likeliest, unknown = (
        np.concatenate([getattr(one, name) for one in found]) for name in ("truth", "likeliest", "unknown")
    )
    right = truth == likeliest
    return {
        "macro_f1": metrics.macro_f1(truth, likeliest, classes),
        "said_accuracy": float(right[~unknown].mean()) if not unknown.all() else float("nan"),
        "unknown_fraction": float(unknown.mean()),
        "covered": float(np.concatenate([one.covered for one in found]).mean()),
        "rmse_percent": percent(np.concatenate([one.error for one in found]).ravel()),
        "later_rmse_percent": percent(np.concatenate([one.before for one in found]).ravel()),
        "adapted_rmse_percent": percent(np.concatenate([one.after for one in found]).ravel()),
        "later_covered": _covered([one.missed_before for one in found]),
        "adapted_covered": _covered([one.missed_after for one in found]),
        "people": len(found),
    }


def _covered(missed: Sequence[Flags]) -> float:
    every = np.concatenate(missed)
    return float(1.0 - every.mean()) if len(every) else float("nan")


def _adaptation(found: Sequence[Found]) -> dict[str, float]:
    """Errors before and after a minute of the wearer: of all, and of the third that was worst before."""
    pairs = [(percent(one.before.ravel()), percent(one.after.ravel())) for one in found if len(one.before)]
    if not pairs:
        return {}
    worst = sorted(pairs, reverse=True)[: math.ceil(len(pairs) / 3)]
    return _cut("", pairs) | _cut("worst_third_", worst)


def _cut(name: str, pairs: Sequence[tuple[float, float]]) -> dict[str, float]:
    before, after = (float(np.mean(column)) for column in zip(*pairs, strict=True))
    return {
        f"{name}later_rmse_percent": before,
        f"{name}adapted_rmse_percent": after,
        f"{name}adaptation_cut": 1.0 - after / before,
    }
