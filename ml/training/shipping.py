"""The models that come with GWRMS: learned from simulated wearers, for robots that have learned nothing yet.

`./dev models` makes them again: python -m ml.training.shipping RECORDING, which `gwrms sim-record` wrote. It
may be several, one behind the other, of wearers who walk in different ways.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from ml.features.recipe import Recipe
from ml.registry.card import Card, DataSource
from ml.registry.code import features_hash, versions
from ml.registry.registry import SHIPPED, Registry
from ml.robot.groups import unit
from ml.robot.learn import learn
from ml.robot.task import TASKS, Task
from ml.store.labels import LabelSource
from ml.training.dataset import RANGE, Ask, SessionDecisions
from ml.training.judging import judge
from ml.training.simulated import SimulatedSession, examples, read, stepping

SEED: Final = 0
HELD_OUT: Final = 4  # one person in so many of those who walk alike
STEPS: Final = {"activity": 10, "gait_phase": 10, "falling": 2}  # grid samples between decisions
STEADY_SHARE: Final = 6  # one decision in so many is learned from where nothing happens: they are alike
NOTES: Final = (
    "Learned from simulated wearers, some of whom are slow, impaired or on crutches: right for the simulated "
    "robot, and a beginning for one of its kind. A robot's own sessions make a better one: gwrms train."
)


@dataclass(frozen=True, slots=True)
class Shipped:
    """One model that was made: its id, and its figures on simulated people that it has not seen."""

    model: str
    figures: dict[str, float]


def ship(recording: Path, folder: Path = SHIPPED) -> list[Shipped]:
    """Make a model of every task for a robot with every sensor, into `folder`.

    Raises:
        UnusableData: the recording is none of `gwrms sim-record`, or too small.
        UnusableModel: another model is in the way.

    """
    folder.mkdir(parents=True, exist_ok=True)
    registry = Registry(folder.resolve().as_uri())
    sessions = read(recording)
    with threadpool_limits(1):  # the same bits on every computer
        return [_ship(registry, task, sessions) for task in TASKS.values()]


def held_out(sessions: Sequence[SimulatedSession]) -> set[str]:
    """Return the people kept for judging; those who also walk in another way are left out of that, too."""
    by_walks: dict[str, set[str]] = {}
    for session in sessions:
        by_walks.setdefault(session.walks, set()).add(session.subject)
    return {one for alike in by_walks.values() for one in sorted(alike, key=int)[HELD_OUT - 1 :: HELD_OUT]}


def _ship(registry: Registry, task: Task, sessions: Sequence[SimulatedSession]) -> Shipped:
    recipe = task.recipe(frozenset(sessions[0].channels))
    if recipe is None:
        raise ValueError(f"no recipe of {task.name} for {', '.join(sessions[0].channels)}")
    held = held_out(sessions)
    parts = [_part(task, recipe, session) for session in sessions]
    lessons = [_thinned(part) for part in parts if part.group not in held]
    judges = [part for part in parts if part.group in held]
    learned = learn(
        task,
        recipe,
        np.concatenate([part.features for part in lessons]),
        np.concatenate([part.truth for part in lessons]),
        np.concatenate([np.full(len(part.truth), part.group) for part in lessons]),
        SEED,
    )
    metrics = judge("held-out people", learned, judges, None, []).new
    card = Card(
        task=task.name,
        recipe=recipe.name,
        classes=learned.classes,
        channels=recipe.channels,
        units={name: unit(name) for name in recipe.channels},
        ranges=_ranges(recipe, lessons),
        features_hash=features_hash(recipe),
        source=DataSource.SIMULATED,
        seed=SEED,
        made=datetime.now(UTC),
        versions=versions(),
        learned=tuple(part.ask.session for part in lessons),
        held_out=tuple(part.ask.session for part in judges),
        metrics=metrics,
        notes=NOTES,
    )
    return Shipped(registry.publish(learned.state(), card), dict(metrics.figures))


def _part(task: Task, recipe: Recipe, session: SimulatedSession) -> SessionDecisions:
    """One simulated session as decisions, like those of a recorded one."""
    found = examples(task, recipe, [session], STEPS[task.name])
    truth: npt.NDArray[Any]
    if task.fold:
        truth = np.array([task.fold.get(label, "") for label in found.label])
        known = truth != ""
    else:
        truth, known = stepping(found.label, found.phase)
    part = SessionDecisions(
        Ask("", {}, "", session.name, recipe.name),
        session.subject,
        False,
        found.features,
        truth,
        np.full(len(truth), LabelSource.SIMULATOR.value),
        found.time_ns,
        np.quantile(session.of(recipe.channels), RANGE, axis=0).T,
    )
    return part.of(known)


def _thinned(part: SessionDecisions) -> SessionDecisions:
    """Return the training data: of falling's many steady decisions a few."""
    steady = part.truth == "steady" if part.truth.ndim == 1 else np.zeros(len(part.truth), dtype=bool)
    return part.of(~steady | (np.arange(len(part.truth)) % STEADY_SHARE == 0))


def _ranges(recipe: Recipe, lessons: Sequence[SessionDecisions]) -> dict[str, tuple[float, float]]:
    low = np.min([part.ranges[:, 0] for part in lessons], axis=0)
    high = np.max([part.ranges[:, 1] for part in lessons], axis=0)
    return {name: (float(a), float(b)) for name, a, b in zip(recipe.channels, low, high, strict=True)}


if __name__ == "__main__":
    for one in ship(Path(sys.argv[1])):
        figures = ", ".join(f"{name} {value:.4g}" for name, value in one.figures.items())
        sys.stdout.write(f"{one.model}: {figures}\n")
