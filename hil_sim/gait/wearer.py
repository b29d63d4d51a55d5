"""Effects of the motion on ground, trunk and joints: foot loads, attitude, acceleration, joint loads.

Newton holds at every moment: all vertical forces (feet, crutches, seat, ground under a fallen body) less the
weight are mass times the trunk's vertical acceleration, the body taken as a mass in its trunk. Over a stride
feet and crutches carry the weight.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from hil_sim.gait import posture
from hil_sim.gait.gaits import LEFT, RIGHT
from hil_sim.gait.generator import Generator
from hil_sim.gait.ground import Humps, outward, shear, vertical_grf
from hil_sim.gait.walk import swing

GRAVITY = 9.80665

_SIDEWAYS = 0.06  # how far (in its height) the trunk is beside the foot that it stands on
# Sway: frequencies (Hz); in standing the share of the load that goes from foot to foot and the way of the
# pressure (m); the trunk's pitch and roll (rad), which sways on a seat too.
_SWAY_HZ = (0.13, 0.31, 0.57)
_SWAY_LOAD = (0.015, 0.010, 0.004)
_SWAY_COP = (0.005, 0.003, 0.001)
_SWAY_PITCH = (0.006, 0.004, 0.002)
_SWAY_ROLL = (-0.004, 0.003, 0.001)
# The trunk in walking (rad): roll and yaw once a stride, pitch twice.
_ROLL, _PITCH, _YAW = 0.04, 0.025, 0.07
_IMPAIRED_LOAD = 0.1  # share of its load that a fully impaired leg gives to the other


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


class _Contact(NamedTuple):
    """One foot on the ground: load and shear in body weights, centre of pressure as in `Foot`."""

    load: float
    shear: float
    cop_x: float
    cop_y: float


_STANDING = _Contact(0.5, 0.0, 0.110, 0.0)


def _sway(share: float, amounts: tuple[float, ...], now_s: float) -> float:
    """So much of it."""
    if not share:
        return 0.0
    return share * sum(
        amount * math.sin(math.tau * hertz * now_s) for amount, hertz in zip(amounts, _SWAY_HZ, strict=True)
    )


class Wearer:
    """The body of the generator's wearer, machine included, who moves as the generator says."""

    def __init__(self, generator: Generator) -> None:
        self._generator = generator
        self.mass = generator.wearer.mass
        self.weight = self.mass * GRAVITY
        self.resists: dict[int, float] = {}  # N·m more than its load, by the joint's place in `joint_loads`
        self._moment, self._both = -1, (_STANDING, _STANDING)

    # -- forces -----------------------------------------------------------------------------------------

    def feet(self, now_s: float) -> tuple[Foot, Foot]:
        """Left and right foot at `now_s` (s, for the sway of standing)."""
        carried = self._carried() * (1.0 - self._support())
        swaying = self._generator.wearer.sway * self._standing()
        load, place = (_sway(swaying, amounts, now_s) for amounts in (_SWAY_LOAD, _SWAY_COP))
        left, right = self._contacts()
        on_left, on_right = (1.0 - share for share in self._crutches())
        return (
            Foot(carried * (on_left * left.load + load), left.cop_x + place, left.cop_y),
            Foot(carried * (on_right * right.load - load), right.cop_x + place, right.cop_y),
        )

    def _crutches(self) -> tuple[float, float]:
        """Share of each leg's load that a crutch takes; nobody leans on one who sits or falls."""
        generator = self._generator
        if generator.walk is None:
            return 0.0, 0.0
        leans = (1.0 - generator.sitting) * (1.0 - generator.fall.share)
        left, right = generator.walk.limbs
        return leans * left.crutch, leans * right.crutch

    def _standing(self) -> float:
        """1 standing … 0 walking or sitting."""
        return (1.0 - self._generator.walking) * (1.0 - self._generator.sitting)

    def support(self) -> float:
        """Return the load on seat, crutches, or the ground under hands and body (N)."""
        leaning = zip(self._contacts(), self._crutches(), strict=True)
        crutches = sum(contact.load * share for contact, share in leaning)
        return self._carried() * (self._support() + (1.0 - self._support()) * crutches)

    def _carried(self) -> float:
        """Weight and what the posture's acceleration adds (N)."""
        return self.mass * (GRAVITY + self._generator.acceleration[1])

    def _support(self) -> float:
        generator = self._generator
        return max(posture.on_seat(generator.seating), generator.fall.on_ground)

    def _contacts(self) -> tuple[_Contact, _Contact]:
        """Return both feet; worked out once for each moment of the generator."""
        moment = self._generator.moment
        if moment != self._moment:
            self._moment, self._both = moment, (self._contact(LEFT), self._contact(RIGHT))
        return self._both

    def _contact(self, side: int) -> _Contact:
        generator, outside = self._generator, 1.0 - 2.0 * side
        walking = generator.walking
        step = self._step(side) if walking > 0.0 else _STANDING
        return _Contact(
            (_STANDING.load + walking * (step.load - _STANDING.load))
            * generator.stumble.load
            * generator.fall.load,
            walking * step.shear,
            _STANDING.cop_x + walking * (step.cop_x - _STANDING.cop_x),
            outside * (walking * step.cop_y + generator.wearer.foot_roll),
        )

    def _step(self, side: int) -> _Contact:
        """Return the foot in the present gait; y of the centre of pressure counts outward."""
        generator = self._generator
        speed, share = generator.shape.speed, generator.stance_share(side)
        stance = min(generator.leg_phase(side) / share, 1.0)
        impaired = generator.impairment
        takes = 1.0 + _IMPAIRED_LOAD * (impaired[1 - side] - impaired[side])
        load = place = 0.0
        for gait, part in generator.gaits:
            load += part * takes * self._force(side, stance, share, gait.humps(speed))
            place += part * gait.path.at(stance)
        if generator.walk is not None:
            place += generator.walk.limbs[side].heel * (1.0 - stance)
        return _Contact(load, shear(stance, speed), place, outward(stance))

    def _force(self, side: int, stance: float, share: float, humps: Humps) -> float:
        """Return the force on a foot with its crutch, in body weights, at a share of its stance."""
        generator = self._generator
        if generator.walk is None:
            return vertical_grf(stance, humps, share)
        if stance >= 1.0:
            return 0.0
        shares = (generator.stance_share(LEFT), generator.stance_share(RIGHT))
        both = [generator.walk.transfer(one, shares) for one in (LEFT, RIGHT)]
        takes = [limb.takes for limb in generator.walk.limbs]
        whole = sum(k * s * one.mean(humps) for k, s, one in zip(takes, shares, both, strict=True))
        return takes[side] * both[side].force(stance, humps) / whole

    # -- trunk ------------------------------------------------------------------------------------------

    def trunk(self, now_s: float) -> Trunk:
        """Attitude at `now_s` (s, for the sway), and the acceleration that the forces give."""
        generator = self._generator
        upright = (1.0 - generator.fall.share) * generator.wearer.sway
        moving, angle = generator.walking * upright, math.tau * generator.phase
        swaying, aside = (_sway(upright, amounts, now_s) for amounts in (_SWAY_PITCH, _SWAY_ROLL))
        return Trunk(
            roll=moving * (_ROLL * math.sin(angle) + self._hike()) + generator.fall.roll + aside,
            pitch=generator.trunk + moving * _PITCH * math.sin(2.0 * angle) + swaying,
            yaw=generator.heading + moving * _YAW * math.cos(angle),
            acceleration=self._acceleration(),
        )

    def _hike(self) -> float:
        """Return the tilt of the trunk that lets a leg swing (rad, right side down)."""
        generator = self._generator
        if generator.walk is None:
            return 0.0
        return sum(
            hike * swing(generator.leg_phase(side), generator.stance_share(side))
            for side, hike in zip((LEFT, RIGHT), generator.walk.hikes, strict=True)
        )

    def _acceleration(self) -> tuple[float, float, float]:
        """Forward, left and up along the way, then turned into the world's axes (m/s²)."""
        generator = self._generator
        contacts, support = self._contacts(), self._support()
        loads = [contact.load for contact in contacts]
        push = (1.0 - support) * sum(contact.shear for contact in contacts)
        forward = GRAVITY * push + generator.acceleration[0]
        aside = -GRAVITY * _SIDEWAYS * generator.walking * (1.0 - support) * (loads[LEFT] - loads[RIGHT])
        up = self._carried() / self.mass * ((1.0 - support) * sum(loads) + support) - GRAVITY
        cos, sin = math.cos(generator.heading), math.sin(generator.heading)
        return forward * cos - aside * sin, forward * sin + aside * cos, up

    # -- joints -----------------------------------------------------------------------------------------

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
        return tuple(load + self.resists.get(joint, 0.0) for joint, load in enumerate(loads))
