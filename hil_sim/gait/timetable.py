"""Timetables: which activity comes when, and at what pace; among them a day of everything."""

import math
import random
from collections.abc import Iterator
from itertools import cycle
from typing import NamedTuple

from hil_sim.gait.activity import Activity

Pace = tuple[float, float]  # step length (m), cycle time (s)

SLOW: Pace = (0.30, 2.0)
NORMAL: Pace = (0.42, 1.5)
FAST: Pace = (0.55, 1.15)

_SPREAD = 0.08  # by what share a pace differs from time to time


class Entry(NamedTuple):
    """An entry of the timetable: an activity and its duration (s; between two commands, with transitions)."""

    activity: Activity
    seconds: float = math.inf
    pace: Pace | None = None


class _Visit(NamedTuple):
    """One part of a day: for how long at least and at most (s)."""

    activity: Activity
    least: float
    most: float
    pace: Pace = NORMAL


_VISITS = (
    _Visit(Activity.STAND, 8.0, 20.0),
    _Visit(Activity.WALK, 12.0, 30.0, SLOW),
    _Visit(Activity.WALK, 12.0, 30.0),
    _Visit(Activity.WALK, 12.0, 30.0, FAST),
    _Visit(Activity.SIT, 12.0, 30.0),
    _Visit(Activity.STAIRS_UP, 8.0, 16.0),
    _Visit(Activity.STAIRS_DOWN, 8.0, 16.0),
    _Visit(Activity.RAMP_UP, 8.0, 16.0),
    _Visit(Activity.RAMP_DOWN, 8.0, 16.0),
    _Visit(Activity.TURN_LEFT, 5.0, 10.0),
    _Visit(Activity.TURN_RIGHT, 5.0, 10.0),
    _Visit(Activity.STUMBLE, 8.0, 12.0),
)
_FALL = (_Visit(Activity.FALL, 5.0, 9.0), _Visit(Activity.STAND, 8.0, 12.0))  # and getting up

_LOOPS = {
    "sit_to_stand": (Entry(Activity.SIT, 5.0), Entry(Activity.STAND, 5.0)),
    "stumble": (Entry(Activity.WALK, 6.0), Entry(Activity.STUMBLE, 4.0)),
    "fall": (Entry(Activity.WALK, 6.0), Entry(Activity.FALL, 5.0), Entry(Activity.STAND, 6.0)),
}


def day(seed: int) -> Iterator[Entry]:
    """Yield endless rounds of all activities in changing order, each with one stumble and one fall."""
    source = random.Random(f"{seed} day")
    yield Entry(Activity.STAND, 3.0)
    while True:
        visits = list(_VISITS)
        source.shuffle(visits)
        for visit in (*visits, *_FALL):
            yield Entry(visit.activity, source.uniform(visit.least, visit.most), _near(visit.pace, source))


def _near(pace: Pace, source: random.Random) -> Pace:
    step_length, cycle_time = (value * source.uniform(1.0 - _SPREAD, 1.0 + _SPREAD) for value in pace)
    return step_length, cycle_time


def timetable(name: str, seed: int) -> Iterator[Entry]:
    """Yield the entries of a scenario: `day`, one that repeats, or an activity that lasts."""
    if name == "day":
        return day(seed)
    if name in _LOOPS:
        return cycle(_LOOPS[name])
    return iter([Entry(Activity[name.upper()])])
