"""Whether A/B trials are right: on simulated wearers, faster than real time, by the engine that robots meet.

    python -m tests.bench ab_trials             # 50 walks a case: hours on two cores
    python -m tests.bench ab_trials --quick     # 1 walk a case
    python -m tests.bench ab_trials --walks 8

Each walk is another wearer with strides, noise and order of its own. The cases: *nothing* (the speed of
profile moves, in which nobody walks), the same while friction grows by a fifth a minute (*straight drift*),
or grows and falls by two fifths, one period of a sine (*bent drift*); a position gain that is a fifth too
low; and a longer gait cycle. Every metric that is said to differ where nothing did is an error.
"""

import argparse
import collections
import json
import math
import os
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from typing import Any, Final

from gateway.coding import Number
from gateway.units import Unit
from gateway.wire.parameter import ParameterInfo, Reverted, Written
from hil_sim.exoskeleton import Exoskeleton
from server_gui.core.evidence.comparison import Evidence, Word
from server_gui.core.experiments.machine import State
from server_gui.core.experiments.plan import USUAL_PAIRS, ab
from server_gui.core.experiments.result import result
from server_gui.core.experiments.run import Run
from server_gui.core.follow.events import Telemetry
from server_gui.core.tuning.commands import ReadBack
from tests.support.desk import JOINTS, FakeCommands, described, looked
from tests.unit.evidence.walks import CYCLE_TIME, FIRST, GAIN, SPEED, walk, warming, write

WALKS: Final = 50
LONGEST_S: Final = 900.0
LEAST_RIGHT, MOST_WRONG = 0.95, 0.05
DIFFER: Final = frozenset({Word.BETTER, Word.WORSE, Word.CHANGED})
Each = Callable[[Exoskeleton, float], None]


def bending(robot: Exoskeleton, now_s: float) -> None:
    """Friction that grows and falls by two fifths, once in the time that a trial takes."""
    for drive in robot.drives.values():
        drive.joint.friction_factor = 1.0 + 0.4 * math.sin(2.0 * math.pi * now_s / 300.0)


def usual(robot: Exoskeleton, now_s: float) -> None:
    """Nothing."""


CASES: Final[Mapping[str, tuple[str, float, Each]]] = {
    "nothing": (SPEED, 2.0, usual),
    "straight drift": (SPEED, 2.0, warming),
    "bent drift": (SPEED, 2.0, bending),
    "gain": (GAIN, 2400.0, usual),
    "cycle time": ("cycle_time", 1.8, usual),
}


class SimCommands(FakeCommands):
    """Writes to a simulated robot at once, and holds its trials."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.robot: Exoskeleton | None = None
        self._first = self._held = FIRST[name.partition(".")[2]]
        self._name, self._number = name, 0

    def _set(self, value: float) -> None:
        self._held = value
        assert self.robot is not None
        write(self.robot, self._name, value)

    def write(self, changes: Mapping[str, Number], trial_s: float | None) -> "Future[Any]":
        (value,) = changes.values()
        self._set(value)
        self._number += 1
        return done(Written(self._number, {self._name: self._first}, {self._name: value}, trial_s))

    def revert(self, write: int) -> "Future[Any]":
        self._set(self._first)
        return done(Reverted(write, {self._name: "taken back"}))

    def read_back(self, name: str) -> "Future[Any]":
        return done(ReadBack(self._held, None, on_trial=False))


def done(answer: object) -> "Future[Any]":
    """Return a future that has ended."""
    future: Future[Any] = Future()
    future.set_result(answer)
    return future


def tried(case: str, number: int, pairs: int = USUAL_PAIRS) -> Evidence:
    """Return what one A/B trial says."""
    parameter, value, each = CASES[case]
    joint = JOINTS[number % len(JOINTS)]
    name = CYCLE_TIME if parameter == "cycle_time" else f"{joint}.{parameter}"
    first = FIRST[parameter]
    info = ParameterInfo(name, "", 0.0, 1e6, None, True, None, name.partition(".")[0], "0x2001:0", "rw", True)
    plan = ab(info, first, (first, value), Unit("", ""), pairs=pairs, seed=number)
    commands = SimCommands(name)

    def every(robot: Exoskeleton, now_s: float) -> None:
        commands.robot = robot
        each(robot, now_s)

    now_ns = 0
    run = Run(plan, "exo-01", commands, lambda call: call(), described(), lambda: now_ns)
    for event in walk(LONGEST_S, seed=5000 + number, person=number, each_s=every):
        if isinstance(event, Telemetry):
            now_ns = event.batch.stamps_ns[-1]
            if run.state is State.LOOKING:
                run.take(looked({name: first}, at_ns=now_ns))
        run.take(event)
        run.tick(())
        if run.is_over:
            break
    told = result(run, "bench", "")
    assert told is not None, f"{case} {number}: {run.state} {run.why}"
    assert run.is_whole, f"{case} {number}: {run.state} {run.why}"
    return told.evidence


def said(task: tuple[str, int]) -> tuple[str, int, bool, str]:
    """Return whether a case was judged rightly, and what was said."""
    case, number = task
    words = {one.series: one.word for one in tried(case, number).metrics}
    joint = JOINTS[number % len(JOINTS)]
    differing = [f"{series} {word}" for series, word in words.items() if word in DIFFER]
    right = {
        "gain": words[f"{joint}.error_rms"] is Word.WORSE,
        "cycle time": words["cadence"] is Word.CHANGED,
    }.get(case, not differing)
    return case, number, right, ", ".join(differing)


def main() -> int:
    """Exit code: 1 where more is wrong than may be."""
    made = argparse.ArgumentParser()
    made.add_argument("--quick", action="store_true")
    made.add_argument("--walks", type=int, default=WALKS)
    made.add_argument("--from", dest="first", type=int, default=0)
    made.add_argument("--case", action="append", choices=list(CASES))
    asked = made.parse_args()
    walks = 1 if asked.quick else asked.walks
    numbers = range(asked.first, asked.first + walks)
    tasks = [(case, number) for number in numbers for case in (asked.case or CASES)]
    right: collections.Counter[str] = collections.Counter()
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for case, number, is_right, words in pool.map(said, tasks):
            right[case] += is_right
            sys.stdout.write(f"{case} {number}: {'right' if is_right else 'WRONG'}: {words or 'nothing'}\n")
            sys.stdout.flush()
    shares = {case: round(right[case] / walks, 3) for case in (asked.case or CASES)}
    sys.stdout.write(json.dumps({"walks": walks, "right": shares}) + "\n")
    return int(min(shares.values()) < LEAST_RIGHT)


if __name__ == "__main__":
    sys.exit(main())
