"""An adapted gait phase beside the model that it comes from, on strides that neither has learned from."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.recipe import Features
from ml.robot.learned import NONE, Learned
from ml.robot.task import SIDES

MARGIN: Final = 0.05  # of the error, that must be gone at least
SURE: Final = 0.95  # how sure that must be
BLOCK: Final = 4  # strides that follow each other are alike, and are drawn together
DRAWS: Final = 2000
MOST_ABSTAINED: Final = 0.1  # more of the decisions than the general model

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Beside:
    """RMS errors of both in % of the cycle. `left` is the share of the error that stays, at the worst."""

    before: float
    after: float
    strides: int
    left: float  # upper end of the one-sided interval of after / before
    more_unsaid: float  # of the decisions, more than before

    @property
    def is_better(self) -> bool:
        """Whether enough of the error is surely gone, and not by saying less."""
        return self.left < 1.0 - MARGIN and self.more_unsaid <= MOST_ABSTAINED


def beside(
    general: Learned,
    adapted: Learned,
    features: Features,
    truth: Floats,
    stride: npt.NDArray[np.int64],
    seed: int = 0,
) -> Beside:
    """Judge both on n decisions in time's order: `truth` (n, 2) phases, `stride` (n,) that each is of."""
    before, its_unsaid = _squares(general, features, truth)
    after, unsaid = _squares(adapted, features, truth)
    starts = np.flatnonzero(np.diff(stride, prepend=stride[0] - 1))
    sums = np.stack([np.add.reduceat(each, starts) for each in (before, after)])
    blocks = _blocks(len(starts), seed)
    drawn = sums[:, blocks].sum(axis=2)
    return Beside(
        100.0 * float(np.sqrt(before.mean())),
        100.0 * float(np.sqrt(after.mean())),
        len(starts),
        float(np.quantile(np.sqrt(drawn[1] / np.maximum(drawn[0], 1e-12)), SURE)),
        unsaid - its_unsaid,
    )


def _squares(learned: Learned, features: Features, truth: Floats) -> tuple[Floats, float]:
    """The squared error of each decision (n,), over both legs; the share of those that are not said."""
    found = learned.judge(features)
    phases = np.stack([found.values[side] for side in SIDES], axis=1)
    error = (phases - truth + 0.5) % 1.0 - 0.5
    return (error * error).mean(axis=1), float((found.label == NONE).mean())


def _blocks(strides: int, seed: int) -> npt.NDArray[np.intp]:
    """Which strides are drawn (DRAWS, about strides): moving blocks, round the end."""
    count = -(-strides // BLOCK)
    begins = np.random.default_rng(seed).integers(0, strides, (DRAWS, count, 1))
    return ((begins + np.arange(min(BLOCK, strides))) % strides).reshape(DRAWS, -1)
