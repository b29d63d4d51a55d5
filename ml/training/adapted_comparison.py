"""An adapted gait phase beside the model that it comes from, on strides that neither has learned from."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.recipe import Features
from ml.robot.conformal import Flags
from ml.robot.learn import WITHIN
from ml.robot.learned import NONE, Learned
from ml.robot.task import SIDES

MARGIN: Final = 0.05  # of the error, that must be gone at least
SURE: Final = 0.95  # how sure that must be
BLOCK: Final = 4  # strides that follow each other are alike, and are drawn together
DRAWS: Final = 2000
MOST_ABSTAINED: Final = 0.1  # more of the decisions than the general model

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AdaptedComparison:
    """RMS errors of both in % of the cycle. `left` is the share of the error that stays, at the worst."""

    before: float
    after: float
    strides: int
    left: float  # upper end of the one-sided interval of after / before
    more_unsaid: float  # of the decisions, more than before
    missed_before: float  # of the decisions: something is said, and a leg is further off than a tenth
    missed: float

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
) -> AdaptedComparison:
    """Judge both on n decisions in time's order: `truth` (n, 2) phases, `stride` (n,) that each is of."""
    before, its_unsaid, missed_before = _squares(general, features, truth)
    after, unsaid, missed = _squares(adapted, features, truth)
    starts = np.flatnonzero(np.diff(stride, prepend=stride[0] - 1))
    sums = np.stack([np.add.reduceat(each, starts) for each in (before, after)])
    blocks = _blocks(len(starts), seed)
    drawn = sums[:, blocks].sum(axis=2)
    return AdaptedComparison(
        100.0 * float(np.sqrt(before.mean())),
        100.0 * float(np.sqrt(after.mean())),
        len(starts),
        float(np.quantile(np.sqrt(drawn[1] / np.maximum(drawn[0], 1e-12)), SURE)),
        float(unsaid.mean() - its_unsaid.mean()),
        float(missed_before.mean()),
        float(missed.mean()),
    )


def _squares(learned: Learned, features: Features, truth: Floats) -> tuple[Floats, Flags, Flags]:
    """Return for each decision (n,) the squared error over both legs, and whether it abstains or errs."""
    found = learned.judge(features)
    phases = np.stack([found.values[side] for side in SIDES], axis=1)
    error = (phases - truth + 0.5) % 1.0 - 0.5
    unsaid = found.label == NONE
    return (error * error).mean(axis=1), unsaid, ~unsaid & (np.abs(error) > WITHIN).any(axis=1)


def _blocks(strides: int, seed: int) -> npt.NDArray[np.intp]:
    """Draw strides (DRAWS, about strides): moving blocks, round the end."""
    count = -(-strides // BLOCK)
    begins = np.random.default_rng(seed).integers(0, strides, (DRAWS, count, 1))
    return ((begins + np.arange(min(BLOCK, strides))) % strides).reshape(DRAWS, -1)
