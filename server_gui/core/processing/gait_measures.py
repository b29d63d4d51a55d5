"""Measures of the walk from gait events: cadence, times, shares, symmetry, variability."""

import collections
import statistics
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from server_gui.core.processing.gait_events import EventKind, GaitEvent, Leg

STRIDES = 10  # the measures are over so many of the newest strides of each leg
LONGEST_STRIDE_NS = 3_500_000_000  # who takes longer has stood in between
OLD_NS = 2 * LONGEST_STRIDE_NS  # after a leg's newest stride: it tells nothing of this walk any more
WALKING_NS = 2_500_000_000  # since the last heel strike; who takes longer has stopped
UNSEEN_NS = 500_000_000  # a gap in which a step may have been made
FEWEST = 5  # strides for a variability
STEADY = 4  # strides of both legs for a cadence: who has only begun to walk has none yet
PAUSED = 1.4  # of the median stride time; who takes longer has stood within that stride


@dataclass(frozen=True, slots=True)
class Stride:
    """One stride of one leg, from heel strike to its next heel strike."""

    leg: Leg
    began_ns: int
    ended_ns: int
    stance: float  # share of the stride from heel strike to toe off
    step_s: float | None  # from the other foot's heel strike in this stride to the one that ends it
    double_support: float | None  # share of the stride with both feet down
    ranges: Mapping[str, float] = field(default_factory=dict)  # of motion, of the leg's joints (rad)

    @property
    def time_s(self) -> float:
        return (self.ended_ns - self.began_ns) / 1e9

    @property
    def swing(self) -> float:
        return 1.0 - self.stance


@dataclass(frozen=True, slots=True)
class LegGait:
    """Means over one leg's newest strides; None where there is none."""

    strides: int = 0
    stride_s: float | None = None
    step_s: float | None = None
    stance: float | None = None
    swing: float | None = None
    variability: float | None = None  # coefficient of variation of the stride time


@dataclass(frozen=True, slots=True)
class Gait:
    """The walk as it is now; where nobody walks, everything is None.

    Whether somebody walks is None while too little was seen to say so: no whole stride, and no pause either.

    `cadence_spm` is in steps a minute, None before a few strides. `symmetry` is left against right, 0 where
    both are alike (`symmetry_index`), of step time, stance and swing.
    """

    walking: bool | None = None
    cadence_spm: float | None = None
    double_support: float | None = None
    legs: Mapping[Leg, LegGait] = field(default_factory=lambda: {leg: LegGait() for leg in Leg})
    ranges: Mapping[str, float] = field(default_factory=dict)  # of motion a stride, by joint (rad)
    symmetry: Mapping[str, float | None] = field(default_factory=dict)


SYMMETRIES = ("step_s", "stance", "swing")


def symmetry_index(left: float | None, right: float | None) -> float | None:
    """(left − right) / ½ (left + right): Robinson, Herzog & Nigg 1987 (J. Manip. Physiol. Ther. 10, 172)."""
    if left is None or right is None or left + right == 0.0:
        return None
    return (left - right) / (0.5 * (left + right))


class GaitMeasures:
    """Adds up events, one after another; live by `take` and `now`, over a recording the same."""

    def __init__(self) -> None:
        self._legs = {leg: _Leg() for leg in Leg}
        self._began_ns: int | None = None  # of what was seen without a gap
        self._seen_ns = 0

    def see(self, stamp_ns: int) -> None:
        """Take an instant that was seen: who makes no step then does not walk, but nobody knows of a gap."""
        if self._began_ns is None or stamp_ns - self._seen_ns > UNSEEN_NS:
            self._began_ns = stamp_ns
        self._seen_ns = stamp_ns

    def take(self, event: GaitEvent, ranges: Mapping[str, float] | None = None) -> Stride | None:
        """Take one event; the stride that it ends, where it does and nothing of it was missed.

        `ranges` are what the leg's joints have moved since its heel strike before (rad).
        """
        leg, other = self._legs[event.leg], self._legs[event.leg.other]
        if event.after_gap:
            leg.forget()
        if event.kind is EventKind.TOE_OFF:
            leg.off_ns = event.stamp_ns
            return None
        stride = leg.ended(event, other, ranges or {})
        leg.strike_ns = event.stamp_ns
        if stride is not None:
            leg.strides.append(stride)
        elif leg.strides and event.stamp_ns - leg.strides[-1].ended_ns > LONGEST_STRIDE_NS:
            leg.strides.clear()  # another walk has begun
        return stride

    def now(self, now_ns: int) -> Gait:
        """Return the walk at `now_ns` on the robot's clock."""
        strikes = [leg.strike_ns for leg in self._legs.values() if leg.strike_ns is not None]
        began_ns = self._began_ns if self._began_ns is not None else min(strikes, default=now_ns)
        newest_ns = max(strikes, default=began_ns)
        if now_ns - max(newest_ns, began_ns) > WALKING_NS:
            return Gait(walking=False)
        if now_ns - newest_ns > WALKING_NS:
            return Gait()
        return summary(_without_pauses({leg: found.newest(now_ns) for leg, found in self._legs.items()}))


