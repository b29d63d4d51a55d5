"""A robot with hips alone that stands or walks, and a small model that has learned to tell that."""

import functools

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from ml.features import features
from ml.robot import learn
from ml.robot.learned import Learned
from ml.robot.task import TASKS

MS = 1_000_000
CHANNELS = ("left_hip.position", "right_hip.position")
STEP_MS = 10  # between a robot's rows
Floats = npt.NDArray[np.float64]


def hips(seconds: float, walks: bool, seed: int = 0, begin_s: float = 0.0, noise_rad: float = 0.01) -> Floats:
    """(rows, 2) of a robot that sends 100 rows a second, rad; strides of 1 s, as those of the fake robot."""
    time_s = begin_s + np.arange(round(seconds * 1000 / STEP_MS)) * STEP_MS / 1000
    swing = 0.4 * np.sin(2 * np.pi * time_s + np.array([[0.0], [np.pi]])).T
    noise = np.random.default_rng(seed).normal(0, noise_rad, (len(time_s), 2))
    rows: Floats = (swing if walks else 0.0) + noise
    return rows


@functools.cache
def learned() -> Learned:
    """Standing and walking, learned from four who do so."""
    task = TASKS["activity"]
    recipe = task.recipe(set(CHANNELS))
    assert recipe is not None
    x, truth, who = [], [], []
    for walks, name in ((False, "stand"), (True, "walk")):
        for person in range(4):
            noise_rad = 0.006 * (person + 1)
            samples = hips(12.0, walks, seed=person, noise_rad=noise_rad)[
                :: round(1000 / recipe.rate_hz / STEP_MS)
            ]
            rows = features(recipe, samples, np.arange(recipe.look_back, len(samples), 5))
            x.append(rows)
            truth += [name] * len(rows)
            who += [person] * len(rows)
    with threadpool_limits(1):
        return learn.learn(task, recipe, np.concatenate(x), np.array(truth), np.array(who))
