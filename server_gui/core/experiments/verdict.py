"""Verdict of an A/B trial: each metric's means over the periods, pair by pair, tested by their draw."""

import collections
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from gateway.amounts import counted
from server_gui.core.evidence.comparison import Evidence, Measured, Word, differing, verdict, word_of
from server_gui.core.evidence.cycles import Cycle
from server_gui.core.evidence.metrics import OF_JOINTS, OF_ROBOTS, Metric
from server_gui.core.experiments.plan import FEWEST_PAIRS, orders
from server_gui.core.experiments.randomisation import randomised
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.wiring import leg_of

Floats = npt.NDArray[np.float64]
ALPHA: Final = 0.05  # that any metric is wrongly said to differ: it is looked at once, at the end
FEWEST: Final = 3  # cycles of a period
SAME_SPEED: Final = 0.03  # of the stride's time: beyond that nothing but the cadence is compared
TOLD: Final = "too few strides are equally long, so that only the cadence can be compared"


@dataclass(frozen=True, slots=True)
class HeldPeriod:
    """A period and its cycles that count, without those that followed the change."""

    value: float
    cycles: Sequence[Cycle]

    def of(self, leg: Leg) -> list[Cycle]:
        """Return those of one leg."""
        return [cycle for cycle in self.cycles if cycle.leg is leg]


@dataclass(frozen=True, slots=True)
class Series:
    """A metric, and of which leg's cycles it is taken."""

    key: str
    metric: Metric
    leg: Leg

    @property
    def component(self) -> str:
        """The metric's component; empty: the robot."""
        return self.key.rpartition(".")[0]

    @property
    def title(self) -> str:
        """In words."""
        return f"{self.component} {self.metric.title}".strip()


def all_series(joints: Sequence[str], periods: Sequence[HeldPeriod]) -> list[Series]:
    """Return every metric of these joints and of the robot."""
    counts = collections.Counter(cycle.leg for held in periods for cycle in held.cycles)
    most = max(Leg, key=lambda leg: counts[leg])
    of_joints = [
        Series(f"{joint}.{metric.key}", metric, leg_of(joint) or most)
        for joint in joints
        for metric in OF_JOINTS
    ]
    return of_joints + [Series(metric.key, metric, most) for metric in OF_ROBOTS]


def judge(
    values: tuple[float, float],
    order: npt.NDArray[np.int8],
    periods: Sequence[HeldPeriod],
    joints: Sequence[str],
    edited: Sequence[str],
) -> Evidence:
    """Return the effect of the second value against the first, as evidence *before* and *after*.

    `order` has of each planned pair which value came first (1: the first), `periods` what was held, in time.
    """
    pairs = [(periods[place], periods[place + 1]) for place in range(0, len(periods) - 1, 2)]
    sides = [[held for held in periods if held.value == value] for value in values]
    counts = [sum(len(held.cycles) for held in side) for side in sides]
    series = all_series(joints, periods)
    families = (
        [one for one in series if one.component in edited],
        [one for one in series if one.component and one.component not in edited],
        [one for one in series if not one.component],
    )
    strides = _strides(sides)
    is_same = abs(strides[1] - strides[0]) <= SAME_SPEED * strides[0]
    found = [_family(family, pairs, order, sides, is_same=is_same) for family in families]
    shares = sum(any(one.p is not None for one, _ in family) for family in found)
    measured = [_worded(one, metric, shares) for family in found for one, metric in family]
    own = {one.key for one in families[0]} or {one.key for one in series if one.component}
    strongest = max(differing(measured), key=lambda one: abs(one.size or 0.0), default=None)
    return Evidence(
        word=verdict(measured, [one for one in measured if one.series in own]),
        strongest="" if strongest is None else strongest.series,
        metrics=tuple(measured),
        cycles_before=counts[0],
        cycles_after=counts[1],
        left_out=_left_out(periods),
        notes=tuple(_notes(len(pairs), strides, is_same=is_same)),
    )


def _strides(sides: Sequence[Sequence[HeldPeriod]]) -> list[float]:
    """Return the mean stride times with both values (s)."""
    lengths = [[cycle.seconds for held in side for cycle in held.cycles] for side in sides]
    return [float(np.mean(side)) if side else 1.0 for side in lengths]


def _left_out(periods: Iterable[HeldPeriod]) -> dict[str, int]:
    return dict(
        collections.Counter(
            f"{joint}: {why}"
            for held in periods
            for cycle in held.cycles
            for joint, why in cycle.left_out.items()
        )
    )


def _notes(pairs: int, strides: Sequence[float], *, is_same: bool) -> Iterator[str]:
    if pairs < FEWEST_PAIRS:
        found = counted(pairs, "whole pair")
        yield f"{found}: with fewer than {FEWEST_PAIRS} no order can tell chance from an effect"
    if not is_same:
        first, second = strides
        yield f"strides lasted {first:.2f} s with the first value, {second:.2f} s with the second: {TOLD}"


