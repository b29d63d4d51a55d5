"""Plan of an experiment, stated before it begins: values, order, dwell times and bounds.

An A/B trial is pairs of both values. Which of a pair comes first is drawn, evenly from `orders`: those in
which neither value comes early, or at both ends, much more often than the other. A sweep goes from the value
that is held to its first one, and then upwards, never further at once than its step.
"""

import functools
import itertools
import math
import random
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

import numpy as np
import numpy.typing as npt

from gateway.coding import CodingError, coding_of
from gateway.units import Unit
from gateway.wire.parameter import ParameterInfo
from server_gui.core.tuning.edits import refusal

FEWEST_PAIRS, USUAL_PAIRS, MOST_PAIRS = 8, 10, 14
USUAL_CYCLES, USUAL_TRANSIENT = 6, 2
FEWEST_CYCLES, MOST_CYCLES, MOST_TRANSIENT = 3, 60, 20
MOST_VALUES: Final = 40  # of a sweep
LONGEST_STRIDE_S: Final = 3.0
LONGEST_TRIAL_S: Final = 300.0  # that a robot takes
SPARE_S: Final = 15.0  # of a trial, for what is slow
MOST_S: Final = 240.0
PLAIN: Final = Unit("", "")
UNEVEN: Final = 2  # pairs at most that more begin with one value than with the other
BENT: Final = 0.5  # of what that would be where all early ones begin with the one, all late with the other


class ExperimentKind(StrEnum):
    """Kind of experiment."""

    AB = "A/B trial"
    SWEEP = "sweep"


class BadPlan(ValueError):
    """An experiment that cannot be; says why, and what to do."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of a joint, in SI; None: not watched."""

    error: float | None = None  # tracking error (rad)
    current: float | None = None  # A


@dataclass(frozen=True, slots=True)
class ExperimentStep:
    """A value to be held; what only leads to the first one is not measured."""

    value: float
    is_measured: bool = True


@dataclass(frozen=True, slots=True)
class Dwell:
    """Dwell time at each value: gait cycles, or seconds, after the transient cycles."""

    cycles: int = USUAL_CYCLES
    transient: int = USUAL_TRANSIENT
    seconds: float | None = None

    @property
    def limit_s(self) -> float:
        """The longest that a value is held."""
        strides_s = (self.transient + 1) * LONGEST_STRIDE_S
        if self.seconds is not None:
            return strides_s + self.seconds
        return strides_s + self.cycles * LONGEST_STRIDE_S

    @property
    def trial_s(self) -> float:
        """After which the robot takes it back by itself, whatever has become of us."""
        return min(self.limit_s + SPARE_S, LONGEST_TRIAL_S)


@dataclass(frozen=True, slots=True)
class ExperimentPlan:
    """`steps` in their order; of an A/B trial two make a pair, drawn with `seed`."""

    kind: ExperimentKind
    name: str
    original: float
    values: tuple[float, ...]  # that are measured, each once: A and B, or upwards
    steps: tuple[ExperimentStep, ...]
    dwell: Dwell = field(default_factory=Dwell)
    bounds: Bounds = field(default_factory=Bounds)
    seed: int | None = None
    unit: Unit = PLAIN  # in which people are told

    def said(self, value: float) -> str:
        """Return a value (SI) for people."""
        return f"{self.unit.brief(value)} {self.unit.symbol}".rstrip()

    def expected_s(self, stride_s: float) -> float:
        """Return the expected duration, for this stride time."""
        held = self.dwell
        measured_s = held.cycles * stride_s if held.seconds is None else held.seconds
        return sum((held.transient + 1) * stride_s + measured_s * step.is_measured for step in self.steps)


def ab(
    info: ParameterInfo,
    held: float,
    values: tuple[float, float],
    unit: Unit,
    *,
    pairs: int = USUAL_PAIRS,
    dwell: Dwell = Dwell(),
    bounds: Bounds = Bounds(),
    seed: int | None = None,
) -> ExperimentPlan:
    """Plan an A/B trial of two values of a parameter that now is `held`; raises `BadPlan`."""
    if not FEWEST_PAIRS <= pairs <= MOST_PAIRS:
        raise BadPlan(
            f"{pairs} pairs: from {FEWEST_PAIRS}, with fewer no order can tell chance from an effect, "
            f"to {MOST_PAIRS}"
        )
    first, second = values
    _check(info, unit, [(held, first), (held, second), (first, second), (second, first)], dwell)
    if _nearest(info, first) == _nearest(info, second):
        raise BadPlan(f"{info.name}: both values are the same to the device; nothing could differ")
    seed = random.SystemRandom().randrange(2**31) if seed is None else seed
    chosen = random.Random(seed).choice(orders(pairs).tolist())
    steps = [ExperimentStep(one) for sign in chosen for one in (values if sign > 0 else values[::-1])]
    return ExperimentPlan(ExperimentKind.AB, info.name, held, values, tuple(steps), dwell, bounds, seed, unit)


