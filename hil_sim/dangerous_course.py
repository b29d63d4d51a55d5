"""A wearer's way through every danger, one after the other, with healthy walking before and between."""

import random
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from hil_sim.dangers import DANGERS, EVERYWHERE, LEVEL, LONGEST_S, DangerContext, healthy
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.faults.injector import Faults
from hil_sim.gait.activity import Activity
from hil_sim.gait.stumble_and_fall import FallState

HEALTHY, OVER = 0.0, -1.0  # what `now` says, but for the number of a danger from 1 on
WALKS_S: Final = 5.0  # in a steady gait before a danger
GOES_ON_S: Final = 0.5  # after harm
RESTS_S: Final = 5.0  # after a danger: what follows counts as healthy again


class Course:
    """Leads `robot` from its first cycle of the sensors on; `now` says in which danger it is.

    `healthy_s` of healthy walking come before the first danger, and between two of them a visit more; where
    there are no `dangers`, all of it is on level ground.
    """

    def __init__(self, robot: Exoskeleton, seed: int, healthy_s: float, dangers: Sequence[str]) -> None:
        self.now, self.harmed = HEALTHY, False
        self._robot = robot
        self._source = random.Random(f"{seed} dangers")
        self._faults = Faults(robot, Path(), seed)
        self._dangers = list(dangers)
        self._source.shuffle(self._dangers)
        self._ways = healthy(self._source, EVERYWHERE if dangers else LEVEL)
        self._course = self._steps(healthy_s)
        self._waits = next(self._course)
        robot.measured.insert(0, self._step)

    def _step(self) -> None:
        if not next(self._waits, None):
            following = next(self._course, None)
            if following is not None:
                self._waits = following

    def _steps(self, healthy_s: float) -> Iterator[Iterator[bool]]:
        yield self._healthy(healthy_s)
        for name in self._dangers:
            yield self._wait(WALKS_S, DANGERS[name].doing, steady=True)
            yield self._danger(name)
            yield self._rest()
            yield self._healthy(0.0)
        while True:
            yield self._healthy(60.0)

    def _healthy(self, seconds: float) -> Iterator[bool]:
        """Walk on for so long, and to the end of the visit under way."""
        end_s = self._robot.clock.now_s + seconds
        while True:
            entry = next(self._ways)
            self._robot.controller.go(entry.activity, self._robot.own_pace(entry.pace))
            until_s = self._robot.clock.now_s + entry.seconds
            while self._robot.clock.now_s < until_s:
                yield True
            if until_s >= end_s:
                return

    def _wait(self, seconds: float, doing: Activity, *, steady: bool = False) -> Iterator[bool]:
        pace = self._robot.own_pace((self._source.uniform(0.30, 0.55), self._source.uniform(1.4, 2.4)))
        self._robot.controller.go(Activity.WALK if steady else doing, pace)
        until_s = self._robot.clock.now_s + seconds + self._source.uniform(0.0, 2.0)
        while self._robot.clock.now_s < until_s or self._robot.controller.generator.in_transition:
            yield True
        self._robot.controller.go(doing)
        stops_s = self._robot.clock.now_s + (0.7 if doing is Activity.STAND else 0.0)
        while self._robot.clock.now_s < stops_s:
            yield True

    def _danger(self, name: str) -> Iterator[bool]:
        danger, clock = DANGERS[name], self._robot.clock
        warmth = {drive.name: drive.temperature_c for drive in self._robot.simulated_drives}
        on, params = danger.drawn(self._source)
        seen = DangerContext(self._robot, on, weak=self._robot.controller.generator.impairment[0])
        self._faults.begin(danger.fault, on, None, params)
        self.now = 1.0 + list(DANGERS).index(name)
        end_s = clock.now_s + LONGEST_S
        while clock.now_s < end_s and not self.harmed:
            yield True
            self.harmed = danger.harmed(seen)
        goes_on_s = clock.now_s + GOES_ON_S
        while clock.now_s < goes_on_s:
            yield True
        self._faults.clear()
        self.now, self.harmed = OVER, False
        for drive in self._robot.simulated_drives:
            drive.temperature_c = warmth[drive.name]

    def _rest(self) -> Iterator[bool]:
        self._robot.controller.go(Activity.STAND)
        until_s = self._robot.clock.now_s + RESTS_S
        fall = self._robot.controller.generator.fall
        while self._robot.clock.now_s < until_s or fall.state is not FallState.UPRIGHT:
            yield True
        self.now = HEALTHY
