"""The format of SisFall (Sucerquia et al. 2017): an IMU at the waist, daily activities and falls."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks.arrays import Arrays
from ml.features.falling import RATE_HZ

CHANNELS: Final = ("acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z")
FEWEST: Final = 3  # subjects: to judge by, to learn from, and to find a threshold with
STUMBLE: Final = "D18"  # stumbling while walking: neither a fall nor quite daily life


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One activity of one subject."""

    subject: str
    activity: str  # D…: daily life; F…: a fall
    samples: npt.NDArray[np.float64]  # (rows, 6), m/s² and rad/s
    impact: int | None  # the sample at which a fall hits the ground


def read(path: Path) -> list[Recording]:
    """Return the file's recordings.

    Raises:
        UnusableData: it is not such a file, or has samples that cannot be.

    """
    file = Arrays(path)
    file.rate(RATE_HZ)
    samples = file.samples(CHANNELS)
    file.gravity(samples[:, :3], "the waist's")
    activities = file.of("rec_activity", 1)
    rows = len(activities)
    subjects, starts, lengths, peaks = (
        file.of(f"rec_{name}", 1, rows) for name in ("subject", "start", "len", "peak_acc_index")
    )
    if rows and (starts.min() < 0 or lengths.min() < 1 or (starts + lengths).max() > len(samples)):
        raise file.problem("has recordings that begin or end outside of its samples, or are empty")
    recordings = []
    for activity, subject, start, length, peak in zip(
        activities, subjects, starts, lengths, peaks, strict=True
    ):
        fall = str(activity).startswith("F")
        if fall and not 0 <= peak < length:
            raise file.problem(f"has a fall {activity} of {subject} whose impact {peak} is outside of it")
        own = samples[start : start + length]
        recordings.append(Recording(str(subject), str(activity), own, int(peak) if fall else None))
    if len({recording.subject for recording in recordings}) < FEWEST:
        raise file.problem(f"has fewer than {FEWEST} subjects: nobody is left to find a threshold with")
    if len({recording.impact is None for recording in recordings}) < 2:
        raise file.problem("needs both falls (F…) and daily activities (D…)")
    return recordings