def _without_pauses(strides: Mapping[Leg, list[Stride]]) -> dict[Leg, list[Stride]]:
    """Return the strides of one walk without those that span a stop or the walk's start."""
    times_s = [stride.time_s for taken in strides.values() for stride in taken]
    if len(times_s) < STEADY:
        return dict(strides)
    longest_s = PAUSED * statistics.median(times_s)
    return {leg: [one for one in taken if one.time_s <= longest_s] for leg, taken in strides.items()}


def summary(strides: Mapping[Leg, Iterable[Stride]]) -> Gait:
    """Return the measures of these strides of both legs."""
    found = {leg: list(strides.get(leg, ())) for leg in Leg}
    legs = {leg: _leg_gait(taken) for leg, taken in found.items()}
    both = [stride for taken in found.values() for stride in taken]
    steps_s = [stride.step_s for stride in both if stride.step_s is not None]
    step_s = _mean(steps_s) if len(steps_s) >= STEADY else None
    sides = {name: [getattr(legs[leg], name) for leg in Leg] for name in SYMMETRIES}
    return Gait(
        walking=True if both else None,
        cadence_spm=None if step_s is None else 60.0 / step_s,
        double_support=_mean(stride.double_support for stride in both),
        legs=legs,
        ranges=_mean_ranges(both),
        symmetry={name: symmetry_index(left, right) for name, (left, right) in sides.items()},
    )


class _Leg:
    """One leg's newest events and strides."""

    def __init__(self) -> None:
        self.strides: collections.deque[Stride] = collections.deque(maxlen=STRIDES)
        self.forget()

    def forget(self) -> None:
        """Break: the next event does not continue the last stride."""
        self.strike_ns: int | None = None
        self.off_ns: int | None = None

    def newest(self, now_ns: int) -> list[Stride]:
        """Return its newest strides; none of a leg that is not seen any more, or only in part."""
        is_old = not self.strides or now_ns - self.strides[-1].ended_ns > OLD_NS
        return [] if is_old else list(self.strides)

    def ended(self, strike: GaitEvent, other: "_Leg", ranges: Mapping[str, float]) -> Stride | None:
        """Return the stride that `strike` ends, where its own toe off was seen."""
        began_ns, off_ns, ended_ns = self.strike_ns, self.off_ns, strike.stamp_ns
        if began_ns is None or off_ns is None or not began_ns < off_ns < ended_ns:
            return None
        if ended_ns - began_ns > LONGEST_STRIDE_NS:
            return None
        time_ns = ended_ns - began_ns
        step_s = both = None
        if other.strike_ns is not None and began_ns < other.strike_ns < ended_ns:
            step_s = (ended_ns - other.strike_ns) / 1e9
            if other.off_ns is not None and began_ns <= other.off_ns <= other.strike_ns <= off_ns:
                both = ((other.off_ns - began_ns) + (off_ns - other.strike_ns)) / time_ns
        stance = (off_ns - began_ns) / time_ns
        return Stride(strike.leg, began_ns, ended_ns, stance, step_s, both, ranges)


def _leg_gait(strides: list[Stride]) -> LegGait:
    times_s = [stride.time_s for stride in strides]
    stance = _mean(stride.stance for stride in strides)
    spread = statistics.stdev(times_s) / statistics.fmean(times_s) if len(times_s) >= FEWEST else None
    return LegGait(
        strides=len(strides),
        stride_s=_mean(times_s),
        step_s=_mean(stride.step_s for stride in strides),
        stance=stance,
        swing=None if stance is None else 1.0 - stance,
        variability=spread,
    )


def _mean_ranges(strides: list[Stride]) -> dict[str, float]:
    names = dict.fromkeys(name for stride in strides for name in stride.ranges)
    return {
        name: statistics.fmean(stride.ranges[name] for stride in strides if name in stride.ranges)
        for name in names
    }


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None
