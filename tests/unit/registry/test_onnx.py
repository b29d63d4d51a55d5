"""Models as ONNX: they say what scikit-learn says, or are not given out."""

import dataclasses
import importlib.util

import numpy as np
import pytest

from ml.errors import UnusableModel
from ml.registry import onnx
from ml.robot.task import TASKS
from tests.unit.registry.models import features, learned

needs_extra = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in onnx.NEEDED),
    reason="no extra onnx",
)


@needs_extra
@pytest.mark.parametrize("task", ["falling", "activity"])
def test_probabilities_agree_with_scikit_learn(task: str) -> None:
    model = learned(task)
    rows, _ = features(task, seed=7)
    rows[::3] *= 5  # far out, where they are cut off
    found = onnx.probabilities(onnx.exported(model), rows)
    np.testing.assert_allclose(found, model.judge(rows).probabilities, atol=1e-5)
    assert np.unique(found.argmax(axis=1)).size == len(model.classes)


@needs_extra
def test_a_file_that_says_something_else_is_not_given_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(onnx, "_cut_off", lambda graph: None)
    with pytest.raises(UnusableModel, match="says something else"):
        onnx.exported(learned())


def test_only_classifiers_become_onnx() -> None:
    phase = dataclasses.replace(learned(), task=TASKS["gait_phase"], numbers={"threshold": 0.5})
    with pytest.raises(UnusableModel, match="gait_phase is no classifier"):
        onnx.exported(phase)


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "skl2onnx" else find(name))
    with pytest.raises(UnusableModel, match=r"needs skl2onnx, .*gwrms\[onnx\]"):
        onnx.exported(learned())
