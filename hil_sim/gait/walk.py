"""Legs in level walking: step length, toe height and phase to joint angles."""

import math
from dataclasses import dataclass
from itertools import pairwise

from hil_sim.gait.curves import Curve, Leg, LegCurves, measured
from hil_sim.gait.subject import NOMINAL_LEG_LENGTH

# The measured hip angle counts from the pelvis, which tilts forward by about this much at every walking speed
# (mean of the same data sets); the robot's hip counts from its upright trunk.
PELVIC_TILT = math.radians(12.0)

_USUAL_TOE_HEIGHT = 0.060  # m: what the measured curves are taken to give
_KNEE_PER_TOE_HEIGHT = 6.0  # 1/m: share of swing knee flexion that a metre of toe height adds
_ANKLE_PER_TOE_HEIGHT = 1.5  # rad/m of dorsiflexion in swing


@dataclass(frozen=True, slots=True)
class Shape:
    """The settings of the gait: lengths in m, time in s, angle in rad."""

    step_length: float
    cycle_time: float
    toe_height: float
    trunk_angle: float

    @property
    def speed(self) -> float:
        """Walking speed (m/s): two steps a cycle."""
        return 2.0 * self.step_length / self.cycle_time


def hip_range(step_length: float, leg_length: float = NOMINAL_LEG_LENGTH) -> float:
    """Range of hip flexion (rad) that a step needs: both legs are the sides of an isosceles triangle."""
    return 2.0 * math.asin(step_length / (2.0 * leg_length))


def stance_share(speed: float) -> float:
    """Share of a stride that a foot is on the ground; twice what is over ½ is double support.

    The faster, the less: 0.60 at 1.4 m/s (Perry & Burnfield, Gait Analysis, 2010).
    """
    return min(max(0.655 - 0.04 * speed, 0.57), 0.66)


def swing(phase: float, stance: float) -> float:
    """0 in stance, rising to 1 in mid-swing."""
    return math.sin(math.pi * (phase - stance) / (1.0 - stance)) ** 2 if phase > stance else 0.0


def lifted(pose: Leg, toe_height: float, swing: float) -> Leg:
    """Return the leg with knee and ankle bent for another toe height (m) than the curves have."""
    lift = (toe_height - _USUAL_TOE_HEIGHT) * swing
    return Leg(
        pose.hip, pose.knee * (1.0 + _KNEE_PER_TOE_HEIGHT * lift), pose.ankle + _ANKLE_PER_TOE_HEIGHT * lift
    )


def level(phase: float, step_length: float, leg_length: float = NOMINAL_LEG_LENGTH) -> Leg:
    """Angles of one leg at its own `phase` (0 … 1, heel strike is 0).

    Longer steps take the curves of faster walkers; the hip is then scaled to exactly the range that the step
    length needs, and the knee by half as much.
    """
    wanted = hip_range(step_length, leg_length)
    slower, faster, share = _between(wanted)

    def blend(a: Curve, b: Curve) -> tuple[float, float]:
        return a(phase) + share * (b(phase) - a(phase)), a.mean + share * (b.mean - a.mean)

    scale = wanted / (slower.hip.range + share * (faster.hip.range - slower.hip.range))
    hip, hip_mean = blend(slower.hip, faster.hip)
    knee, _ = blend(slower.knee, faster.knee)
    ankle, _ = blend(slower.ankle, faster.ankle)
    return Leg(
        hip=hip_mean - PELVIC_TILT + scale * (hip - hip_mean), knee=knee * (0.5 + 0.5 * scale), ankle=ankle
    )


def _between(wanted: float) -> tuple[LegCurves, LegCurves, float]:
    """Return the two measured sets whose hip ranges stand around `wanted`, and where between them."""
    sets = measured()
    pairs = pairwise(sets)
    slower, faster = next((pair for pair in pairs if wanted < pair[1].hip.range), sets[-2:])
    share = (wanted - slower.hip.range) / (faster.hip.range - slower.hip.range)
    return slower, faster, min(max(share, 0.0), 1.0)
