"""Thresholds of each kind of rule: the allowed range, the allowed time outside of it, and the words."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch

from gateway.config.guard import WATCHES, limit
from gateway.config.guard_rules import (
    DriftRule,
    GuardRule,
    HeatRule,
    InputRule,
    LatencyRule,
    LevelRule,
    RangeRule,
    StoppingRule,
    SymmetryRule,
    with_unit,
)
from gateway.guard.conditions import Band, Drift, Heat, StoppingPoint
from gateway.guard.symmetry import Asymmetry

Measure = Callable[[int, float], float]  # a value at its stamp (ns) becomes what is compared
Joined = Callable[[int, int, float], float | None]  # the same of several channels: which, stamp, value


def as_it_is(_stamp_ns: int, value: float) -> float:
    """Return a value that is compared itself."""
    return value


@dataclass(frozen=True, slots=True)
class Judging:
    """Judgement of numbers. `joined` replaces `measure` if several channels make one number."""

    band: Band
    says: Callable[[float], str]
    for_s: float = 0.0
    measure: Measure = as_it_is
    joined: Joined | None = None


@dataclass(frozen=True, slots=True)
class Beside:
    """Context of a rule: a value is old after `stale_s`; whether a stop is held."""

    stale_s: float
    held: Callable[[], bool] = lambda: False


@singledispatch
def judging(rule: GuardRule, beside: Beside) -> Judging:  # noqa: ARG001 - those below have it
    """Return this rule's judgement; raises `TypeError` if it judges no number."""
    raise TypeError(f"{rule.watch} judges no number")


@judging.register
def _level(rule: LevelRule, _beside: Beside) -> Judging:
    band = Band(-rule.above, rule.above, rule.hysteresis)
    return Judging(band, _number(rule, WATCHES[rule.watch].unit), rule.for_s)


@judging.register
def _latency(rule: LatencyRule, _beside: Beside) -> Judging:
    told = _number(rule, WATCHES[rule.watch].unit)

    def says(taken_s: float) -> str:
        return "no answer" if math.isinf(taken_s) else f"answered after {told(taken_s)}"

    return Judging(Band(-math.inf, rule.above, rule.hysteresis), says, rule.for_s)


@judging.register
def _range(rule: RangeRule, _beside: Beside) -> Judging:
    return Judging(_band(rule), _number(rule, WATCHES[rule.watch].unit), rule.for_s)


@judging.register
def _stopping(rule: StoppingRule, _beside: Beside) -> Judging:
    point = StoppingPoint(rule.deceleration, rule.reaction_s)
    return Judging(_band(rule), _number(rule, "rad"), rule.for_s, joined=point.after)


@judging.register
def _heat(rule: HeatRule, beside: Beside) -> Judging:
    heat = Heat(rule.rated, rule.time_constant_s, beside.stale_s)
    return Judging(Band(-math.inf, rule.above, rule.hysteresis), _number(rule, ""), measure=heat.after)


@judging.register
def _input(rule: InputRule, _beside: Beside) -> Judging:
    def wrong(_stamp_ns: int, inputs: float) -> float:
        return float(rule.wrong(inputs))

    return Judging(Band(-math.inf, 0.0, 0.0), rule.says, rule.for_s, wrong)


@judging.register
def _drift(rule: DriftRule, beside: Beside) -> Judging:
    drift = Drift(beside.held, rule.settle_s, rule.above)
    band = Band(-rule.above, rule.above, 0.0)
    return Judging(band, _number(rule, WATCHES[rule.watch].unit), measure=drift.after)


@judging.register
def _symmetry(rule: SymmetryRule, beside: Beside) -> Judging:
    both = Asymmetry(rule.of, rule.window_s, beside.stale_s)
    band = Band(-rule.above, rule.above, rule.hysteresis)
    return Judging(band, _number(rule, rule.unit), rule.for_s, joined=both.after)


def _band(rule: RangeRule) -> Band:
    low = -math.inf if rule.min is None else rule.min
    high = math.inf if rule.max is None else rule.max
    return Band(low, high, rule.hysteresis)


def _number(rule: GuardRule, unit: str) -> Callable[[float], str]:
    """Return a number, and the limit that it is beyond."""
    words = limit(rule)
    return lambda number: f"{with_unit(float(f'{number:.4g}'), unit)}, {words}"