def _family(
    series: Sequence[Series],
    pairs: Sequence[tuple[HeldPeriod, HeldPeriod]],
    order: npt.NDArray[np.int8],
    sides: Sequence[Sequence[HeldPeriod]],
    *,
    is_same: bool,
) -> list[tuple[Measured, Metric]]:
    """Return each metric's result; p is not yet adjusted for the other families."""
    means = {one.key: period_means(one, [held for pair in pairs for held in pair]) for one in series}
    groups: dict[bytes, list[Series]] = {}
    found: dict[str, Measured] = {}
    for one in series:
        known = ~np.isnan(means[one.key]).reshape(-1, 2).any(axis=1)
        told = _told(one, sides)
        found[one.key] = told
        if told.word is Word.NO_DATA:
            continue
        if np.count_nonzero(known) < FEWEST_PAIRS:
            found[one.key] = _few(told, counted(int(np.count_nonzero(known)), "whole pair"))
        elif not is_same and not one.metric.is_speed:
            found[one.key] = _few(told, "strides are not equally long")
        else:
            groups.setdefault(known.tobytes(), []).append(one)
    every = orders(len(order))
    for mask, members in groups.items():
        whole = np.flatnonzero(np.frombuffer(mask, dtype=np.bool_))
        both = np.array([means[one.key].reshape(-1, 2)[whole] for one in members])
        later = (both[:, :, 1] - both[:, :, 0]).T
        test = randomised(later, order[whole], every[:, whole])
        for place, one in enumerate(members):
            numbers = (test.difference, test.low, test.high, test.p)
            found[one.key] = _measured(found[one.key], one, sides, [float(each[place]) for each in numbers])
    return [(found[one.key], one.metric) for one in series]


def period_means(one: Series, periods: Sequence[HeldPeriod]) -> Floats:
    """Return the metric's mean over each period, at equal speed; NaN where there are too few cycles.

    How it goes with the stride's time is learned within periods only, where the parameter has no part in it.
    Of temperatures it is the slope.
    """
    rows = [
        [
            (cycle.values[one.key], cycle.seconds, cycle.began_ns / 1e9)
            for cycle in held.of(one.leg)
            if one.key in cycle.values
        ]
        for held in periods
    ]
    enough = [np.array(each) for each in rows if len(each) >= FEWEST]
    slope = 0.0 if one.metric.is_speed or one.metric.is_slope else _within(enough)
    usual = float(np.mean(np.concatenate(enough)[:, 1])) if enough else 0.0
    return np.array([_mean(np.array(each), one.metric, slope, usual) for each in rows])


def _within(periods: Sequence[Floats]) -> float:
    """Return the metric's change with the stride's time, within periods."""
    centred = [period[:, :2] - period[:, :2].mean(axis=0) for period in periods]
    together = np.concatenate(centred) if centred else np.zeros((1, 2))
    power = float(together[:, 1] @ together[:, 1])
    return float(together[:, 0] @ together[:, 1]) / power if power > 0.0 else 0.0


def _mean(period: Floats, metric: Metric, slope: float, usual_s: float) -> float:
    if len(period) < FEWEST:
        return float("nan")
    if metric.is_slope:
        return float(np.polyfit(period[:, 2] - period[0, 2], period[:, 0], 1)[0])
    return float(period[:, 0].mean() - slope * (period[:, 1].mean() - usual_s))


def _values(one: Series, side: Sequence[HeldPeriod]) -> list[float]:
    return [cycle.values[one.key] for held in side for cycle in held.of(one.leg) if one.key in cycle.values]


def _told(one: Series, sides: Sequence[Sequence[HeldPeriod]]) -> Measured:
    """Return both sides' values, without a judgement."""
    values = [_values(one, side) for side in sides]
    means = [float(np.mean(side)) if side and not one.metric.is_slope else None for side in values]
    word = Word.SAME if any(values) else Word.NO_DATA
    why = "" if any(values) else "nothing tells it"
    counts = (len(values[0]), len(values[1]))
    return Measured(
        one.key, one.title, one.metric.unit, word, *counts, before=means[0], after=means[1], why=why
    )


def _few(told: Measured, why: str) -> Measured:
    return replace(told, word=Word.FEW, why=why)


def _measured(
    told: Measured, one: Series, sides: Sequence[Sequence[HeldPeriod]], numbers: Sequence[float]
) -> Measured:
    difference, low, high, p = numbers
    before, after = told.before, told.after
    if one.metric.is_slope:
        slopes = [period_means(one, side) for side in sides]
        before, after = (float(np.nanmean(side)) for side in slopes)
    spreads = [np.std(_values(one, side)) for side in sides]
    spread = float(np.mean(spreads))
    size = difference / spread if spread > 0.0 else 0.0
    return replace(
        told, before=before, after=after, difference=difference, low=low, high=high, size=size, p=p
    )


def _worded(told: Measured, metric: Metric, shares: int) -> Measured:
    if told.p is None or told.difference is None:
        return told
    p = min(told.p * shares, 1.0)
    return replace(told, p=p, word=word_of(metric, told.before or 0.0, told.difference, p, ALPHA))
