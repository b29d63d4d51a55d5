"""People who were recorded with an IMU on the trunk alone, as `ml.danger.monitor` sees and judges them."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from drivers.imu import rotation
from drivers.imu.attitude import ComplementaryFilter
from drivers.imu.motion import tilt
from ml.benchmarks.danger import Judged, per_hour
from ml.benchmarks.danger_data import HEALTHY, Seen
from ml.danger.calibration import Calibration
from ml.danger.detector import DETECTORS
from ml.danger.levels import Level
from ml.danger.monitor import DangerMonitor
from ml.danger.observation import CHANNELS, TRUNK

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

PAUSE_S: Final = 1.0  # of the watch's clock between two recordings: what is compared over time begins anew
OWN: Final = [CHANNELS.index(name) for name in TRUNK]
NOTE: Final = (
    "recorded people, judged by the calibration that ships, which has learned from simulated wearers alone;"
    " nothing was tuned on these. Of thirteen detectors two can speak, those that need only the trunk's IMU:"
    " balance and agreement. Spreads are each person's own, learned in the first minute, which is not judged."
    " …_low and …_high: 95 % intervals."
)


def upright(samples: Floats, standing: Floats, axes: Sequence[Sequence[int]]) -> Floats:
    """Acceleration and rate (rows, 6) in the trunk's axes (REP-103), counted from an upright posture.

    `axes` are the trunk's forward, left and up in the sensor's; `standing` (rows, 6) of the same sensor says
    where up is, on average: by the least turn that brings it there.
    """
    turn = np.array(axes, dtype=np.float64)
    up = turn @ np.nanmean(standing[:, :3], axis=0)
    up /= np.linalg.norm(up)
    across = np.array([[0.0, 0.0, up[0]], [0.0, 0.0, up[1]], [-up[0], -up[1], 0.0]])  # up crossed with z
    turn = (np.eye(3) - across + across @ across / (1.0 + up[2])) @ turn
    return np.concatenate([samples[:, :3] @ turn.T, samples[:, 3:] @ turn.T], axis=1)


def channels(trunk: Floats, rate_hz: float) -> Floats:
    """`trunk` (rows, 6) as rows of `CHANNELS`, with the tilt of the drivers' filter; NaN where missing."""
    rows = np.full((len(trunk), len(CHANNELS)), np.nan)
    attitudes = ComplementaryFilter()
    for at in np.flatnonzero(np.isfinite(trunk).all(axis=1)).tolist():
        ax, ay, az, wx, wy, wz = sample = trunk[at].tolist()
        attitude = attitudes.update(round(at / rate_hz * 1e9), (wx, wy, wz), (ax, ay, az))
        rows[at, OWN] = (*sample, *((np.nan, np.nan) if attitude is None else tilt(rotation.up(attitude))))
    return rows


@dataclass(slots=True)
class Person:
    """A wearer and the watch that learns of him, one recording after the other."""

    subject: str
    watch: DangerMonitor
    at_s: float = 0.0

    @classmethod
    def of(cls, subject: str, calibration: Calibration) -> "Person":
        """Return somebody whom nobody knows yet."""
        return cls(subject, DangerMonitor(calibration))

    def take(self, rows: Floats, rate_hz: float, label: npt.NDArray[np.str_]) -> Judged:
        """Return what is said of the next recording, at 25 moments a second; a `label` a row."""
        begin_s = self.at_s + PAUSE_S
        self.at_s = begin_s + len(rows) / rate_hz
        found = [
            (at, verdict)
            for at, row in enumerate(rows.tolist())
            if (verdict := self.watch.take(round((begin_s + at / rate_hz) * 1e9), row)) is not None
        ]
        silent = [[name in verdict.silent for name in DETECTORS] for _, verdict in found]
        numbers = [np.nan if verdict.number is None else verdict.number for _, verdict in found]
        seen = Seen(
            self.subject,
            (),
            np.array([verdict.stamp_ns for _, verdict in found]) / 1e9,
            np.where(np.array(silent), np.nan, 0.0),
            np.full(len(found), HEALTHY),
            label[[at for at, _ in found]],
        )
        return Judged(seen, np.array(numbers), np.array([int(verdict.level) for _, verdict in found]))

    def again(self) -> "Person":
        """Return the same person, so far known, to meet something that nobody is to learn from."""
        return copy.deepcopy(self)


def figures(judged: Sequence[Judged], rows: Sequence[Flags]) -> dict[str, float]:
    """Levels an hour of these moments with 95 % intervals, and what can be judged at all."""
    speaks = np.concatenate(
        [~np.isnan(one.seen.above[own]).all(axis=1) for one, own in zip(judged, rows, strict=True)]
    )
    fine = np.concatenate([one.level[own] == Level.NONE for one, own in zip(judged, rows, strict=True)])
    found: dict[str, float] = {}
    for level, name in ((Level.ADVICE, "advice"), (Level.ALARM, "alarm"), (Level.STOP, "stop")):
        found |= per_hour(judged, level, name, rows)
    return found | {
        "share_judged": float(speaks.mean()) if len(speaks) else np.nan,
        "share_said_to_be_fine": float(fine.mean()) if len(fine) else np.nan,
    }
