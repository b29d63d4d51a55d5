"""Predictions for robots: live, of many at once, and of a whole recording.

A decision is made at each grid point that is a multiple of `every_ns`, when the window before it has no gap.
Live and over a recording the predictions are the same, bit by bit.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ml.features import FeatureStream, Recipe, features
from ml.features.recipe import Features
from ml.features.windows import Samples
from ml.robot.learned import ABNORMAL_FROM, NONE, Learned
from ml.robot.task import ABNORMAL, UNKNOWN
from ml.serving.grid import Grid, Stamps, on_grid, period_ns

Row = tuple[int, Sequence[float | None]]  # stamp, ns; values in the order of the recipe's channels


@dataclass(frozen=True, slots=True)
class Prediction:
    """Output of `model` for the window that ended at `stamp_ns` of the robot's monotonic clock.

    `label` is a class of the task, UNKNOWN where the model abstains, ABNORMAL where it has learned from
    nothing like this. `probability` is the likeliest class's, also then. `novelty` is 0 for what is as in
    learning, 1 and more for what is abnormal. `values` are further numbers, such as the gait phases "left"
    and "right". `either` are the classes, the likeliest first, of which one is true as far as the model's
    promise goes, where it abstains from saying which; empty elsewhere, and of a recorded prediction.
    """

    task: str
    model: str
    stamp_ns: int
    label: str
    probability: float
    novelty: float
    probabilities: Mapping[str, float]
    values: Mapping[str, float] = field(default_factory=dict)
    either: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """Input of a due decision: (1, channels, look-back) samples, the newest at `stamp_ns`."""

    stamp_ns: int
    samples: Samples


class Windows:
    """One robot's rows → the windows that decisions are due about."""

    def __init__(self, recipe: Recipe, every_ns: int) -> None:
        self._recipe = recipe
        self._every_ns = every_ns
        self._grid = Grid(recipe)
        self._stream = FeatureStream(recipe)
        self._newest_ns = 0
        self._samples = 0  # since the last gap

    def push(self, rows: Iterable[Row]) -> list[Window]:
        """Take rows as they come; a robot that has booted needs new `Windows`."""
        due = []
        for stamp_ns, values in rows:
            for grid_ns, sample in self._grid.push(stamp_ns, values):
                self._take(grid_ns, sample)
                if self._samples >= self._recipe.look_back and grid_ns % self._every_ns == 0:
                    due.append(Window(grid_ns, self._stream.window()))
        return due

    def _take(self, grid_ns: int, sample: Samples) -> None:
        if grid_ns - self._newest_ns != period_ns(self._recipe):
            self._stream, self._samples = FeatureStream(self._recipe), 0
        self._stream.push(sample)
        self._newest_ns = grid_ns
        self._samples += 1


def judged(model: str, learned: Learned, windows: Sequence[Window]) -> list[Prediction]:
    """Return a prediction for each window, of whichever robot; judged together."""
    if not windows:
        return []
    samples = np.concatenate([window.samples for window in windows])
    return _predictions(
        model, learned, [window.stamp_ns for window in windows], learned.recipe.compute(samples)
    )


def replayed(
    model: str, learned: Learned, stamps_ns: Stamps, values: Samples, every_ns: int
) -> list[Prediction]:
    """Return the predictions that there were, or would have been, of a recording.

    `stamps_ns` (rows,) and `values` (rows, channels in the recipe's order, NaN: missing), of one boot.
    """
    recipe = learned.recipe
    found = []
    for grid_ns, samples in on_grid(recipe, stamps_ns, values):
        ends = np.flatnonzero(grid_ns % every_ns == 0)
        ends = ends[ends >= recipe.look_back - 1]
        if len(ends):
            found += _predictions(model, learned, grid_ns[ends].tolist(), features(recipe, samples, ends))
    return found


def _predictions(model: str, learned: Learned, stamps_ns: Sequence[int], rows: Features) -> list[Prediction]:
    verdicts = learned.judge(rows)
    values = {name: column.tolist() for name, column in verdicts.values.items()}
    columns = zip(
        stamps_ns,
        verdicts.label.tolist(),
        verdicts.novelty.tolist(),
        verdicts.probabilities.tolist(),
        strict=True,
    )
    return [
        Prediction(
            learned.task.name,
            model,
            stamp_ns,
            _label(learned.classes, label, novelty),
            max(probabilities),
            novelty,
            dict(zip(learned.classes, probabilities, strict=True)),
            {name: column[at] for name, column in values.items()},
            _either(learned, probabilities) if label == NONE and novelty < ABNORMAL_FROM else (),
        )
        for at, (stamp_ns, label, novelty, probabilities) in enumerate(columns)
    ]


def _either(learned: Learned, probabilities: Sequence[float]) -> tuple[str, ...]:
    """In the order of their probabilities; of a phase there is but one class to say."""
    if not learned.task.fold:
        return ()
    there = learned.together(np.array([probabilities]))[0].tolist()
    found = sorted(zip(probabilities, learned.classes, there, strict=True), key=lambda one: -one[0])
    return tuple(name for _, name, is_there in found if is_there)


def _label(classes: Sequence[str], label: int, novelty: float) -> str:
    if novelty >= ABNORMAL_FROM:
        return ABNORMAL
    return UNKNOWN if label == NONE else classes[label]
