"""The wearer's body, habits and impairment: one nominal person, and any number of others.

The spread between subjects is modelled: body mass and leg length as in adults, habits of a few degrees (the
standard deviations between subjects in Schwartz et al. 2008 are 4° to 7°, most of it an offset).
"""

import math
import random
from dataclasses import dataclass, replace
from functools import partial

from hil_sim.gait.walks import ORDINARY, OwnWalk, own_walk

NOMINAL_LEG_LENGTH = 0.80  # m, hip to ground
_MACHINE_KG = 16.0


@dataclass(frozen=True, slots=True)
class Habit:
    """A subject's deviation in one joint (rad): an offset, two harmonics of the stride."""

    offset: float = 0.0
    first: float = 0.0
    first_phase: float = 0.0
    second: float = 0.0
    second_phase: float = 0.0

    def __call__(self, phase: float) -> float:
        angle = math.tau * phase
        return (
            self.offset
            + self.first * math.cos(angle + self.first_phase)
            + self.second * math.cos(2.0 * angle + self.second_phase)
        )


@dataclass(frozen=True, slots=True)
class WearerSettings:
    """One person. Lengths in m, angles in rad; left before right where there are two.

    `mass` is kg with the machine. `asymmetry` is by what share the left step is longer than the right.
    `impairment` (0 none … 1) stiffens a leg's swing, drops its foot and takes load off it. `variability`
    scales how much one stride differs from the next; 1 is a healthy adult. `sway` scales the trunk's motion.
    `walk` is None where it is the ordinary one.
    """

    mass: float = 90.0
    leg_length: float = NOMINAL_LEG_LENGTH
    asymmetry: float = 0.0
    impairment: tuple[float, float] = (0.0, 0.0)
    variability: float = 1.0
    sway: float = 1.0
    lean: float = 0.0
    foot_roll: float = 0.0  # m, how far the centre of pressure lies outside its usual place
    habits: tuple[Habit, Habit, Habit] = (Habit(), Habit(), Habit())  # hip, knee, ankle
    walk: OwnWalk | None = None


NOMINAL = WearerSettings()


def subject(number: int, walk: str = ORDINARY) -> WearerSettings:
    """Return the person with this number, always the same one; 0 is the nominal wearer.

    Every fourth on average has an impaired leg; nobody, where another `walk` than the ordinary one says how
    they walk.
    """
    person = _person(number)
    if walk == ORDINARY:
        return person
    own = own_walk(walk, number)
    return replace(
        person,
        walk=own,
        impairment=(0.0, 0.0),
        lean=person.lean + own.lean,
        variability=person.variability * own.variability,
    )


def _person(number: int) -> WearerSettings:
    if number == 0:
        return NOMINAL
    source = random.Random(f"subject {number}")

    near = partial(_near, source)
    impaired = source.uniform(0.3, 1.0) if source.random() < 0.25 else 0.0
    left_side = source.random() < 0.5
    return WearerSettings(
        mass=_MACHINE_KG + near(74.0, 12.0),
        leg_length=near(0.84, 0.05),
        asymmetry=near(0.0, 0.03),
        impairment=(impaired, 0.0) if left_side else (0.0, impaired),
        variability=math.exp(near(0.0, 0.3)),
        sway=math.exp(near(0.0, 0.25)),
        lean=near(0.0, 0.03),
        foot_roll=near(0.0, 0.003),
        habits=(_habit(source), _habit(source), _habit(source)),
    )


def _near(source: random.Random, mean: float, deviation: float) -> float:
    """Return a normal number, never further than two deviations from the mean."""
    return mean + deviation * min(max(source.gauss(0.0, 1.0), -2.0), 2.0)


def _habit(source: random.Random) -> Habit:
    near = partial(_near, source)
    return Habit(
        offset=near(0.0, math.radians(2.5)),
        first=near(0.0, math.radians(1.5)),
        first_phase=source.uniform(0.0, math.tau),
        second=near(0.0, math.radians(1.0)),
        second_phase=source.uniform(0.0, math.tau),
    )
