"""Measured joint angles over the gait cycle, as smooth periodic curves (data/joint_angles.csv)."""

import csv
import math
from collections.abc import Sequence
from functools import cache
from importlib import resources
from typing import NamedTuple

SPEEDS = ("VerySlow", "Slow", "Free", "Fast", "VeryFast")


class Curve:
    """A periodic function of the phase (0 … 1), cubic between equally spaced values (rad)."""

    def __init__(self, values: Sequence[float]) -> None:
        self._count = len(values)
        self._padded = (values[-1], *values, *values[:3])
        self.mean = sum(values) / len(values)
        self.range = max(values) - min(values)

    def __call__(self, phase: float) -> float:
        place = phase % 1.0 * self._count
        index = int(place)
        t = place - index
        a, b, c, d = self._padded[index : index + 4]
        # Catmull-Rom: through every value, with a continuous slope.
        return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))


class Leg(NamedTuple):
    """Flexion of hip and knee, dorsiflexion of the ankle (rad)."""

    hip: float
    knee: float
    ankle: float


class LegCurves(NamedTuple):
    """One leg over its own stride, which begins with heel strike."""

    hip: Curve
    knee: Curve
    ankle: Curve

    def at(self, phase: float) -> Leg:
        return Leg(self.hip(phase), self.knee(phase), self.ankle(phase))


def _closed(rows: Sequence[float]) -> Curve:
    """Return a curve from values at 0 … 100 %; what its ends differ is spread over the cycle."""
    gap = rows[-1] - rows[0]
    steps = len(rows) - 1
    return Curve([math.radians(value - gap * index / steps) for index, value in enumerate(rows[:-1])])


@cache
def measured() -> tuple[LegCurves, ...]:
    """Return the measured sets, slowest first."""
    text = resources.files("hil_sim").joinpath("data/joint_angles.csv").read_text(encoding="ascii")
    rows = list(csv.DictReader(text.splitlines()))
    columns = ("hip_flexion_deg", "knee_flexion_deg", "ankle_dorsiflexion_deg")
    return tuple(
        LegCurves(
            *(_closed([float(row[column]) for row in rows if row["speed"] == speed]) for column in columns)
        )
        for speed in SPEEDS
    )
