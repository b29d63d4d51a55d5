"""Practice: everything that a wearer does, at every pace and setting of the controller, to learn from."""

import random
from collections.abc import Iterator

from hil_sim.controller import objects
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.gait.activity import Activity
from hil_sim.gait.timetable import Entry, Pace

# How long (s) each part of a round lasts, at least and at most.
_VISITS: tuple[tuple[Activity, float, float], ...] = (
    *((Activity.STAND, 3.0, 10.0),) * 2,
    *((Activity.WALK, 5.0, 14.0),) * 4,
    *((Activity.SIT, 5.0, 12.0),) * 2,
    (Activity.STAIRS_UP, 5.0, 12.0),
    (Activity.STAIRS_DOWN, 5.0, 12.0),
    (Activity.RAMP_UP, 5.0, 12.0),
    (Activity.RAMP_DOWN, 5.0, 12.0),
    (Activity.TURN_LEFT, 4.0, 8.0),
    (Activity.TURN_RIGHT, 4.0, 8.0),
    *((Activity.STUMBLE, 6.0, 9.0),) * 2,
    (Activity.FALL, 3.5, 7.0),  # what comes next gets up first
)
_STEP_LENGTH = (0.20, 0.60)  # m
_CYCLE_TIME = (1.0, 2.4)  # s
_SLOW_CYCLE, _SLOW_SHARE = (2.4, 4.0), 0.1
_TOE_HEIGHT = (20, 120)  # mm
_TRUNK_ANGLE = (-100, 300)  # 0.001 rad
_TUNED_SHARE = 0.4  # of the parts: somebody has changed toe height and trunk angle


def practice(robot: Exoskeleton, seed: int) -> Iterator[Entry]:
    """Yield rounds without end, each in another order and with other settings of `robot`'s controller."""
    source = random.Random(f"{seed} practice")
    usual = {
        key: robot.controller.dictionary.number(key) for key in (objects.TOE_HEIGHT, objects.TRUNK_ANGLE)
    }
    while True:
        visits = list(_VISITS)
        source.shuffle(visits)
        for activity, least, most in visits:
            tuned = source.random() < _TUNED_SHARE
            wanted = (
                {
                    objects.TOE_HEIGHT: source.randint(*_TOE_HEIGHT),
                    objects.TRUNK_ANGLE: source.randint(*_TRUNK_ANGLE),
                }
                if tuned
                else usual
            )
            for key, value in wanted.items():
                robot.controller.dictionary[key].take(value)
            yield Entry(activity, source.uniform(least, most), _pace(source))


def _pace(source: random.Random) -> Pace:
    slow = source.random() < _SLOW_SHARE
    return source.uniform(*_STEP_LENGTH), source.uniform(*(_SLOW_CYCLE if slow else _CYCLE_TIME))
