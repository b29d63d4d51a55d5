"""Novelty: how far a row of features lies from everything that was learned from.

Two distances, both over what held-out people's rows keep within: to the nearest of many prototypes in the
features' principal components, and out of these components altogether.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.robot.network import Rows

Floats = npt.NDArray[np.float64]
Parts = dict[str, Any]

COMPONENTS: Final = 24
PROTOTYPES: Final = 256
FIT_ROWS: Final = 20_000
FARTHEST: Final = 50.0  # standard deviations of a feature that count
WITHIN: Final = 0.998  # of held-out rows lie within each distance


def fitted(inputs: Rows, seed: int) -> Parts:
    """Components and prototypes of scaled rows: what `distances` needs."""
    from sklearn.cluster import MiniBatchKMeans  # for learning alone
    from sklearn.decomposition import PCA

    random = np.random.default_rng(seed)
    rows = inputs if len(inputs) <= FIT_ROWS else inputs[random.choice(len(inputs), FIT_ROWS, replace=False)]
    rows = np.clip(rows, -FARTHEST, FARTHEST)
    count = min(COMPONENTS, *rows.shape)
    axes = PCA(count, svd_solver="randomized", random_state=seed).fit(rows).components_
    prototypes = MiniBatchKMeans(min(PROTOTYPES, len(rows)), n_init=1, batch_size=1024, random_state=seed)
    centres = prototypes.fit(rows @ axes.T).cluster_centers_
    return {"axes": axes.T.astype(np.float32).copy(), "prototypes": centres.astype(np.float32)}


def distances(parts: Parts, inputs: Rows) -> tuple[Floats, Floats]:
    """(n,) to the nearest prototype, and (n,) out of the components; the same bits row by row."""
    rows = np.clip(inputs, -FARTHEST, FARTHEST)
    place = np.einsum("ij,jk->ik", rows, parts["axes"])
    own = (place * place).sum(axis=1, dtype=np.float64)
    centres = parts["prototypes"]
    along = np.einsum("ij,jk->ik", place, np.ascontiguousarray(centres.T))
    apart = own[:, None] - 2.0 * along + (centres * centres).sum(axis=1, dtype=np.float64)
    out = (rows * rows).sum(axis=1, dtype=np.float64) - own
    return np.sqrt(np.maximum(apart.min(axis=1), 0.0)), np.sqrt(np.maximum(out, 0.0))


def limits(held_out: tuple[Floats, Floats]) -> dict[str, float]:
    """Return the limits that nearly all rows of unseen people keep.

    The numbers for `score`.
    """
    near, out = (float(np.quantile(one, WITHIN)) for one in held_out)
    return {"near": max(near, 1e-6), "out": max(out, 1e-6)}


def score(parts: Parts, numbers: dict[str, float], inputs: Rows) -> Floats:
    """(n,): 1 at the limit of what held-out people do."""
    near, out = distances(parts, inputs)
    farthest: Floats = np.maximum(near / numbers["near"], out / numbers["out"])
    return farthest
