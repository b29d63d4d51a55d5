"""Whether A/B trials are right: on simulated wearers, faster than real time, by the engine that robots meet.

    python -m tests.bench ab_trials             # 50 walks a case: hours on two cores
    python -m tests.bench ab_trials --quick     # 1 walk a case
    python -m tests.bench ab_trials --walks 8
    python -m tests.bench ab_trials --made-up 200    # made-up strides instead, 1,000 trials: 20 minutes
    python -m tests.bench ab_trials --made-up 8 --walks 1    # both

Each walk is another wearer with strides, noise and order of its own. The cases: *nothing* (the speed of
profile moves, in which nobody walks), the same while friction grows by a fifth a minute (*straight drift*),
or grows and falls by two fifths, one period of a sine (*bent drift*); a position gain that is a fifth too
low; and a longer gait cycle. Every metric that is said to differ where nothing did is an error.

Made-up strides have every metric of six joints and the robot; neighbours correlate by 0.5. They are judged
twice: as an A/B trial, and as one edit with as many strides before as after, by the evidence for edits.
"""

import argparse
import collections
import json
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from typing import Any, Final

import numpy as np

from gateway.coding import Number
from gateway.units import Unit
from gateway.wire.parameter import ParameterInfo, Reverted, Written
from hil_sim.exoskeleton import Exoskeleton
from server_gui.core.evidence.comparison import Evidence, Spell, Word, compare
from server_gui.core.evidence.cycles import Cycle
from server_gui.core.evidence.metrics import OF_JOINTS, OF_ROBOTS
from server_gui.core.experiments.machine import ExperimentState
from server_gui.core.experiments.plan import USUAL_CYCLES, USUAL_PAIRS, USUAL_TRANSIENT, ab, orders
from server_gui.core.experiments.result import result
from server_gui.core.experiments.run import Run
from server_gui.core.experiments.verdict import HeldPeriod, judge
from server_gui.core.follow.events import Telemetry
from server_gui.core.processing.gait_events import Leg
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


class EndedEarly(Exception):
    """A stop rule has ended a trial: it says nothing, rightly or wrongly."""


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
            if run.state is ExperimentState.LOOKING:
                run.take(looked({name: first}, at_ns=now_ns))
        run.take(event)
        run.tick(())
        if run.is_over:
            break
    told = result(run, "bench", "")
    assert told is not None, f"{case} {number}: {run.state} {run.why}"
    if not run.is_whole:
        raise EndedEarly(run.why)
    return told.evidence


def said(task: tuple[str, int]) -> tuple[str, int, bool | None, str]:
    """Return whether a case was judged rightly, None where it ended early, and what was said."""
    case, number = task
    try:
        words = {one.series: one.word for one in tried(case, number).metrics}
    except EndedEarly as ended:
        return case, number, None, str(ended)
    joint = JOINTS[number % len(JOINTS)]
    differing = [f"{series} {word}" for series, word in words.items() if word in DIFFER]
    right = {
        "gain": words[f"{joint}.error_rms"] is Word.WORSE,
        "cycle time": words["cadence"] is Word.CHANGED,
    }.get(case, not differing)
    return case, number, right, ", ".join(differing)


def bent(at: float, phase: float) -> float:
    """One period of a sine, 10 % peak to peak."""
    return 0.05 * math.sin(2.0 * math.pi * (at + phase))


SHAPES: Final[Mapping[str, tuple[Callable[[float, float], float], float]]] = {
    "nothing": (lambda at, phase: 0.0, 0.0),
    "straight drift": (lambda at, phase: 0.2 * at, 0.0),
    "bent drift": (bent, 0.0),
    "jump": (lambda at, phase: 0.1 * (at > phase), 0.0),
    "10 % more, bent drift": (bent, 0.1),
}


