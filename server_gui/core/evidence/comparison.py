"""Cycles before and after an edit, compared: what was better, worse or as before, and how sure that is.

Equal walks only: the same activity, and strides as long before as after. What is left of the speed, a slow
drift and the activities are explained beside the edit (`effect`), so that none of them is taken for it. The
words are chosen over all metrics together: the chance that any of them errs stays below `ALPHA`. It is shared
evenly by what was edited, the other joints, and the robot as a whole, and by Holm within each: an edit of one
joint is not to be overlooked because there are five others.
"""

import collections
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from msgspec import Struct

from server_gui.core.evidence.cycles import Cycle
from server_gui.core.evidence.effect import Bools, Effects, Floats, effects, holm
from server_gui.core.evidence.metrics import OF_JOINTS, OF_ROBOTS, Better, Metric
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.wiring import leg_of

ALPHA: Final = 0.03  # and not 0.05: evidence is looked at again and again while it grows
FEWEST: Final = 8  # cycles on each side
SAME_SPEED: Final = (2.5, 97.5)  # percentiles of the stride time that strides of the other side must lie in
AROUND: Final = 0.01  # and so much around them


class Word(StrEnum):
    """Judgement of a metric, or of all of them."""

    BETTER = "better"
    WORSE = "worse"
    CHANGED = "changed"  # and nobody can say whether that is good
    MIXED = "mixed"  # some better, some worse
    SAME = "no difference seen"
    FEW = "not enough cycles"
    NO_DATA = "no data"


class Measured(Struct, frozen=True):
    """One metric of one joint, or of the robot: means before and after, and what is the edit's of it.

    `difference`, with its 95 % interval `low` to `high`, is what is left of after − before without drift and
    speed; `size` is the same in standard deviations of single cycles. `p` is adjusted for all metrics.
    """

    series: str
    title: str
    unit: str
    word: Word
    cycles_before: int
    cycles_after: int
    before: float | None = None
    after: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    size: float | None = None
    p: float | None = None
    why: str = ""  # of a word that stands for no number


class Evidence(Struct, frozen=True):
    """Effect of an edit: the overall judgement, the strongest metric, and every metric."""

    word: Word
    strongest: str  # the series of a metric; empty where none differs
    metrics: tuple[Measured, ...]
    cycles_before: int  # of both legs: that were compared, or, of a leg with too few on a side, that may be
    cycles_after: int
    left_out: Mapping[str, int] = {}  # cycles by what was wrong with them, with their joint
    notes: tuple[str, ...] = ()
    cycles_back: int = 0  # of those before: since it was taken back, with the old values again


Spans = Sequence[tuple[int, int]]  # from, to (ns)


@dataclass(frozen=True, slots=True)
class Spell:
    """Times of the old and the new values: on the robot's clock (ns)."""

    before: Spans
    after: Spans

    def side(self, cycle: Cycle) -> bool | None:
        """Return whether a cycle is after the edit (True) or before; None where it is neither."""
        for is_after, spans in ((False, self.before), (True, self.after)):
            if any(since <= cycle.began_ns and cycle.ended_ns <= until for since, until in spans):
                return is_after
        return None


