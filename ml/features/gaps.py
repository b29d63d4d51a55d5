"""Samples that never came: what a window is taken to hold there. Missing is NaN, never zero."""

import numpy as np

from ml.features.windows import Samples


def mended(windows: Samples) -> Samples:
    """Windows (…, samples) without NaN: a straight line over a gap, and the value before it while it lasts.

    A gap that is not over at the newest sample holds what came before; one at the oldest, what comes after.
    Nothing after the newest sample is needed. A channel without any sample in its window stays NaN.
    """
    if not np.isnan(windows.min()):  # NaN where any is: quicker than to ask each
        return windows
    missing = np.isnan(windows)
    count = windows.shape[-1]
    at = np.arange(count)
    last = np.maximum.accumulate(np.where(missing, -1, at), axis=-1)
    later = np.minimum.accumulate(np.where(missing, count, at)[..., ::-1], axis=-1)[..., ::-1]
    before = np.where(last < 0, np.minimum(later, count - 1), last)
    after = np.where(later == count, before, later)
    begin, end = (np.take_along_axis(windows, place, axis=-1) for place in (before, after))
    share = (at - before) / np.maximum(after - before, 1)
    filled: Samples = np.where(missing, begin + (end - begin) * share, windows)
    return filled
