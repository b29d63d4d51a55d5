"""Metrics that are compared before and after an edit: unit, better direction, smallest relevant change."""

from dataclasses import dataclass
from enum import Enum
from typing import Final


class Better(Enum):
    """Better direction of a metric; unknown for some without the wearer."""

    LESS = "less"
    NEARER = "nearer to zero"  # of what may be on either side of it
    NEITHER = "neither"


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of a gait cycle.

    A difference counts from `share` of what it was before, and at least from `floor` (in `unit`): a smaller
    one nobody feels, however sure it is. `is_speed`: it tells how fast the wearer walks, so that it is not
    compared at equal speed. `is_slope`: its slope over time is compared, not itself.
    """

    key: str
    title: str
    unit: str
    better: Better
    share: float
    floor: float
    is_speed: bool = False
    is_slope: bool = False

    def smallest(self, before: float) -> float:
        """Return the smallest difference that counts."""
        return max(self.share * abs(before), self.floor)


LESS, NEARER, NEITHER = Better.LESS, Better.NEARER, Better.NEITHER

OF_JOINTS: Final = (
    Metric("error_rms", "tracking error RMS", "rad", LESS, 0.05, 2e-4),
    Metric("error_peak", "tracking error peak", "rad", LESS, 0.10, 5e-4),
    Metric("lag", "lag behind the target", "s", NEARER, 0.10, 1e-3),
    Metric("overshoot", "overshoot", "rad", LESS, 0.10, 1e-3),
    Metric("current_rms", "current RMS", "A", LESS, 0.05, 0.02),
    Metric("current_peak", "current peak", "A", LESS, 0.10, 0.1),
    Metric("temperature", "temperature slope", "°C/s", LESS, 0.25, 0.01, is_slope=True),
    Metric("torque_rms", "torque RMS", "N·m", NEITHER, 0.05, 0.2),
    Metric("power", "mechanical power", "W", NEITHER, 0.10, 0.5),
    Metric("jerk", "jerk RMS", "rad/s³", LESS, 0.10, 5.0),
)
OF_ROBOTS: Final = (
    Metric("cadence", "cadence", "steps/min", NEITHER, 0.02, 0.2, is_speed=True),
    Metric("symmetry_stance", "symmetry of stance", "", NEITHER, 0.0, 0.03),
    Metric("symmetry_step", "symmetry of step time", "", NEITHER, 0.0, 0.03),
    Metric("symmetry_load", "symmetry of load", "", NEITHER, 0.0, 0.05),
    Metric("bus_load", "bus load", "%", LESS, 0.0, 3.0),
    Metric("cpu", "CPU of the robot's computer", "%", LESS, 0.0, 5.0),
)
