"""Blocks: signals of windows → feature columns, the newest sample last."""

import numpy as np
import numpy.typing as npt

from ml.features.windows import Samples


def flat(values: Samples) -> Samples:
    """(n, …) → (n, columns)."""
    return values.reshape(len(values), -1)


def bins(signals: Samples, width: int, count: int) -> Samples:
    """(n, signals, samples) → means over the newest `count` stretches of `width` samples: their shape."""
    newest = signals[..., -width * count :]
    return flat(newest.reshape(*newest.shape[:-1], count, width).mean(axis=-1))


def moments(signals: Samples, *lengths: int) -> Samples:
    """(n, signals, samples) → mean, standard deviation, largest, smallest over the newest of each length.

    The lengths grow: what is largest of fewer samples is compared with those before them alone.
    """
    columns = np.empty((len(signals), len(lengths), 4, signals.shape[1]))
    for at, length in enumerate(lengths):
        newest = signals[..., -length:]
        mean = newest.mean(axis=-1)
        columns[:, at, 0], columns[:, at, 1] = mean, deviation(newest, mean[..., None])
    begins = [max(signals.shape[-1] - length, 0) for length in reversed(lengths)]
    for at, farthest in ((2, np.maximum), (3, np.minimum)):
        apart = farthest.reduceat(signals, begins, axis=-1)[..., ::-1]
        columns[:, :, at] = farthest.accumulate(apart, axis=-1).swapaxes(1, 2)
    return flat(columns)


def deviation(signals: Samples, mean: Samples) -> Samples:
    """Return the standard deviation over the last axis, of which the mean is known.

    Numpy would compute it again.
    """
    apart = signals - mean
    np.multiply(apart, apart, out=apart)
    spread: Samples = np.sqrt(apart.mean(axis=-1))
    return spread


def since(condition: npt.NDArray[np.bool_]) -> Samples:
    """(n, samples) → how many samples ago it last held; the window's length where it never did."""
    ago = condition[:, ::-1].argmax(axis=1)
    samples: Samples = np.where(condition.any(axis=1), ago, condition.shape[1]).astype(np.float64)
    return samples


def falls(condition: npt.NDArray[np.bool_], count: int) -> Samples:
    """(n, samples) → how many samples ago it last ceased to hold, and before that; the length if never."""
    edge = (condition[:, :-1] & ~condition[:, 1:])[:, ::-1]
    ago = np.arange(edge.shape[1])
    columns = []
    for _ in range(count):
        newest = edge.argmax(axis=1)
        columns.append(np.where(edge.any(axis=1), newest, condition.shape[1]))
        edge = edge & (ago > newest[:, None])
    return np.stack(columns, axis=1).astype(np.float64)
