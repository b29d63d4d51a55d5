"""One wearer's walk as a lesson: features of what the model was asked, and the truth with hindsight."""

import collections
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import msgspec
import numpy as np

from gateway.client import Batch
from ml.features.recipe import Features
from ml.robot.learned import Learned
from ml.serving.predictor import Window
from server_gui.core.prediction.adaptation import ADAPTED, Tried
from server_gui.core.prediction.model_loading import Model
from server_gui.core.prediction.phase_truth import LATEST_NS, Instant, PhaseTruth

A_DECISION_S: Final = 0.1  # of steps at most, however seldom one is made
SECOND_NS: Final = 1_000_000_000
DIGITS: Final = 8  # of an adapted model's own name


@dataclass(frozen=True, slots=True)
class Row:
    """One decision: its features, and where the legs were."""

    stamp_ns: int
    features: Features  # (1, features)
    instant: Instant


class TrainingData:
    """Rows of steps as they become known. What was before `after_ns` is left out."""

    def __init__(self, base: Model, every_ns: int) -> None:
        self.base = base
        self.rows: list[Row] = []
        self._every_s = min(every_ns / 1e9, A_DECISION_S)
        self._hindsight = PhaseTruth()
        self._waiting: collections.deque[Window] = collections.deque()
        self._after_ns = 0

    @property
    def stepped_s(self) -> float:
        """Seconds of steps."""
        return len(self.rows) * self._every_s

    @property
    def strides(self) -> int:
        """Number of strides of the left leg in the data."""
        return len({row.instant.stride_ns for row in self.rows})

    def ask(self, windows: Sequence[Window]) -> None:
        """Take the inputs of the serving model."""
        self._waiting += windows
        while self._waiting and self._waiting[-1].stamp_ns - self._waiting[0].stamp_ns > LATEST_NS:
            self._waiting.popleft()

    def see(self, batch: Batch) -> None:
        """Take the robot's rows, which show its strides."""
        if not self._hindsight.take(batch):
            return
        told = [(window, self._hindsight.at(window.stamp_ns)) for window in self._waiting]
        self._waiting = collections.deque(window for window, instant in told if instant is None)
        known = [(window, instant) for window, instant in told if instant is not None]
        self._add([one for one in known if one[0].stamp_ns >= self._after_ns])

    def _add(self, known: Sequence[tuple[Window, Instant]]) -> None:
        """Compute the features of these windows, a stride's at once: standing costs nothing."""
        if known:
            found = self.base.learned.recipe.compute(np.concatenate([one.samples for one, _ in known]))
            rows = zip(known, np.split(found, len(found)), strict=True)
            self.rows += [Row(one.stamp_ns, features, instant) for (one, instant), features in rows]

    def turn_page(self) -> None:
        """Forget these rows; none that looks back on one of them comes from now on."""
        recipe = self.base.learned.recipe
        self._after_ns = self.rows[-1].stamp_ns + round(recipe.look_back / recipe.rate_hz * SECOND_NS)
        self.rows = []


def learn(base: Model, robot: str, wearer: str, rows: Sequence[Row], told: Callable[[], None]) -> Model:
    """Return a copy of the model that has learned from these rows, too; no rule may stop a robot by it."""
    from ml.training.adapting import taught  # brings scikit-learn

    learned = taught(base.learned, _features(rows), _truth(rows), told=told)
    name = f"{base.card.id}{ADAPTED}{_digest(robot, learned)}"
    card = msgspec.structs.replace(base.card, id=name, robot=robot, parent=base.card.id)
    objection = f"{name} was learned from its wearer's walk just now, and nobody has promoted it"
    return replace(base, card=card, learned=learned, objection=objection, learned_from=wearer)


def tried(base: Model, adapted: Model, rows: Sequence[Row]) -> tuple[Tried, bool]:
    """Return both models' errors on these rows, and whether the adapted one is to be offered."""
    from ml.training.adapted_comparison import beside

    strides = np.array([row.instant.stride_ns for row in rows], np.int64)
    found = beside(base.learned, adapted.learned, _features(rows), _truth(rows), strides)
    missed = (found.missed_before, found.missed)
    return Tried(found.before, found.after, found.strides, missed), found.is_better


def _features(rows: Sequence[Row]) -> Features:
    return np.concatenate([row.features for row in rows])


def _truth(rows: Sequence[Row]) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
    return np.array([(row.instant.left, row.instant.right) for row in rows], np.float64)


def _digest(robot: str, learned: Learned) -> str:
    parts = [weights.tobytes() for weights in learned.parts["network"].coefs_]
    return hashlib.sha256(b"".join([robot.encode(), *parts])).hexdigest()[:DIGITS]
