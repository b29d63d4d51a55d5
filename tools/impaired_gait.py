"""Makes the file of the benchmarks `impaired-…` of the recordings of IPOL 2019/265.

    python -m tools.impaired_gait GaitData --out impaired.npz

GaitData is the folder of Truong et al. 2019, "A Data Set for the Study of Human Locomotion with Inertial
Measurements Units" (Image Processing On Line 9, 381; https://doi.org/10.5201/ipol.2019.265): for each trial
a SUBJECT-TRIAL.csv and a SUBJECT-TRIAL.json. Its licence is CC BY-NC-SA: nothing of it ships with GWRMS.

Angular velocity alone is taken. The accelerations lack gravity, and those of one of the two makes of sensor
end at about 3 g.
"""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

RATE_HZ: Final = 100
GROUPS: Final = {"Healthy": "healthy", "Orthopedic": "orthopaedic", "Neurological": "neurological"}
SENSORS: Final = ("XSens", "TCon")
COLUMNS: Final = tuple(f"{side}R{axis}" for side in "LR" for axis in "XYZ")  # deg/s
CHANNELS: Final = tuple(f"{foot}_gyr_{axis}" for foot in ("lfoot", "rfoot") for axis in "xyz")
STEPS_OF: Final = ("LeftFootActivity", "RightFootActivity")
UNIT_DEG_S: Final = 0.1  # of what is stored: the coarser make of sensor tells no more
PROG: Final = "tools.impaired_gait"


class WrongFile(ValueError):
    """A file is not as the set's files are; in words for a person."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One walk there and back."""

    subject: int
    number: int
    group: int  # index into GROUPS
    sensor: int  # index into SENSORS
    rates: npt.NDArray[np.int16]  # (rows, 6), in UNIT_DEG_S
    moving: npt.NDArray[np.int8]  # (rows, 2): from heel off until the foot lies flat, left and right


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog=PROG, description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, metavar="GaitData", help="the folder of the set's files")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the .npz file to write")
    options = parser.parse_args(argv)
    try:
        arrays = made(options.folder)
    except (OSError, WrongFile) as error:
        sys.stderr.write(f"{PROG}: {error}\n")
        return 1
    np.savez_compressed(options.out, allow_pickle=False, **arrays)
    people = len(np.unique(arrays["subject"]))
    sys.stdout.write(f"{people} people, {len(arrays['x']) / RATE_HZ / 3600:.1f} h: {options.out}\n")
    return 0


def made(folder: Path) -> dict[str, npt.NDArray[Any]]:
    """Return every trial of the folder, as the benchmarks read them.

    Raises:
        WrongFile: there is none, or one is not as it should be.

    """
    trials = [trial(path) for path in sorted(folder.glob("*.json"))]
    if not trials:
        raise WrongFile(f"{folder} has no SUBJECT-TRIAL.json: it is not the set's folder GaitData")
    trials.sort(key=lambda one: (one.subject, one.number))
    rows = [len(one.rates) for one in trials]
    moving = np.concatenate([one.moving for one in trials])
    return {
        "rate": np.array(RATE_HZ),
        "channels": np.array(CHANNELS),
        "x": np.concatenate([one.rates for one in trials]),
        "scale": np.full(len(CHANNELS), math.radians(UNIT_DEG_S)),
        "subject": np.repeat([one.subject for one in trials], rows).astype(np.int16),
        "trial": np.repeat([one.number for one in trials], rows).astype(np.int16),
        "group": np.repeat([one.group for one in trials], rows).astype(np.int8),
        "group_names": np.array(list(GROUPS.values())),
        "sensor": np.repeat([one.sensor for one in trials], rows).astype(np.int8),
        "sensor_names": np.array(SENSORS),
        "left_moving": moving[:, 0],
        "right_moving": moving[:, 1],
    }


def trial(path: Path) -> Trial:
    """Read the trial whose SUBJECT-TRIAL.json is at `path`.

    Raises:
        WrongFile: it lacks something, or holds what cannot be.

    """
    try:
        about = json.loads(path.read_text())
        steps = [_intervals(about[name]) for name in STEPS_OF]
        group, sensor = list(GROUPS).index(about["PathologyGroup"]), SENSORS.index(about["Sensor"])
        subject, number = int(about["Subject"]), int(about["Trial"])
    except (KeyError, TypeError, ValueError) as error:
        raise WrongFile(f"{path} is not as the set's trials are described: {error}") from error
    rates = _rates(path.with_suffix(".csv"))
    moving = np.stack([_moving(one, len(rates)) for one in steps], axis=1)
    return Trial(subject, number, group, sensor, rates, moving)


def _intervals(steps: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    return sorted((int(begin), int(end)) for begin, end in steps)


def _rates(path: Path) -> npt.NDArray[np.int16]:
    with path.open() as file:
        names = file.readline().strip().split(",")
        if missing := [name for name in COLUMNS if name not in names]:
            raise WrongFile(f"{path} lacks the columns {', '.join(missing)}")
        try:
            rates = np.loadtxt(file, delimiter=",", ndmin=2, usecols=[names.index(name) for name in COLUMNS])
        except ValueError as error:
            raise WrongFile(f"{path}: {error}") from error
    whole = np.rint(rates / UNIT_DEG_S)
    if not (np.abs(whole) <= np.iinfo(np.int16).max).all():
        raise WrongFile(f"{path} has angular velocities that no foot reaches, or that are no numbers")
    return whole.astype(np.int16)


def _moving(steps: Sequence[tuple[int, int]], rows: int) -> npt.NDArray[np.int8]:
    """Return 1 while the foot moves; between two steps that overlap in the labels a row stays 0."""
    moving = np.zeros(rows, dtype=np.int8)
    for begin, end in steps:
        moving[begin:end] = 1
        if begin > 0:
            moving[begin - 1] = 0
    return moving


if __name__ == "__main__":
    sys.exit(main())