def made_up(task: tuple[str, int]) -> tuple[str, bool, bool]:
    """Whether anything is said to differ by an A/B trial, and by one edit; of an effect, its metric."""
    shape, seed = task
    drift, effect = SHAPES[shape]
    source = np.random.default_rng(seed)
    every = orders(USUAL_PAIRS)
    order = every[source.integers(len(every))]
    series = [f"{joint}.{metric.key}" for joint in JOINTS for metric in OF_JOINTS if not metric.is_slope]
    series += [metric.key for metric in OF_ROBOTS]
    edited = f"{JOINTS[0]}.error_rms"
    count, phase = 2 * USUAL_PAIRS * (USUAL_CYCLES + USUAL_TRANSIENT), source.random()
    noise, level = source.normal(scale=0.03, size=(count, len(series))), np.zeros(len(series))
    is_b = np.repeat(np.column_stack([order < 0, order > 0]).ravel(), USUAL_CYCLES + USUAL_TRANSIENT)
    found: list[list[Cycle]] = [[], []]
    for side, has in enumerate((is_b, np.arange(count) >= count // 2)):
        for place in range(count):
            level = 0.5 * level + noise[place]
            values = dict(zip(series, (1.0 + drift(place / count, phase) + level).tolist(), strict=True))
            values[edited] += effect * has[place]
            leg, began_ns = (Leg.LEFT, Leg.RIGHT)[place % 2], place * 600_000_000
            found[side].append(Cycle(leg, began_ns, began_ns + 1_200_000_000, "", values))
    held = USUAL_CYCLES + USUAL_TRANSIENT
    periods = [
        HeldPeriod(float(is_b[first]), found[0][first + USUAL_TRANSIENT : first + held])
        for first in range(0, count, held)
    ]
    tried = judge((0.0, 1.0), order, periods, JOINTS, JOINTS[:1])
    middle_ns = count // 2 * 600_000_000
    spell = Spell([(0, middle_ns)], [(middle_ns, 2**62)])
    once = compare(found[1], spell, JOINTS, JOINTS[:1])
    said_of = [{one.series for one in told.metrics if one.word in DIFFER} for told in (tried, once)]
    by_ab, by_edit = ((edited in said if effect else bool(said)) for said in said_of)
    return shape, by_ab, by_edit


def of_made_up(count: int) -> int:
    """Say how often anything was said to differ; 1 where nulls were too often, or effects too seldom."""
    told: collections.Counter[tuple[str, str]] = collections.Counter()
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        tasks = [(shape, seed) for shape in SHAPES for seed in range(count)]
        for shape, by_ab, by_edit in pool.map(made_up, tasks, chunksize=10):
            told[shape, "A/B trial"] += by_ab
            told[shape, "one edit"] += by_edit
    nulls = [told[shape, "A/B trial"] / count for shape in SHAPES if not SHAPES[shape][1]]
    found = [told[shape, "A/B trial"] / count for shape in SHAPES if SHAPES[shape][1]]
    sys.stdout.write(
        json.dumps({"of": count, **{" by ".join(key): told[key] for key in sorted(told)}}) + "\n"
    )
    return int(sum(nulls) / len(nulls) > MOST_WRONG or min(found) < LEAST_RIGHT)


def main(argv: Sequence[str] = ()) -> int:
    """Exit code: 1 where more is wrong than may be."""
    made = argparse.ArgumentParser("tests.bench ab_trials")
    made.add_argument("--walks", type=int)
    made.add_argument("--from", dest="first", type=int, default=0)
    made.add_argument("--case", action="append", choices=list(CASES))
    made.add_argument("--made-up", type=int, default=0)
    asked = made.parse_args(argv)
    walks = asked.walks or (1 if "--quick" in sys.argv else WALKS)
    if walks < 1 or asked.made_up < 0 or asked.first < 0:
        made.error("--walks, --made-up and --from take whole numbers above zero")
    wrong = of_made_up(asked.made_up) if asked.made_up else 0
    if asked.made_up and not asked.walks:
        return wrong
    numbers = range(asked.first, asked.first + walks)
    tasks = [(case, number) for number in numbers for case in (asked.case or CASES)]
    right: collections.Counter[str] = collections.Counter()
    whole: collections.Counter[str] = collections.Counter()
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for case, number, is_right, words in pool.map(said, tasks):
            right[case] += bool(is_right)
            whole[case] += is_right is not None
            word = {True: "right", False: "WRONG", None: "ended early"}[is_right]
            sys.stdout.write(f"{case} {number}: {word}: {words or 'nothing'}\n")
            sys.stdout.flush()
    shares = {case: round(right[case] / max(1, whole[case]), 3) for case in (asked.case or CASES)}
    sys.stdout.write(json.dumps({"walks": walks, "whole": whole, "right": shares}) + "\n")
    return int(min(shares.values()) < LEAST_RIGHT) or wrong


if __name__ == "__main__":
    sys.exit(main([word for word in sys.argv[1:] if word != "--quick"]))
