"""Small models for tests, learned from made-up features, and their cards."""

import functools
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from ml.registry.card import Card, DataSource
from ml.registry.code import features_hash, versions
from ml.robot import learn as learning
from ml.robot.groups import GROUPS
from ml.robot.learn import learn
from ml.robot.learned import Learned
from ml.robot.task import TASKS

CHANNELS = frozenset(GROUPS["trunk"])
ROWS = 240


def features(task: str = "falling", seed: int = 0) -> tuple[Any, Any]:
    """(n, columns) features of the trunk's recipe, and the classes (n,) that they are about."""
    recipe = TASKS[task].recipe(CHANNELS)
    assert recipe is not None
    columns = recipe.compute(np.zeros((1, len(recipe.channels), recipe.look_back))).shape[1]
    random = np.random.default_rng(seed)
    truth = np.arange(ROWS) % len(TASKS[task].classes(recipe))
    rows = random.normal(size=(ROWS, columns)) * np.geomspace(0.1, 30, columns) + truth[:, None]
    return rows.astype(np.float32), np.array(TASKS[task].classes(recipe))[truth]


@functools.cache
def learned(task: str = "falling", seed: int = 0) -> Learned:
    recipe = TASKS[task].recipe(CHANNELS)
    assert recipe is not None
    rows, truth = features(task, seed)
    with threadpool_limits(1), pytest.MonkeyPatch.context() as patch:
        patch.setattr(learning, "EPOCHS", 2)  # how well it has learned does not matter
        return learn(TASKS[task], recipe, rows, truth, np.arange(ROWS) % 3, seed)


def card(model: Learned, **changes: Any) -> Card:
    fields: dict[str, Any] = {
        "task": model.task.name,
        "recipe": model.recipe.name,
        "classes": model.classes,
        "channels": model.recipe.channels,
        "units": dict.fromkeys(model.recipe.channels, "m/s²"),
        "features_hash": features_hash(model.recipe),
        "source": DataSource.RECORDED,
        "seed": 0,
        "made": datetime.now(UTC),
        "versions": versions(),
    }
    return Card(**(fields | changes))
