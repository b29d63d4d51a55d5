"""A trained model of one task: scikit-learn's parts and numbers, and their predictions from features.

A row is judged by itself: alone, among a thousand or live, its verdict has the same bits.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.features.recipe import Features, Recipe
from ml.robot import novelty
from ml.robot.conformal import together
from ml.robot.network import Rows, outputs
from ml.robot.task import SIDES, TASKS, Task

Floats = npt.NDArray[np.float64]

NONE: Final = -1  # the label of a row of which the model says "unknown"
ABNORMAL_FROM: Final = (
    1.0  # the novelty from which on a row is like nothing that was learned from: "abnormal"
)


@dataclass(frozen=True, slots=True, eq=False)
class Verdicts:
    """Output for n rows.

    `probabilities` (n, classes) are calibrated. `label` (n,) is an index into the classes, or NONE where the
    model abstains. `novelty` (n,) is 0 for what is as in learning; abnormal begins at ABNORMAL_FROM.
    `values` are further numbers: for gait_phase the phases "left" and "right", 0 (heel strike) to 1.
    """

    probabilities: Floats
    label: npt.NDArray[np.int_]
    novelty: Floats
    values: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """One model.

    `parts`: `scale`, a StandardScaler; `network`, an MLPClassifier, or for gait_phase an MLPRegressor of both
    legs' cosine and sine, of length 0 where nobody steps; `length` and `trust` (k,), which make their shorter
    length a probability; `axes` and `prototypes` for the novelty. `numbers`: `temperature` of a classifier,
    `threshold` of the probability below which it abstains, and what it promises: that of `covered` of his
    decisions the truth is within what is said, for a share of new `wearers` (older models promise nothing);
    `near` and `out` for the novelty.
    """

    task: Task
    recipe: Recipe
    classes: tuple[str, ...]
    parts: dict[str, Any]
    numbers: dict[str, float]

    def state(self) -> dict[str, Any]:
        """Everything, as a plain dict for a file."""
        return {
            "task": self.task.name,
            "recipe": self.recipe.name,
            "classes": list(self.classes),
            "parts": dict(self.parts),
            "numbers": dict(self.numbers),
        }

    @classmethod
    def restored(cls, state: Mapping[str, Any]) -> "Learned":
        """Return the model of `state`; raises `UnusableModel` if that is no model of ours."""
        from ml.robot.checks import check  # brings scikit-learn, whose objects these are

        check(state)
        task = TASKS[state["task"]]
        recipe = task.named(state["recipe"])
        return cls(task, recipe, tuple(state["classes"]), dict(state["parts"]), dict(state["numbers"]))

    def judge(self, features: Features) -> Verdicts:
        """Judge rows (n, features) of the recipe."""
        inputs = scaled(self.parts["scale"], features)
        found = outputs(self.parts["network"], inputs)
        unlike = novelty.score(self.parts, self.numbers, inputs)
        if self.task.fold:
            probabilities = softmax(scores(found) / self.numbers["temperature"])
            return Verdicts(probabilities, self._labels(probabilities), unlike)
        phases, lengths = on_circle(found)
        probabilities = np.interp(lengths.min(axis=1), self.parts["length"], self.parts["trust"])[:, None]
        values = dict(zip(SIDES, phases.T, strict=True))
        return Verdicts(probabilities, self._labels(probabilities), unlike, values)

    def together(self, probabilities: Floats) -> npt.NDArray[np.bool_]:
        """Return the classes (n, classes) of which one is true, as far as the model's promise goes."""
        return together(probabilities, self.numbers["threshold"])

    def _labels(self, probabilities: Floats) -> npt.NDArray[np.int_]:
        sure = probabilities.max(axis=1) >= self.numbers["threshold"]
        return np.where(sure, probabilities.argmax(axis=1), NONE)


def scaled(scale: Any, features: Features) -> Rows:
    """Features in standard deviations of what was learned from."""
    inputs: Rows = ((features - scale.mean_) / scale.scale_).astype(np.float32)
    return inputs


def scores(found: Rows) -> Floats:
    """(n, classes) of a classifier's outputs, which are one column where there are two classes."""
    doubles = found.astype(np.float64)
    return doubles if found.shape[1] > 1 else np.concatenate([np.zeros_like(doubles), doubles], axis=1)


def softmax(scores: Floats) -> Floats:
    powers: Floats = np.exp(scores - scores.max(axis=1, keepdims=True))
    shares: Floats = powers / powers.sum(axis=1, keepdims=True)
    return shares


def on_circle(found: Rows) -> tuple[Floats, Floats]:
    """Phases (n, 2) from 0 up to 1 and their pointers' lengths (n, 2), of cosine and sine of each leg."""
    pointers = found.astype(np.float64).reshape(len(found), 2, 2)
    phases = np.arctan2(pointers[..., 1], pointers[..., 0]) / (2.0 * np.pi) % 1.0
    return phases, np.sqrt((pointers * pointers).sum(axis=-1))
