"""Gait events by the feet's IMUs of healthy people and patients (IPOL 2019/265), group by group.

The labels say when a foot moves, from heel off until it lies flat: neither is a toe off or a heel strike. So
a step is found where the middle of a swing that we see lies in one that is labelled, each once (as in Oudre
et al. 2018, Sensors 18, 4033). Events are compared with labels that were moved by a constant of each kind and
make of sensor, the median of healthy people; the time of a stride, landing to landing, needs no such thing.
"""

import itertools
import json
import math
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ml.benchmarks import impaired
from ml.benchmarks.impaired_groups import interval
from server_gui.core.processing.foot_imu_events import FootImuEvents
from server_gui.core.processing.gait_events import EventKind, Leg
from tests.unit.processing.scoring import Score, score

PERIOD_NS = 10_000_000
KINDS = (EventKind.TOE_OFF, EventKind.HEEL_STRIKE)  # the begin and the end of a swing
Interval = tuple[float, float]  # ns


@dataclass
class Foot:
    """One foot in one walk."""

    walk: impaired.Walk
    steps: list[Interval]  # labelled
    events: dict[EventKind, list[float]]
    swings: list[Interval]
    pairs: list[tuple[int, int]]  # of a labelled step and the swing that finds it


@dataclass
class Person:
    """What was found of one person."""

    group: str
    steps: Score = field(default_factory=Score)
    events: dict[EventKind, Score] = field(default_factory=lambda: {kind: Score() for kind in KINDS})
    stride_errors_ns: list[float] = field(default_factory=list)

    @property
    def figures(self) -> dict[str, float]:
        strides = self.stride_errors_ns
        found = len(self.steps.errors_ns)
        return {
            "step F1": self.steps.f1,
            "recall": found / max(1, self.steps.true),
            "precision": found / max(1, self.steps.found),
            "strike F1": self.events[EventKind.HEEL_STRIKE].f1,
            "toe off F1": self.events[EventKind.TOE_OFF].f1,
            "stride ms": float(np.sqrt(np.mean(np.square(strides)))) / 1e6 if strides else math.nan,
        }


def against_groups(file: Path) -> int:
    """Print each group's figures, the worst first."""
    feet = [foot for walk in impaired.read(file) for foot in _feet(walk)]
    later = _usual(feet)
    people: dict[int, Person] = {}
    for foot in feet:
        person = people.setdefault(foot.walk.subject, Person(foot.walk.group))
        _count(person, foot, later)
    _show(people.values(), later)
    return 0


def _feet(walk: impaired.Walk) -> Iterator[Foot]:
    for leg, pitch, moving in zip(Leg, (walk.rates[:, 1], walk.rates[:, 4]), walk.moving, strict=True):
        begins = np.flatnonzero(np.diff(moving.astype(int), prepend=0) == 1)
        ends = np.flatnonzero(np.diff(moving.astype(int), append=0) == -1) + 1
        steps = [
            (float(begin) * PERIOD_NS, float(end) * PERIOD_NS)
            for begin, end in zip(begins, ends, strict=True)
        ]
        events: dict[EventKind, list[float]] = {kind: [] for kind in KINDS}
        swings, off_ns = [], None
        detector = FootImuEvents(leg)
        for place, rate in enumerate((-pitch).tolist()):  # toes down positive
            event = detector.feed(place * PERIOD_NS, rate)
            if event is None:
                continue
            events[event.kind].append(float(event.stamp_ns))
            if event.kind is EventKind.TOE_OFF:
                off_ns = float(event.stamp_ns)
            elif off_ns is not None:
                swings.append((off_ns, float(event.stamp_ns)))
                off_ns = None
        yield Foot(walk, steps, events, swings, list(found_in(steps, swings)))


def found_in(steps: Sequence[Interval], swings: Sequence[Interval]) -> Iterator[tuple[int, int]]:
    """Pair each labelled step with the swing whose middle lies in it, each step and each swing once."""
    place = 0
    for number, (begin, end) in enumerate(swings):
        middle = (begin + end) / 2
        while place < len(steps) and steps[place][1] <= middle:
            place += 1
        if place < len(steps) and steps[place][0] <= middle:
            yield place, number
            place += 1


def _usual(feet: Sequence[Foot]) -> dict[tuple[EventKind, str], float]:
    """Measure from label to event, by kind and make of sensor: the median of healthy people's medians."""
    apart: dict[tuple[EventKind, str], dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    for foot in feet:
        if foot.walk.group == impaired.HEALTHY:
            for step, swing in foot.pairs:
                for kind, label, event in zip(KINDS, foot.steps[step], foot.swings[swing], strict=True):
                    apart[kind, foot.walk.sensor][foot.walk.subject].append(event - label)
    return {
        key: float(np.median([np.median(one) for one in people.values()])) for key, people in apart.items()
    }


def _count(person: Person, foot: Foot, later: Mapping[tuple[EventKind, str], float]) -> None:
    middles = [0.0] * len(foot.pairs)  # how far apart is of no meaning: what counts is how many
    person.steps.add(Score(len(foot.steps), len(foot.swings), middles))
    for place, kind in enumerate(KINDS):
        moved = [step[place] + later[kind, foot.walk.sensor] for step in foot.steps]
        person.events[kind].add(score(moved, foot.events[kind]))
    for (step, swing), (next_step, next_swing) in itertools.pairwise(foot.pairs):
        if next_step == step + 1 and next_swing == swing + 1:
            seen = foot.swings[next_swing][1] - foot.swings[swing][1]
            person.stride_errors_ns.append(seen - (foot.steps[next_step][1] - foot.steps[step][1]))


def _show(people: Iterable[Person], later: Mapping[tuple[EventKind, str], float]) -> None:
    groups: dict[str, list[Person]] = defaultdict(list)
    for person in people:
        groups[person.group].append(person)
    for (kind, sensor), moved_ns in sorted(later.items()):
        sys.stdout.write(f"{kind} of {sensor}: {moved_ns / 1e6:.0f} ms after the label, in healthy people\n")
    rows = {name: _row(own) for name, own in groups.items()}
    sys.stdout.write(f"\n{'':<16}" + "".join(f"{name:>22}" for name in next(iter(rows.values()))) + "\n")
    for name, row in sorted(rows.items(), key=lambda one: one[1]["step F1"][0]):
        cells = "".join(f"{_cell(values):>22}" for values in row.values())
        sys.stdout.write(f"{name:<16}{cells}\n")
        figures = {figure: [round(value, 4) for value in values] for figure, values in row.items()}
        sys.stdout.write(json.dumps({"group": name, **figures}) + "\n")


def _row(people: Sequence[Person]) -> dict[str, tuple[float, ...]]:
    """Return means over people with 95 % intervals; and the worst third and the worst one in step F1."""
    each = [person.figures for person in people]
    row: dict[str, tuple[float, ...]] = {"people": (float(len(people)),)}
    for figure in each[0]:
        values = [one[figure] for one in each]
        row[figure] = (float(np.nanmean(values)), *interval(values))
    f1 = sorted(one["step F1"] for one in each)
    return row | {"worst third": (float(np.mean(f1[: math.ceil(len(f1) / 3)])),), "worst": (f1[0],)}


def _cell(values: Sequence[float]) -> str:
    first, *bounds = (f"{value:.3f}" if value < 2 else f"{value:.0f}" for value in values)
    return f"{first} ({bounds[0]}…{bounds[1]})" if bounds else first
