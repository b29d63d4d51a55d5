"""One sample of a robot for the detectors: its values as arrays, and the phase of each leg in its stride."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

SIDES: Final = ("left", "right")
JOINTS: Final = tuple(f"{side}_{joint}" for side in SIDES for joint in ("hip", "knee", "ankle"))
JOINT_QUANTITIES: Final = ("position", "velocity", "torque", "following_error", "temperature")
FOOT_QUANTITIES: Final = ("force", "cop_x", "cop_y")
TRUNK: Final = tuple(
    f"trunk.{name}"
    for name in (
        *(f"acceleration_{axis}" for axis in "xyz"),
        *(f"angular_velocity_{axis}" for axis in "xyz"),
        "tilt_forward",
        "tilt_side",
    )
)
CHANNELS: Final = (
    *(f"{joint}.{quantity}" for quantity in JOINT_QUANTITIES for joint in JOINTS),
    *(f"{side}_insole.{quantity}" for quantity in FOOT_QUANTITIES for side in SIDES),
    *TRUNK,
)
STANDING: Final = 20  # the bin of a leg that does not step; 0 … 19 are twentieths of its stride
STANDS_S: Final = 2.5  # without a heel strike for so long, the wearer stands
STRUCK, LIFTED = 0.25, 0.12  # of the highest load: thresholds of heel strike and toe off
FEWEST_N: Final = 150.0  # below that nobody stands on an insole
USUAL_STRIDE_S: Final = 1.4


@dataclass(slots=True)
class StrideTracker:
    """One leg's stride, from its insole: `struck` and `lifted` are true for the one sample of the event."""

    highest: float = 0.0
    down: bool = True
    struck: bool = False
    lifted: bool = False
    strike_s: float = -math.inf
    lift_s: float = -math.inf
    stride_s: float = USUAL_STRIDE_S
    stance_s: float = math.nan

    def take(self, at_s: float, force: float) -> None:
        """Take the load (N) at a time; a missing one changes nothing."""
        self.struck = self.lifted = False
        if math.isnan(force):
            return
        self.highest = max(self.highest * 0.9996, force)
        if self.highest < FEWEST_N:
            return
        if not self.down and force > STRUCK * self.highest:
            self._strike(at_s)
        elif self.down and force < LIFTED * self.highest:
            self.down, self.lifted, self.lift_s = False, True, at_s
            self.stance_s = at_s - self.strike_s

    def _strike(self, at_s: float) -> None:
        self.down = self.struck = True
        lasted = at_s - self.strike_s
        if 0.5 < lasted < STANDS_S:
            self.stride_s += 0.3 * (lasted - self.stride_s)
        self.strike_s = at_s

    def phase(self, at_s: float) -> float:
        """Return the phase in the stride, 0 at the heel strike … 1; NaN if the leg does not step."""
        since = at_s - self.strike_s
        return min(since / self.stride_s, 0.999) if since < STANDS_S else math.nan


@dataclass(slots=True)
class Observation:
    """The newest sample; arrays are in the order of `JOINTS` and `SIDES`, NaN where unknown.

    `foot` is (3, 2): force, centre of pressure forward and to the left. `trunk` is in the order of `TRUNK`.
    """

    at_s: float = 0.0
    step_s: float = 0.0  # since the sample before; 0 after a gap
    joint: Floats = field(default_factory=lambda: np.full((5, 6), np.nan))  # by JOINT_QUANTITIES
    foot: Floats = field(default_factory=lambda: np.full((3, 2), np.nan))
    trunk: Floats = field(default_factory=lambda: np.full(8, np.nan))
    walking: bool = False  # both feet had a heel strike recently
    legs: tuple[StrideTracker, StrideTracker] = field(
        default_factory=lambda: (StrideTracker(), StrideTracker())
    )

    def take(self, at_s: float, values: Floats) -> None:
        """Take values in the order of `CHANNELS`."""
        passed = at_s - self.at_s
        self.step_s = passed if 0.0 < passed < 0.15 else 0.0
        self.at_s = at_s
        self.joint, self.foot, self.trunk = (
            values[:30].reshape(5, 6),
            values[30:36].reshape(3, 2),
            values[36:],
        )
        for leg, force in zip(self.legs, self.foot[0].tolist(), strict=True):
            leg.take(at_s, force)
        self.walking = all(at_s - leg.strike_s < STANDS_S for leg in self.legs)

    def bins(self) -> tuple[int, int]:
        """Return the stride bin of each leg."""
        left, right = (leg.phase(self.at_s) for leg in self.legs)
        if not self.walking:
            return STANDING, STANDING
        return (
            STANDING if math.isnan(left) else int(20 * left),
            STANDING if math.isnan(right) else int(20 * right),
        )


def or_zero(values: Floats) -> Floats:
    """Replace NaN by 0, in a sixth of the time of `np.nan_to_num`; infinities stay."""
    found: Floats = np.where(np.isnan(values), 0.0, values)
    return found


def in_order(channels: Sequence[str]) -> Mapping[int, int]:
    """Map the index of each of `CHANNELS` to its index in a recording; missing channels are left out."""
    return {at: channels.index(name) for at, name in enumerate(CHANNELS) if name in channels}


def readable_name(name: str) -> str:
    """Return the name of a component for people, such as `left knee`."""
    return name.replace("_", " ")
