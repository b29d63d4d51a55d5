"""The format of IPOL 2019/265: IMUs on both feet of healthy people and of patients, walked there and back."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import losses
from ml.benchmarks.arrays import Arrays
from ml.benchmarks.strides import heel_strikes
from ml.features.gait_status import RATE_HZ

HEALTHY: Final = "healthy"
CHANNELS: Final = tuple(f"{foot}_gyr_{axis}" for foot in ("lfoot", "rfoot") for axis in "xyz")
SENSORS: Final = (3, 3)  # channels of each
MOST_RAD_S: Final = 60.0  # a foot that turns faster was not recorded in rad/s
FLAT_AFTER: Final = 60  # samples from a foot's own strike, at most, until it lies flat


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """One walk of one person: stand, there, turn, back, stand."""

    subject: int
    number: int
    group: str
    sensor: str  # the make
    rates: npt.NDArray[np.float64]  # (rows, 6): both feet's angular velocity, rad/s; toes up is positive in y
    moving: tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]  # from heel off until the foot lies flat


def read(path: Path) -> list[Walk]:
    """Return the file's walks, subject by subject, in their order.

    Raises:
        UnusableData: it is not such a file, or has samples that cannot be.

    """
    file = Arrays(path)
    file.rate(RATE_HZ)
    rates = file.samples(CHANNELS)
    rows = len(rates)
    if (most := float(np.abs(rates).max())) > MOST_RAD_S:
        raise file.problem(f"has feet that turn at {most:.0f} rad/s: it seems to be in other units")
    subject, trial = (file.of(name, 1, rows).astype(np.int_) for name in ("subject", "trial"))
    group, sensor = (_names(file, name, rows) for name in ("group", "sensor"))
    moving = [file.of(f"{side}_moving", 1, rows) == 1 for side in ("left", "right")]
    walks = []
    for person in np.unique(subject):
        for number in np.unique(trial[subject == person]):
            own = np.flatnonzero((subject == person) & (trial == number))
            left, right = (one[own] for one in moving)
            about = (str(group[own[0]]), str(sensor[own[0]]))
            walks.append(Walk(int(person), int(number), *about, rates[own], (left, right)))
    groups = {walk.subject: walk.group for walk in walks}
    if any(groups[walk.subject] != walk.group for walk in walks):
        raise file.problem("has somebody in two groups")
    if sum(name == HEALTHY for name in groups.values()) < 2 or len(set(groups.values())) < 2:
        raise file.problem(
            f"has fewer than two {HEALTHY} people, or nobody else: there is nothing to compare"
        )
    return walks


def _names(file: Arrays, name: str, rows: int) -> npt.NDArray[np.str_]:
    """Return the name of each row's number in the array `name`."""
    names, number = file.of(f"{name}_names", 1), file.of(name, 1, rows).astype(np.int_)
    if not np.isin(number, range(len(names))).all():
        raise file.problem(f"has numbers in {name!r} that {name + '_names'!r} does not name")
    return names[number].astype(np.str_)


def lossy(walks: Sequence[Walk], share: float) -> list[Walk]:
    """Return the same walks with so many of each sensor's packets lost; the first of each is there."""
    made = []
    for number, walk in enumerate(walks):
        rates = losses.lossy(walk.rates, SENSORS, share, number)
        rates[:1] = walk.rates[:1]
        made.append(replace(walk, rates=rates))
    return made


def landings(moving: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Return the rows at which the foot lies flat again."""
    return np.flatnonzero(moving[:-1] & ~moving[1:]) + 1


def laid_later(walks: Sequence[Walk]) -> dict[str, int]:
    """Return, for each make of sensor, how many samples after its own strike a foot is labelled as flat.

    Those who labelled read signals, and read those of one make otherwise than those of the other. Healthy
    people alone say by how much: the median over them of each one's median, rounded.
    """
    found: dict[str, dict[int, list[int]]] = {}
    for walk in walks:
        if walk.group == HEALTHY:
            found.setdefault(walk.sensor, {}).setdefault(walk.subject, []).extend(_later(walk))
    usual = {
        sensor: [float(np.median(one)) for one in people.values() if one] for sensor, people in found.items()
    }
    return {sensor: round(float(np.median(people))) for sensor, people in usual.items() if people}


def _later(walk: Walk) -> list[int]:
    """Count from each strike in a foot's own signal until the labels have it lie flat, where they do."""
    later: list[int] = []
    for pitch, moving in zip((walk.rates[:, 1], walk.rates[:, 4]), walk.moving, strict=True):
        flat, own = landings(moving), heel_strikes(pitch)
        place = np.searchsorted(own, flat, side="right") - 1
        after = flat[place >= 0] - own[place[place >= 0]]
        later += after[after <= FLAT_AFTER].tolist()
    return later
