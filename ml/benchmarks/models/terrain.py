"""The ground under a hip exoskeleton: a support vector machine.

Its Laplacian kernel compares feature by feature: one that is off (a place, a strap) spoils the others less
than in a Gaussian one.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt
from sklearn.metrics.pairwise import laplacian_kernel
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

Features = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TerrainSettings:
    """Tuned settings."""

    cost: float = 10.0
    sharpness: float = 2.0  # of the kernel, divided by the number of features


def terrain_model(settings: TerrainSettings | None = None) -> Pipeline:
    """Features of `TERRAIN` → class."""
    tuned = settings or TerrainSettings()
    kernel = partial(_alike, sharpness=tuned.sharpness)
    return make_pipeline(StandardScaler(), SVC(C=tuned.cost, kernel=kernel, class_weight="balanced"))


def _alike(one: Features, other: Features, sharpness: float) -> Features:
    return np.asarray(laplacian_kernel(one, other, gamma=sharpness / one.shape[1]))
