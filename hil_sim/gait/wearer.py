"""What the ground and the trunk feel of the motion: vertical force, centre of pressure, tilt, joint loads.

Modelled, not measured: the double hump of the vertical ground reaction, the heel-to-toe way of the centre of
pressure and the sway of the trunk follow the textbook shape (Perry & Burnfield, Gait Analysis, 2010), scaled
so that both feet together carry the body's weight over a stride.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

from hil_sim.gait.generator import Generator
from hil_sim.gait.walk import STANCE

GRAVITY = 9.80665

# Vertical force over stance: (share of stance, force), flat at each knot; scaled below.
_HUMPS = ((0.0, 0.0), (0.23, 1.08), (0.50, 0.78), (0.77, 1.08), (1.0, 0.0))
_HUMPS_MEAN = sum((b[0] - a[0]) * (a[1] + b[1]) / 2.0 for a, b in pairwise(_HUMPS))
# Two feet, each on the ground for STANCE of the stride, together carry one body weight on average.
_SCALE = 1.0 / (2.0 * STANCE * _HUMPS_MEAN)

_COP_HEEL, _COP_TOE, _COP_STANDING = 0.030, 0.205, 0.110  # m from the heel
_COP_OUTER, _COP_INNER = 0.006, -0.006  # m, y on the left foot
_FEET_SHARE_SITTING = 0.18  # of the body weight, when the seat carries the rest
_SWAY_HZ = 0.3


@dataclass(frozen=True, slots=True)
class Foot:
    """Load of one foot: force (N), centre of pressure (m, foot frame: x forward of the heel, y left)."""

    force: float
    cop_x: float
    cop_y: float


@dataclass(frozen=True, slots=True)
class Trunk:
    """Attitude (rad; forward and right side down positive, yaw to the left), acceleration (m/s², world)."""

    roll: float
    pitch: float
    yaw: float
    acceleration: tuple[float, float, float]


def vertical_grf(stance: float) -> float:
    """Force of one foot in body weights at a share of its stance (0 … 1)."""
    for (start, low), (end, high) in pairwise(_HUMPS):
        if stance <= end:
            share = (stance - start) / (end - start)
            return _SCALE * (low + (high - low) * share * share * (3.0 - 2.0 * share))
    return 0.0


class Wearer:
    """A person of `mass` kg (the machine's included) who moves as the generator says."""

    def __init__(self, generator: Generator, mass: float = 90.0) -> None:
        self._generator = generator
        self.weight = mass * GRAVITY

    def feet(self, now_s: float) -> tuple[Foot, Foot]:
        """Left and right foot at `now_s` (s, for the sway of standing)."""
        phase = self._generator.phase
        sway = 0.03 * math.sin(math.tau * _SWAY_HZ * now_s)
        return self._foot(phase, 1.0, sway), self._foot((phase + 0.5) % 1.0, -1.0, -sway)

    def _foot(self, phase: float, side: float, sway: float) -> Foot:
        generator = self._generator
        walking = generator.walking
        stance = min(phase / STANCE, 1.0)
        standing = 0.5 + sway * (1.0 - generator.sitting)
        upright = standing + walking * (vertical_grf(stance) - standing)
        force = upright + generator.sitting * (_FEET_SHARE_SITTING / 2.0 - upright)
        way = stance * stance * (3.0 - 2.0 * stance)
        cop_x = _COP_STANDING + walking * (_COP_HEEL + way * (_COP_TOE - _COP_HEEL) - _COP_STANDING)
        cop_y = side * walking * (_COP_OUTER + way * (_COP_INNER - _COP_OUTER))
        return Foot(self.weight * force, cop_x, cop_y)

    def trunk(self) -> Trunk:
        generator = self._generator
        walking, angle = generator.walking, math.tau * generator.phase
        left = vertical_grf(min(generator.phase / STANCE, 1.0))
        right = vertical_grf(min((generator.phase + 0.5) % 1.0 / STANCE, 1.0))
        return Trunk(
            roll=0.03 * walking * math.sin(angle),
            pitch=generator.trunk + 0.02 * walking * math.sin(2.0 * angle),
            yaw=0.05 * walking * math.cos(angle),
            acceleration=(
                0.8 * walking * math.sin(2.0 * angle),
                0.5 * walking * math.sin(angle),
                GRAVITY * walking * (left + right - 1.0),
            ),
        )

    def joint_loads(self, now_s: float) -> tuple[float, ...]:
        """Moment that each joint's motor must hold (N·m; left hip, knee, ankle, then right)."""
        loads: list[float] = []
        for leg, foot in zip(self._generator.legs(), self.feet(now_s), strict=True):
            share = foot.force / self.weight
            loads += [
                12.0 * math.sin(leg.hip),  # the thigh's and shank's own weight
                -25.0 * share * math.sin(leg.knee),  # body weight bends the knee
                -120.0 * share * max(foot.cop_x - 0.06, 0.0),  # ground reaction before the ankle's axis
            ]
        return tuple(loads)