@dataclass(frozen=True, slots=True)
class _Sided:
    """The cycles of one leg that can be compared, in the order of time."""

    cycles: Sequence[Cycle]
    after: Bools
    at_s: Floats  # the middle of each
    stride_s: Floats
    activities: Sequence[str]

    def where(self, chosen: Bools) -> "_Sided":
        places = np.flatnonzero(chosen).tolist()
        return _Sided(
            [self.cycles[place] for place in places],
            self.after[chosen],
            self.at_s[chosen],
            self.stride_s[chosen],
            [self.activities[place] for place in places],
        )

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of cycles before and after."""
        behind = int(np.count_nonzero(self.after))
        return len(self.cycles) - behind, behind

    @property
    def is_enough(self) -> bool:
        return min(self.counts) >= FEWEST


@dataclass(slots=True)
class _Found:
    """A metric on its way to its word."""

    series: str
    metric: Metric
    before: float | None = None
    after: float | None = None
    cycles: tuple[int, int] = (0, 0)
    why: str = ""
    word: Word = Word.NO_DATA
    effect: tuple[float, float, float, float] | None = None  # difference, half of the interval, size, p

    @property
    def component(self) -> str:
        return self.series.rpartition(".")[0]


def compare(
    cycles: Iterable[Cycle], spell: Spell, joints: Sequence[str], edited: Collection[str] = ()
) -> Evidence:
    """Return what the edit of some components did to these joints and to the robot as a whole."""
    taken, left_out = _sorted_out(cycles, spell)
    there = {leg: _all_of([cycle for cycle in taken if cycle.leg is leg], spell) for leg in Leg}
    legs = {leg: _sided(there[leg]) for leg in Leg}
    most_leg = max(Leg, key=lambda leg: (min(legs[leg].counts), min(there[leg].counts)))
    most = legs[most_leg]
    found: list[_Found] = []
    for leg in Leg:
        series = [
            _Found(f"{joint}.{metric.key}", metric)
            for joint in joints
            if leg_of(joint) is leg or (leg_of(joint) is None and legs[leg] is most)
            for metric in OF_JOINTS
        ]
        _measure(series, legs[leg])
        found += series
    robot = [_Found(metric.key, metric) for metric in OF_ROBOTS]
    _measure(robot, most)
    own = [one for one in found if one.component in edited]
    measured = _worded([own, [one for one in found if one not in own], robot])
    known = [(legs[leg] if legs[leg].cycles else there[leg]).counts for leg in Leg]
    told = [sum(counts) for counts in zip(*known, strict=True)]
    strongest = max(differing(measured), key=lambda one: abs(one.size or 0.0), default=None)
    judged = {one.series for one in own or found}
    return Evidence(
        word=verdict(measured, [one for one in measured if one.series in judged]),
        strongest="" if strongest is None else strongest.series,
        metrics=tuple(measured),
        cycles_before=told[0],
        cycles_after=told[1],
        left_out=left_out,
        notes=tuple(_notes(most, there[most_leg])),
        cycles_back=sum(_since_back(legs[leg] if legs[leg].cycles else there[leg], spell) for leg in Leg),
    )


def drawn(cycles: Iterable[Cycle], spell: Spell) -> list[Cycle]:
    """Return the cycles that are compared; of a leg that has too few on a side yet, all that may be."""
    taken, _ = _sorted_out(cycles, spell)
    legs = [_all_of([cycle for cycle in taken if cycle.leg is leg], spell) for leg in Leg]
    return [cycle for leg in legs for cycle in (_sided(leg).cycles or leg.cycles)]


def _sorted_out(cycles: Iterable[Cycle], spell: Spell) -> tuple[list[Cycle], dict[str, int]]:
    """Return the cycles of either side whose activity is known, and how many were left out for what."""
    counted: collections.Counter[str] = collections.Counter()
    taken = []
    for cycle in cycles:
        if spell.side(cycle) is None:
            continue
        if cycle.activity is None:
            counted["the activity changed"] += 1
            continue
        taken.append(cycle)
        counted.update(f"{joint}: {why}" for joint, why in cycle.left_out.items())
    return taken, dict(counted)


def _since_back(sided: _Sided, spell: Spell) -> int:
    """Return the number of cycles with the old values since the revert."""
    ended_ns = max((until_ns for _, until_ns in spell.after), default=None)
    return 0 if ended_ns is None else sum(cycle.began_ns >= ended_ns for cycle in sided.cycles)


def _all_of(cycles: Sequence[Cycle], spell: Spell) -> _Sided:
    """Return these cycles, each on its side."""
    return _Sided(
        cycles,
        np.array([spell.side(cycle) for cycle in cycles], dtype=np.bool_),
        np.array([(cycle.began_ns + cycle.ended_ns) / 2e9 for cycle in cycles]),
        np.array([cycle.seconds for cycle in cycles]),
        [cycle.activity or "" for cycle in cycles],
    )


def _sided(all_of: _Sided) -> _Sided:
    """Return those in activities that there are enough of on both sides."""
    names = np.array(all_of.activities)
    both = {name for name in names.tolist() if all_of.where(names == name).is_enough}
    return all_of.where(np.array([name in both for name in names.tolist()], dtype=np.bool_))


def _same_speed(sided: _Sided) -> Bools:
    """Return those whose stride lasts as long as strides of the other side do."""
    ranges = [np.percentile(sided.stride_s[side], SAME_SPEED) for side in (sided.after, ~sided.after)]
    low = max(float(one[0]) for one in ranges) * (1.0 - AROUND)
    high = min(float(one[1]) for one in ranges) * (1.0 + AROUND)
    return np.asarray((sided.stride_s >= low) & (sided.stride_s <= high))


def _measure(found: Sequence[_Found], sided: _Sided) -> None:
    """Estimate what can be of these; the others say why not."""
    rows = [[cycle.values.get(one.series, np.nan) for one in found] for cycle in sided.cycles]
    values = np.array(rows, dtype=np.float64).reshape(len(sided.cycles), len(found))
    same = _same_speed(sided) if sided.is_enough else np.zeros(len(sided.cycles), dtype=np.bool_)
    groups: dict[tuple[bytes, bool, bool], list[int]] = {}
    for place, one in enumerate(found):
        known = ~np.isnan(values[:, place])
        _means(one, values[:, place], sided, known)
        chosen = known if one.metric.is_speed else known & same
        part = sided.where(chosen)
        if not known.any():
            one.why = (
                "nothing tells it" if len(sided.cycles) else "nobody walked in the same way on both sides"
            )
            one.word = Word.NO_DATA if len(sided.cycles) else Word.FEW
        elif not part.is_enough:
            one.word, one.why = Word.FEW, "{} and {} cycles at the same speed".format(*part.counts)
            one.cycles = part.counts
        else:
            groups.setdefault((chosen.tobytes(), one.metric.is_slope, one.metric.is_speed), []).append(place)
    for (mask, is_slope, is_speed), places in groups.items():
        chosen = np.frombuffer(mask, dtype=np.bool_)
        part = sided.where(chosen)
        _estimate([found[place] for place in places], values[chosen][:, places], part, is_slope, is_speed)


def _means(one: _Found, column: Floats, sided: _Sided, known: Bools) -> None:
    means = [
        float(column[known & side].mean()) if (known & side).any() else None
        for side in (~sided.after, sided.after)
    ]
    one.before, one.after = means


def _estimate(found: Sequence[_Found], values: Floats, sided: _Sided, is_slope: bool, is_speed: bool) -> None:
    at_s = sided.at_s - sided.at_s.mean()
    terms = [np.ones_like(at_s), at_s / max(float(np.abs(at_s).max()), 1.0)]
    if not is_speed and not is_slope:
        terms.append(sided.stride_s - sided.stride_s.mean())
    names = sorted(set(sided.activities))[1:]
    terms += [np.array([float(one == name) for one in sided.activities]) for name in names]
    step = sided.after.astype(np.float64)
    if is_slope:
        terms.append(terms[1] ** 2)
        step = _time_after(sided)
    told = effects(values, step, np.column_stack(terms), sided.after)
    for place, one in enumerate(found):
        one.cycles, one.word = sided.counts, Word.SAME
        one.before = float(values[~sided.after, place].mean())
        one.after = float(values[sided.after, place].mean())
        one.effect = _effect(told, place)
        if is_slope:
            one.before = float(np.polyfit(at_s[~sided.after], values[~sided.after, place], 1)[0])
            one.after = float(np.polyfit(at_s[sided.after], values[sided.after, place], 1)[0])


def _time_after(sided: _Sided) -> Floats:
    """Return the time that the new values had been in force at each cycle (s)."""
    steps_s = np.diff(sided.at_s, prepend=sided.at_s[0])
    return np.cumsum(np.where(sided.after, steps_s, 0.0))


def _effect(told: Effects, place: int) -> tuple[float, float, float, float]:
    columns = (told.difference, told.half_width, told.size, told.p)
    difference, half, size, p = (float(column[place]) for column in columns)
    return difference, half, size, p


def _worded(families: Sequence[Sequence[_Found]]) -> list[Measured]:
    p: dict[str, float] = {}
    told = [[(one.series, one.effect[3]) for one in family if one.effect is not None] for family in families]
    shares = sum(map(bool, told))
    for family in told:
        adjusted = holm(np.array([p for _, p in family])) * shares
        p |= {series: min(float(value), 1.0) for (series, _), value in zip(family, adjusted, strict=True)}
    return [_measured(one, p.get(one.series)) for family in families for one in family]


def _measured(one: _Found, p: float | None) -> Measured:
    metric = one.metric
    title = f"{one.component} {metric.title}" if one.component else metric.title
    base = (one.series, title, metric.unit)
    if one.effect is None or p is None:
        return Measured(*base, one.word, *one.cycles, before=one.before, after=one.after, why=one.why)
    difference, half, size, _ = one.effect
    return Measured(
        *base,
        word_of(metric, one.before or 0.0, difference, p),
        *one.cycles,
        before=one.before,
        after=one.after,
        difference=difference,
        low=difference - half,
        high=difference + half,
        size=size,
        p=p,
    )


def word_of(metric: Metric, before: float, difference: float, p: float, alpha: float = ALPHA) -> Word:
    """Return what a difference is called: what is sure, and large enough to matter."""
    if p >= alpha or abs(difference) < metric.smallest(before):
        return Word.SAME
    gain = -difference if metric.better is Better.LESS else abs(before) - abs(before + difference)
    if metric.better is Better.NEITHER or abs(gain) < metric.smallest(before):
        return Word.CHANGED
    return Word.BETTER if gain > 0.0 else Word.WORSE


def differing(measured: Iterable[Measured]) -> Iterator[Measured]:
    """Yield those that are said to differ."""
    return (one for one in measured if one.word in (Word.BETTER, Word.WORSE, Word.CHANGED))


def verdict(measured: Sequence[Measured], judged: Sequence[Measured]) -> Word:
    """Return the word for all; where nothing differs, that of what was edited.

    No cadence speaks for a knee.
    """
    words = {one.word for one in measured}
    if {Word.BETTER, Word.WORSE} <= words:
        return Word.MIXED
    differs = next((word for word in (Word.WORSE, Word.BETTER, Word.CHANGED) if word in words), None)
    own = {one.word for one in judged}
    return differs or next((word for word in (Word.SAME, Word.FEW) if word in own), Word.NO_DATA)


def _notes(sided: _Sided, there: _Sided) -> Iterator[str]:
    if not sided.is_enough:
        if there.is_enough:
            old, new = (", ".join(_activities(there, side)) for side in (~there.after, there.after))
            yield f"too few cycles of one activity on both sides: {old} before, {new} after"
        return
    before, after = (float(np.mean(sided.stride_s[side])) for side in (~sided.after, sided.after))
    if not sided.where(_same_speed(sided)).is_enough:
        yield (
            f"strides lasted {before:.2f} s before and {after:.2f} s after: "
            "too few are equally long, so that only the cadence can be compared"
        )


def _activities(sided: _Sided, side: Bools) -> Iterator[str]:
    """Yield the number of cycles of each activity, the largest first."""
    for name, count in collections.Counter(sided.where(side).activities).most_common():
        yield f"{count} {name or 'not known'}"
