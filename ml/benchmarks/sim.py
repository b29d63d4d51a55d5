"""The common part of the `sim-*` benchmarks: simulated people in folds, missing sensors, and noise.

They are synthetic: they show what sensors can tell and what breaks it, not how well people are understood.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
import numpy.typing as npt

from ml.benchmarks import folds
from ml.errors import UnusableData
from ml.features.recipe import Recipe
from ml.robot.groups import GROUPS, present, unit
from ml.robot.task import Task
from ml.training import simulated
from ml.training.simulated import Examples, SimulatedSession

FOLDS: Final = 3
MOST: Final = 24_000  # decisions that are learned from and judged: more say no more
WHY: Final = (
    "synthetic: simulated people (gwrms sim-record), judged by models that have not seen them. noise_… are"
    " the same people with sensors of other noise, offsets and delays; no_… and only_… are robots that lack"
    " some sensors."
)
SETTINGS: Final = "fixed in ml/robot/learn.py; --search looks for none"

# By unit: the largest offset and the noise (standard deviation) that somebody else's sensor may have.
_DISTURBED: Final = {"rad": (0.03, 0.005), "N": (20.0, 8.0), "m/s²": (0.3, 0.15), "rad/s": (0.02, 0.03)}
_LATER: Final = 1  # rows by which insoles come behind: 10 ms

T = TypeVar("T")
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Variant:
    """Sensors of a robot, and whether they are as in training."""

    name: str  # before the names of its figures; "" for the whole robot
    groups: tuple[str, ...]
    noisy: bool = False


WHOLE: Final = Variant("", tuple(GROUPS))
NOISE: Final = Variant("noise_", tuple(GROUPS), noisy=True)
NO_FEET: Final = Variant("no_feet_", tuple(name for name in GROUPS if name != "feet"))
NO_TRUNK: Final = Variant("no_trunk_", tuple(name for name in GROUPS if name != "trunk"))
HIPS: Final = Variant("only_hips_", ("hips",))
HIPS_TRUNK: Final = Variant("only_hips_trunk_", ("hips", "trunk"))


def people(path: Path) -> list[SimulatedSession]:
    """Return the sessions of a file.

    Raises `UnusableData` where they are those of fewer than three people.
    """
    sessions = simulated.read(path)
    count = len({session.subject for session in sessions})
    if count < FOLDS:
        raise UnusableData(
            f"{path} holds {count} simulated people: {FOLDS} are needed (gwrms sim-record --subjects 1-12)"
        )
    return sessions


def robot(sessions: Sequence[SimulatedSession], variants: Sequence[Variant]) -> tuple[Variant, list[Variant]]:
    """Return the robot with all common sensors, and those of `variants` that lack some."""
    channels = set(sessions[0].channels).intersection(*(session.channels for session in sessions))
    whole = replace(WHOLE, groups=present(channels))
    return whole, [one for one in variants if set(one.groups) < set(whole.groups)]


def by_walks(seen: Examples, figures: Callable[[Flags], dict[str, float]]) -> dict[str, dict[str, float]]:
    """Return the figures of the rows of each walk; none where all walk alike."""
    names = np.unique(seen.walks)
    return {str(one): figures(seen.walks == one) for one in names} if len(names) > 1 else {}


def recipe_of(task: Task, variant: Variant) -> Recipe:
    """Return the recipe of a robot with these sensors."""
    recipe = task.recipe({channel for group in variant.groups for channel in GROUPS[group]})
    if recipe is None:
        raise UnusableData(f"{task.name} cannot be told from {', '.join(variant.groups)}")
    return recipe


def step_of(recipe: Recipe, sessions: Sequence[SimulatedSession], least: int) -> int:
    """Grid samples between decisions, at least `least`, so that there are at most `MOST`."""
    seconds = sum(np.ptp(session.stamps_ns) / 1e9 for session in sessions)
    return max(least, math.ceil(seconds * recipe.rate_hz / MOST))


def disturbed(sessions: Sequence[SimulatedSession]) -> list[SimulatedSession]:
    """Return the same people, with sensors that have offsets, noise and delays of their own."""
    return [_disturbed(session, number) for number, session in enumerate(sessions)]


def _disturbed(session: SimulatedSession, number: int) -> SimulatedSession:
    random = np.random.default_rng(number)
    values = session.values.copy()
    for column, channel in enumerate(session.channels):
        if channel not in _USED:
            continue
        offset, noise = _DISTURBED[unit(channel)]
        values[:, column] += random.uniform(-offset, offset) + random.normal(0.0, noise, len(values))
        if channel in GROUPS["feet"]:
            values[_LATER:, column] = np.maximum(values[:-_LATER, column], 0.0)
    return replace(session, values=values)


_USED: Final = frozenset(channel for group in GROUPS.values() for channel in group)


def examples_of(task: Task, variant: Variant, sessions: list[SimulatedSession], least: int) -> Examples:
    """Return decisions of all people, as this robot's sensors have them."""
    recipe = recipe_of(task, variant)
    seen = disturbed(sessions) if variant.noisy else sessions
    return simulated.examples(task, recipe, seen, step_of(recipe, sessions, least))


def in_folds(subject: npt.NDArray[np.str_], work: Callable[[folds.Split], T]) -> list[tuple[folds.Split, T]]:
    """`work` on each fold of people."""
    splits = list(folds.grouped(subject, FOLDS))
    return list(zip(splits, folds.over(work, splits), strict=True))
