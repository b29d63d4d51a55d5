"""Models as ONNX: they say what scikit-learn says, or are not given out."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from ml.errors import UnusableModel
from ml.features import features as windows
from ml.features.recipe import Features
from ml.registry import onnx
from ml.registry.registry import Registry
from ml.robot.learned import NONE, Learned
from ml.training.simulated import TRUTH
from tests.unit.ml_robot import recorded
from tests.unit.registry.models import features, learned

needs_extra = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in onnx.NEEDED),
    reason="no extra onnx",
)


@pytest.fixture
def phase(tmp_path: Path) -> Learned:
    """The model of gait phases that comes with GWRMS."""
    registry = Registry((tmp_path / "store").as_uri())
    (card,) = registry.entries("gait_phase")
    return Learned.restored(registry.load(card.id)[1])


def of_a_walker(model: Learned) -> Features:
    """What somebody who stands, walks, stumbles and falls gives the model."""
    _, *rows = recorded.lines(3, rounds=1)
    first = len(TRUTH)
    at = [first + recorded.CHANNELS.index(channel) for channel in model.recipe.channels]
    samples = np.array([[row[column] for column in at] for row in rows[:: recorded.HZ // 50]])
    return windows(model.recipe, samples, np.arange(model.recipe.look_back - 1, len(samples), 3))


@needs_extra
@pytest.mark.parametrize("task", ["falling", "activity"])
def test_probabilities_agree_with_scikit_learn(task: str) -> None:
    model = learned(task)
    rows, _ = features(task, seed=7)
    rows[::3] *= 5  # far out, where they are cut off
    found = onnx.said(onnx.exported(model), rows)["probabilities"]
    np.testing.assert_allclose(found, model.judge(rows).probabilities, atol=1e-5)
    assert np.unique(found.argmax(axis=1)).size == len(model.classes)


@needs_extra
def test_phases_agree_with_scikit_learn(phase: Learned) -> None:
    rows = of_a_walker(phase)
    verdicts = phase.judge(rows)
    data = onnx.exported(phase)
    found = onnx.said(data, rows)
    steps = verdicts.label != NONE
    assert 50 < steps.sum() < len(rows)
    both = np.stack([verdicts.values["left"], verdicts.values["right"]], axis=1)
    apart = (found["phases"] - both + 0.5) % 1.0 - 0.5
    np.testing.assert_allclose(apart[steps], 0.0, atol=1e-5)
    assert np.ptp(found["phases"][steps], axis=0).min() > 0.9  # all round
    np.testing.assert_allclose(found["probabilities"], verdicts.probabilities, atol=1e-3)
    assert onnx.differs(phase, data, rows) < 1e-5


@needs_extra
@pytest.mark.parametrize("part", ["length", "trust"])
def test_a_phase_that_is_sure_of_something_else_differs(phase: Learned, part: str) -> None:
    data = onnx.exported(phase)
    phase.parts[part] = phase.parts[part] * 0.99
    assert onnx.differs(phase, data, of_a_walker(phase)) > 1e-3


@needs_extra
@pytest.mark.parametrize("task", ["falling", "gait_phase"])
def test_a_file_that_says_something_else_is_not_given_out(
    task: str, phase: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onnx, "cut_off", lambda graph: None)
    with pytest.raises(UnusableModel, match="says something else"):
        onnx.exported(learned() if task == "falling" else phase)


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "skl2onnx" else find(name))
    with pytest.raises(UnusableModel, match=r"needs skl2onnx, .*gwrms\[onnx\]"):
        onnx.exported(learned())
