"""A wearer who is told what to do, and everything that is felt meanwhile."""

import random
from dataclasses import dataclass
from functools import cache

from hil_sim.gait.activity import Activity, Label
from hil_sim.gait.curves import Leg
from hil_sim.gait.generator import Generator
from hil_sim.gait.subject import NOMINAL, WearerSettings
from hil_sim.gait.walk import Shape
from hil_sim.gait.wearer import Foot, Trunk, Wearer

USUAL = Shape(step_length=0.4, cycle_time=1.6, toe_height=0.06, trunk_angle=0.0)
DT = 0.01


@dataclass(frozen=True)
class Moment:
    """What is so at one moment."""

    time_s: float
    label: Label
    moving: bool
    legs: tuple[Leg, Leg]
    phases: tuple[float, float]
    feet: tuple[Foot, Foot]
    trunk: Trunk
    support: float

    @property
    def vertical(self) -> float:
        """All vertical forces (N)."""
        return self.feet[0].force + self.feet[1].force + self.support


class Moving:
    """One wearer; `seed` None makes every stride like the other."""

    def __init__(self, shape: Shape = USUAL, who: WearerSettings = NOMINAL, seed: int | None = None) -> None:
        self.shape = shape
        self.generator = Generator(shape, who, None if seed is None else random.Random(seed))
        self.wearer = Wearer(self.generator)
        self.time_s = 0.0

    def go(self, activity: Activity, seconds: float, dt: float = DT) -> None:
        """Do it, and nobody looks: that costs a third."""
        for _ in range(round(seconds / dt)):
            self._move(activity, dt)

    def do(self, activity: Activity, seconds: float, dt: float = DT) -> list[Moment]:
        return [self._step(activity, dt) for _ in range(round(seconds / dt))]

    def _step(self, activity: Activity, dt: float) -> Moment:
        generator, wearer = self.generator, self.wearer
        self._move(activity, dt)
        return Moment(
            self.time_s,
            generator.label,
            generator.in_transition,
            generator.legs(),
            (generator.leg_phase(0), generator.leg_phase(1)),
            wearer.feet(self.time_s),
            wearer.trunk(self.time_s),
            wearer.support(),
        )

    def _move(self, activity: Activity, dt: float) -> None:
        self.generator.step(dt, activity, self.shape)
        self.time_s += dt


@cache
def stride_of(activity: Activity, shape: Shape = USUAL, who: WearerSettings = NOMINAL) -> list[Moment]:
    """Three even strides, after the start is over."""
    moving = Moving(shape, who)
    moving.go(activity, 3.0)
    return moving.do(activity, 3.0 * shape.cycle_time)
