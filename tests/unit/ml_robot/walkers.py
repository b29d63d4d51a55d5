"""Made-up people: hips that stand, walk and swing at a pace of their own, as features with their truth."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ml.features import features
from ml.robot.groups import GROUPS
from ml.robot.task import TASKS, Task

HIPS = frozenset(GROUPS["hips"])
RATE_HZ = 50
SECONDS = 12
EVERY = 5  # samples between decisions

Array = npt.NDArray[Any]


class Lessons(NamedTuple):
    """What `learn` takes, but for its group: whose rows these are."""

    features: Array
    truth: Array
    group: Array


def hips(activity: str, random: np.random.Generator) -> tuple[Array, Array]:
    """(rows, 2) angles and (rows, 2) phases, NaN where nobody steps."""
    seconds = np.arange(SECONDS * RATE_HZ) / RATE_HZ
    lean = random.normal(0.1, 0.02)
    noise = random.normal(0.0, 0.003, (len(seconds), 2))
    if activity != "walk":
        angle = {"stand": 0.0, "sit": 1.4}[activity]
        return angle + lean + noise, np.full((len(seconds), 2), np.nan)
    left = (seconds / random.uniform(0.9, 1.4) + random.random()) % 1.0
    phase = np.stack([left, (left + 0.5) % 1.0], axis=1)
    return lean + random.uniform(0.3, 0.5) * np.cos(2 * np.pi * phase) + noise, phase


def lessons(
    task: Task, people: Sequence[int], activities: Sequence[str] = ("stand", "walk", "sit")
) -> Lessons:
    """Every person's every activity."""
    recipe = task.recipe(HIPS)
    assert recipe is not None
    parts = []
    for person in people:
        random = np.random.default_rng(person)
        for activity in activities:
            samples, phase = hips(activity, random)
            ends = np.arange(recipe.look_back - 1, len(samples), EVERY)
            truth = np.full(len(ends), activity) if task.fold else phase[ends]
            parts.append((features(recipe, samples, ends), truth, np.full(len(ends), f"person {person}")))
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Lessons(*columns)


ACTIVITY, PHASE = TASKS["activity"], TASKS["gait_phase"]