def sweep(
    info: ParameterInfo,
    held: float,
    span: tuple[float, float, float],
    unit: Unit,
    *,
    dwell: Dwell = Dwell(),
    bounds: Bounds = Bounds(),
) -> ExperimentPlan:
    """Plan a sweep from, to, by steps of; of a parameter that now is `held`; raises `BadPlan`."""
    first, last, step = span
    if not all(map(math.isfinite, span)) or step <= 0 or last <= first:
        raise BadPlan("a sweep goes upwards: FROM less than TO, and STEP more than 0")
    count = math.floor((last - first) / step * (1 + 1e-9)) + 1
    if count > MOST_VALUES:
        raise BadPlan(f"{count} values, of at most {MOST_VALUES}: take a larger STEP")
    measured = [_tidy(first + place * step) for place in range(count)]
    if len({_nearest(info, one) for one in measured}) < max(count, 2):
        raise BadPlan(f"{info.name}: the device cannot tell such values apart: take a larger STEP")
    between = math.ceil(abs(first - held) / step * (1 - 1e-9))
    if between > MOST_VALUES:
        raise BadPlan(f"{unit.editable(first)} is {between} steps from what is held: begin nearer to it")
    lead = [_tidy(held + (first - held) * part / between) for part in range(1, between)]
    way = [held, *lead, *measured]
    _check(info, unit, [*itertools.pairwise(way), *((held, one) for one in measured)], dwell)
    steps = (*(ExperimentStep(one, is_measured=False) for one in lead), *map(ExperimentStep, measured))
    return ExperimentPlan(
        ExperimentKind.SWEEP, info.name, held, tuple(measured), steps, dwell, bounds, unit=unit
    )


@functools.lru_cache(maxsize=16)
def orders(pairs: int) -> npt.NDArray[np.int8]:
    """Return every order that may be drawn, a row each: 1 where a pair begins with A, -1 where with B.

    Each has its mirror image among them, so that neither value is preferred.
    """
    every = np.array(list(itertools.product((1, -1), repeat=pairs)), dtype=np.int8)
    at = np.arange(pairs) - (pairs - 1) / 2
    early = np.abs(every @ at) / np.sum(np.abs(at))
    return np.asarray(every[(np.abs(every.sum(axis=1)) <= UNEVEN) & (early <= BENT)])


def signs(plan: ExperimentPlan) -> npt.NDArray[np.int8]:
    """Return the order of each pair: 1 if A comes first, else -1."""
    first = plan.values[0]
    return np.array([1 if step.value == first else -1 for step in plan.steps[::2]], dtype=np.int8)


def _check(info: ParameterInfo, unit: Unit, ways: list[tuple[float, float]], dwell: Dwell) -> None:
    if info.read_only is not None:
        raise BadPlan(f"{info.name} cannot be written: {info.read_only}")
    for old, new in ways:
        problem = refusal(new, old, info, unit)
        if problem is not None:
            raise BadPlan(f"{info.name}, {unit.brief(new)} {unit.symbol}: {problem}".replace(" :", ":"))
    if not FEWEST_CYCLES <= dwell.cycles <= MOST_CYCLES or not 0 <= dwell.transient <= MOST_TRANSIENT:
        raise BadPlan(
            f"each value is held for {FEWEST_CYCLES} to {MOST_CYCLES} gait cycles, and 0 to {MOST_TRANSIENT} "
            "are left out"
        )
    if dwell.seconds is not None and not 2.0 <= dwell.seconds <= MOST_S:
        raise BadPlan(f"each value is held for 2 to {MOST_S:.0f} s")


def _nearest(info: ParameterInfo, value: float) -> float:
    """Return it as the device would hold it."""
    coding = coding_of(info.type, info.scale)
    try:
        return value if coding is None else float(coding.decode(coding.encode(value)))
    except CodingError:
        return value  # the robot says why


def _tidy(value: float) -> float:
    """Without what binary fractions add."""
    return float(f"{value:.12g}")
