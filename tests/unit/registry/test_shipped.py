"""The models that come with GWRMS: loaded as they lie there, by the code that is here."""

import numpy as np
import pytest

from ml.features import FeatureStream
from ml.registry.card import DataSource
from ml.registry.registry import SHIPPED, Registry
from ml.robot.groups import GROUPS
from ml.robot.learned import Learned
from ml.robot.task import TASKS

EVERY_CHANNEL = frozenset(channel for channels in GROUPS.values() for channel in channels)


@pytest.mark.parametrize("task", TASKS)
def test_a_robot_with_every_sensor_is_served(task: str, folder_url: str) -> None:
    """Where this fails since features changed: `./dev models` makes them anew."""
    registry = Registry(folder_url)
    model = registry.serving(task, "exo-01", EVERY_CHANNEL)
    assert model in registry.shipped()
    card, state = registry.load(model)
    assert (card.task, card.source) == (task, DataSource.SIMULATED)
    assert "simulated" in card.notes
    assert card.held_out
    learned = Learned.restored(state)
    stream = FeatureStream(learned.recipe)
    stream.push(np.zeros(len(learned.recipe.channels)))
    assert np.isfinite(learned.judge(stream.features()).probabilities).all()


def test_nothing_else_lies_there(folder_url: str) -> None:
    registry = Registry(folder_url)
    assert not registry.damaged()
    expected = {f"{card.id}/{name}" for card in registry.entries() for name in (*card.sha256, "model.json")}
    folder = SHIPPED / "models"
    assert {str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()} == expected
