"""The format of IPOL 2023/497: IMUs at the low back and on both feet, walked there and back, labelled."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import losses
from ml.benchmarks.arrays import Arrays
from ml.features.gait_status import RATE_HZ
from ml.features.gaps import mended

STATUSES: Final = ("stand", "walk", "turn")
WALK: Final = STATUSES.index("walk")
CHANNELS: Final = tuple(
    f"{part}_{quantity}_{axis}"
    for part in ("lowback", "lfoot", "rfoot")
    for quantity in ("acc", "gyr")
    for axis in "xyz"
)
TURN: Final = STATUSES.index("turn")
RATES: Final = [at for at, channel in enumerate(CHANNELS) if "_gyr_" in channel]
SENSORS: Final = (6, 6, 6)  # channels of low back, left and right foot
LONGEST: Final = 50  # rows: what is held for longer is taken as the file has it
STRIDE_S: Final = (0.7, 2.0)  # shorter and longer ones are no strides of a walk


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One walk of one subject."""

    subject: int
    number: int
    samples: npt.NDArray[np.float64]  # (rows, 18), m/s² and rad/s; NaN where a packet was lost
    status: npt.NDArray[np.int_]  # index into STATUSES
    in_air: tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]  # left and right foot


def read(path: Path) -> list[Trial]:
    """Return the file's trials, subject by subject, in their order.

    Raises:
        UnusableData: it is not such a file, or has samples that cannot be.

    """
    file = Arrays(path)
    file.rate(RATE_HZ)
    samples = file.samples(CHANNELS)
    file.gravity(samples[:, :3], "the low back's")
    rows = len(samples)
    names = [str(name) for name in file.of("status_names", 1)]
    if names != list(STATUSES):
        raise file.problem(f"names the states {', '.join(names)}; expected are {', '.join(STATUSES)}")
    status, subject, trial = (
        file.of(name, 1, rows).astype(np.int_) for name in ("status", "subject", "trial")
    )
    if not np.isin(status, range(len(STATUSES))).all():
        raise file.problem(f"has states other than 0 to {len(STATUSES) - 1}")
    left, right = (file.of(f"{side}_event", 1, rows) == 1 for side in ("left", "right"))
    samples = _without(samples, file.flags("held", (rows, len(SENSORS))), subject, trial)
    trials = []
    for person in np.unique(subject):
        for number in np.unique(trial[subject == person]):
            own = (subject == person) & (trial == number)
            trials.append(Trial(int(person), int(number), samples[own], status[own], (left[own], right[own])))
    if len({one.subject for one in trials}) < 2:
        raise file.problem("has one subject alone: nobody is left to learn from")
    return trials


def _without(
    samples: npt.NDArray[np.float64],
    held: npt.NDArray[np.bool_],
    subject: npt.NDArray[np.int_],
    trial: npt.NDArray[np.int_],
) -> npt.NDArray[np.float64]:
    """NaN where a row only holds the one before it; what is held for longer than LONGEST stays."""
    known = samples.copy()
    begins = np.flatnonzero((np.diff(subject) != 0) | (np.diff(trial) != 0)) + 1
    held = held.copy()
    held[[0, *begins]] = False  # there is nothing before a trial's first row
    row = np.arange(len(held))[:, None]
    age = row - np.maximum.accumulate(np.where(held, 0, row), axis=0)
    known[np.repeat((age > 0) & (age <= LONGEST), SENSORS, axis=1)] = np.nan
    return known


def lossy(trials: Sequence[Trial], share: float) -> list[Trial]:
    """Return the same walks with so many more of each sensor's packets lost; the first of each is there."""
    made = []
    for number, one in enumerate(trials):
        samples = losses.lossy(one.samples, SENSORS, share, number)
        samples[0] = one.samples[0]
        made.append(replace(one, samples=samples))
    return made


def stretched(trial: Trial, factor: float) -> Trial:
    """Return the same walk as somebody `factor` times as slow would have walked it."""
    rows = np.arange(int(len(trial.samples) * factor)) / factor
    whole = np.arange(len(trial.samples))
    filled = mended(trial.samples.T)
    samples = np.stack([np.interp(rows, whole, channel) for channel in filled], axis=1)
    samples[:, RATES] /= factor
    nearest = np.minimum(np.rint(rows).astype(np.intp), len(whole) - 1)
    samples[np.isnan(trial.samples[nearest])] = np.nan
    left, right = (in_air[nearest] for in_air in trial.in_air)
    return Trial(trial.subject, trial.number, samples, trial.status[nearest], (left, right))


def strikes(in_air: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Return the rows at which the foot is first on the ground again."""
    return np.flatnonzero(in_air[:-1] & ~in_air[1:]) + 1


def phase(
    strikes: npt.NDArray[np.intp], rows: int, stride_s: tuple[float, float] = STRIDE_S
) -> npt.NDArray[np.float64]:
    """Return each row's gait phase: 0 at a heel strike, linear to the next one; NaN outside strides."""
    result = np.full(rows, np.nan)
    shortest, longest = (seconds * RATE_HZ for seconds in stride_s)
    for begin, end in itertools.pairwise(strikes):
        if shortest <= end - begin <= longest:
            result[begin:end] = np.arange(end - begin) / (end - begin)
    return result
