"""Impaired gaits, as a table: joints, timing, load and pace of each.

Modelled, not measured: set by hand, so that the curves have the features, and the loads about the sizes, that
the literature has for each walk. Nobody's recording is in it, and people differ far more than these do.

- slow: stance and double support grow as speed falls; hardly any push-off (Perry & Burnfield, Gait Analysis,
  2010, on velocity; Smith & Lemaire 2018, Gait & Posture 61, 125, for 0.2 to 0.8 m/s).
- hemiparetic: after a stroke, 0.2 to 0.7 m/s. The knee of the affected leg bends little in swing, its hip
  extends less, its foot drops and lands flat; the trunk leans aside to swing it. It stands shorter and
  carries less than the other one, and its step is the longer and the later (Olney & Richards 1996, Gait &
  Posture 4, 136; Patterson et al. 2010, Gait & Posture 31, 241, on asymmetry).
- crouch: hips and knees stay bent, the knee by 20° to 30° or more all through stance, the ankle dorsiflexed
  (Sutherland & Davids 1993, Clin. Orthop. 288, 139; Perry & Burnfield 2010). Both legs.
- steppage: drop foot. The foot hangs in swing and lands toe first; hip and knee lift it over the ground
  (Perry & Burnfield 2010, on excess plantar flexion).
- crutches_two_point: each crutch goes with the opposite leg and takes a part of its load. How much is the
  person's choice; a quarter is taken here.
- crutches_three_point: both crutches go with the affected leg and take half of its load; the other one is not
  loaded more, and slower steps are taken (Youdas et al. 2005, Arch. Phys. Med. Rehabil. 86, 394: 50 and
  56 %; Li, Armstrong & Cipriani 2001, Arch. Phys. Med. Rehabil. 82, 86).
"""

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from hil_sim.gait.curves import Leg
from hil_sim.gait.ground import Transfer
from hil_sim.gait.posture import STANDING

LEFT, RIGHT = 0, 1
ORDINARY: Final = "ordinary"

# What ordinary wearers are told to walk at: step length (m), cycle time (s), each from the least to the most.
_STEP_LENGTH, _CYCLE_TIME = (0.20, 0.60), (1.0, 2.4)
_LANDING = 0.12  # share of the stride before and after heel strike in which the foot is set down
_SEVERITY = (0.75, 1.25)  # what one person has of the table's numbers; the nominal wearer has all of them
_LONGEST_STANCE, _LEAST_TRANSFER = 0.85, 0.02  # shares of the stride

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint's deviation: degrees of flexion or dorsiflexion that are added.

    `scale` multiplies its motion about where it is in standing, then `bent` comes to all of it, `swung` most
    in mid-swing, `landed` most at heel strike.
    """

    scale: float = 1.0
    bent: float = 0.0
    swung: float = 0.0
    landed: float = 0.0

    def of(self, severity: float) -> "Joint":
        """Return the same walk in a person who has so much of it (1: as in the table)."""
        scale = 1.0 + severity * (self.scale - 1.0)
        return Joint(scale, severity * self.bent, severity * self.swung, severity * self.landed)

    def changed(self, angle: float, standing: float, swinging: float, landing: float) -> float:
        """Return the joint's angle (rad), where it would be `angle`; swing and landing from 0 to 1."""
        more = self.bent + self.swung * swinging + self.landed * landing
        return standing + self.scale * (angle - standing) + math.radians(more)


_SAME: Final = Joint()


@dataclass(frozen=True, slots=True)
class Limb:
    """One leg's deviations. `stance` is a share of the stride, `heel` a path of the pressure (m).

    `step` multiplies the step that this leg makes, `takes` what it bears of the weight; of that a crutch
    carries `crutch`. The centre of pressure begins `heel` further before the heel than in others.
    """

    hip: Joint = _SAME
    knee: Joint = _SAME
    ankle: Joint = _SAME
    stance: float = 0.0
    step: float = 1.0
    takes: float = 1.0
    crutch: float = 0.0
    heel: float = 0.0

    def of(self, severity: float) -> "Limb":
        """Return the same in a person who has so much of it."""
        return Limb(
            self.hip.of(severity),
            self.knee.of(severity),
            self.ankle.of(severity),
            severity * self.stance,
            1.0 + severity * (self.step - 1.0),
            1.0 + severity * (self.takes - 1.0),
            severity * self.crutch,
            severity * self.heel,
        )

    @property
    def standing(self) -> Leg:
        """The leg of somebody who stands so."""
        bent = (math.radians(joint.bent) for joint in (self.hip, self.knee, self.ankle))
        return Leg(*(angle + more for angle, more in zip(STANDING, bent, strict=True)))

    def changed(self, pose: Leg, phase: float, swinging: float) -> Leg:
        """Return the leg that would be `pose` at this phase of its stride, `swinging` from 0 to 1."""
        landing = _landing(phase)
        joints = zip((self.hip, self.knee, self.ankle), pose, STANDING, strict=True)
        return Leg(*(joint.changed(angle, still, swinging, landing) for joint, angle, still in joints))


_UNCHANGED: Final = Limb()


@dataclass(frozen=True, slots=True)
class Walk:
    """One way of walking: the affected leg, the other one, and what both do together.

    `late` is by what share of the stride the affected leg's heel strike comes later than half-way, `lean`
    the trunk's more forward, `hike` its tilt to the other side while the affected leg swings (degrees).
    `variability` multiplies how much strides differ. Paces lie within `step_length` (m) and `cycle_time` (s).
    """

    affected: Limb
    other: Limb = _UNCHANGED
    late: float = 0.0
    lean: float = 0.0
    hike: float = 0.0
    variability: float = 1.0
    step_length: Range = _STEP_LENGTH
    cycle_time: Range = _CYCLE_TIME

    def pace(self, step_length: float, cycle_time: float) -> tuple[float, float]:
        """Return the step length (m) and cycle time (s) of an ordinary wearer at this pace."""
        return (
            _carried_over(step_length, _STEP_LENGTH, self.step_length),
            _carried_over(cycle_time, _CYCLE_TIME, self.cycle_time),
        )


@dataclass(frozen=True, slots=True)
class OwnWalk:
    """A person's: `limbs` are the left and the right one, `late` is the right one's, tilts are in rad.

    `hikes` are the trunk's roll, right side down, while the left and the right leg swing.
    """

    name: str
    limbs: tuple[Limb, Limb]
    late: float
    lean: float
    hikes: tuple[float, float]
    variability: float

    def stance_share(self, side: int, ordinary: float) -> float:
        """Return the stance share of this leg's stride, where an ordinary wearer's is `ordinary`."""
        return min(ordinary + self.limbs[side].stance, _LONGEST_STANCE)

    def transfer(self, side: int, shares: tuple[float, float]) -> Transfer:
        """Return when both feet stand, in this leg's stance; `shares` are both legs' of their strides."""
        strikes = 0.5 + (1 - 2 * side) * self.late  # of the other foot, in this leg's phase
        first, last = strikes + shares[1 - side] - 1.0, shares[side] - strikes
        return Transfer(max(first, _LEAST_TRANSFER) / shares[side], max(last, _LEAST_TRANSFER) / shares[side])


def _landing(phase: float) -> float:
    away = min(phase, 1.0 - phase) / _LANDING
    return math.cos(0.5 * math.pi * away) ** 2 if away < 1.0 else 0.0


def _carried_over(value: float, usual: Range, own: Range) -> float:
    share = min(max((value - usual[0]) / (usual[1] - usual[0]), 0.0), 1.0)
    return own[0] + share * (own[1] - own[0])


_SLOW = Limb(ankle=Joint(scale=0.8), stance=0.06)
_CROUCHED = Limb(
    hip=Joint(scale=0.9, bent=15.0),
    knee=Joint(scale=0.6, bent=25.0),
    ankle=Joint(scale=0.7, bent=8.0),
    stance=0.02,
    heel=0.05,
)
_WITH_CRUTCH = Limb(stance=0.04, crutch=0.25)

WALKS: Final[Mapping[str, Walk]] = {
    "slow": Walk(_SLOW, _SLOW, lean=2.0, variability=1.5, step_length=(0.20, 0.40), cycle_time=(1.6, 2.0)),
    "hemiparetic": Walk(
        affected=Limb(
            hip=Joint(scale=0.75, bent=3.0),
            knee=Joint(scale=0.55),
            ankle=Joint(scale=0.6, swung=-8.0, landed=-8.0),
            stance=0.03,
            step=1.12,
            takes=0.94,
            heel=0.06,
        ),
        other=Limb(knee=Joint(bent=3.0), stance=0.09, step=0.88, takes=1.06),
        late=0.03,
        lean=4.0,
        hike=4.0,
        variability=1.6,
        step_length=(0.20, 0.45),
        cycle_time=(1.3, 2.0),
    ),
    "crouch": Walk(
        _CROUCHED, _CROUCHED, lean=6.0, variability=1.4, step_length=(0.25, 0.45), cycle_time=(1.1, 1.6)
    ),
    "steppage": Walk(
        affected=Limb(
            hip=Joint(swung=15.0), knee=Joint(swung=20.0), ankle=Joint(swung=-22.0, landed=-15.0), heel=0.10
        ),
        hike=2.0,
        variability=1.2,
        step_length=(0.30, 0.50),
        cycle_time=(1.2, 1.7),
    ),
    "crutches_two_point": Walk(
        _WITH_CRUTCH, _WITH_CRUTCH, lean=8.0, variability=1.2, step_length=(0.25, 0.45), cycle_time=(1.4, 2.2)
    ),
    "crutches_three_point": Walk(
        affected=Limb(knee=Joint(scale=0.8, bent=4.0), stance=-0.02, step=1.05, crutch=0.50),
        other=Limb(stance=0.04, step=0.95),
        late=0.01,
        lean=10.0,
        variability=1.3,
        step_length=(0.25, 0.45),
        cycle_time=(1.5, 2.4),
    ),
}
NAMES: Final = (ORDINARY, *WALKS)  # every choice, also in recordings: the group of a wearer


def own_walk(name: str, number: int) -> OwnWalk:
    """Return the walk of the person with this number, always the same; 0 has it as in the table.

    Even numbers are affected on the left, odd ones on the right.
    """
    walk, left = WALKS[name], number % 2 == 0
    severity = random.Random(f"{name} {number}").uniform(*_SEVERITY) if number else 1.0
    affected, other = walk.affected.of(severity), walk.other.of(severity)
    hike = math.radians(severity * walk.hike)
    return OwnWalk(
        name,
        limbs=(affected, other) if left else (other, affected),
        late=severity * walk.late * (-1.0 if left else 1.0),
        lean=math.radians(severity * walk.lean),
        hikes=(hike, 0.0) if left else (0.0, -hike),
        variability=1.0 + severity * (walk.variability - 1.0),
    )
