"""Decisions within the strides of healthy people and patients, of both feet: for `impaired-phase`."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import impaired, ipol
from ml.benchmarks.strides import apart, heel_strikes
from ml.errors import UnusableData
from ml.features import features
from ml.features.foot_rates import PHASES
from ml.features.gait_status import RATE_HZ

STEP: Final = 20  # samples between decisions: 200 ms
PACES: Final = (0.8, 1.25)  # of duration: people are slower and faster than those who were recorded
PACES_STEP: Final = 40  # samples between decisions that are learned at another pace
STRIDE_S: Final = (0.5, 3.5)  # shorter and longer ones are no strides, also of who walks very slowly
MINUTE_S: Final = 60.0  # of walking

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """Every decision within a stride, of both feet; arrays have a row each."""

    features: npt.NDArray[np.float32]
    phase: Floats
    stride: npt.NDArray[np.int_]  # a number of its own for each stride
    hindsight: Floats  # the phase by the strikes in the foot's own signal; NaN without any
    subject: npt.NDArray[np.int_]
    walk: npt.NDArray[np.int_]  # the number of the subject's walk

    def of(self, rows: npt.NDArray[Any]) -> "Decisions":
        return Decisions(*(getattr(self, field.name)[rows] for field in fields(self)))


def lessons(walks: Sequence[impaired.Walk], later: Mapping[str, int], data: Decisions) -> Decisions:
    """Return the training data of these people: `data`, and their walks at slower and faster paces."""
    people = {walk.subject for walk in walks}
    made = [data.of(np.isin(data.subject, list(people)))]
    for factor in PACES:
        slower = {sensor: round(samples * factor) for sensor, samples in later.items()}
        others = (_stretched(walk, factor) for walk in walks)
        whole = (walk for walk in others if len(walk.rates))  # of a single sample, faster, none is left
        made.append(decisions(whole, slower, PACES_STEP))
    columns = {field.name: [getattr(one, field.name) for one in made] for field in fields(Decisions)}
    stride = apart(columns.pop("stride"))
    return Decisions(**{name: np.concatenate(column) for name, column in columns.items()}, stride=stride)


def _stretched(walk: impaired.Walk, factor: float) -> impaired.Walk:
    rows = np.arange(int(len(walk.rates) * factor)) / factor
    whole = np.arange(len(walk.rates))
    rates = np.stack([np.interp(rows, whole, channel) for channel in walk.rates.T], axis=1) / factor
    nearest = np.minimum(np.rint(rows).astype(np.intp), len(whole) - 1)
    left, right = (moving[nearest] for moving in walk.moving)
    return impaired.Walk(walk.subject, walk.number, walk.group, walk.sensor, rates, (left, right))


def decisions(walks: Iterable[impaired.Walk], later: Mapping[str, int], step: int = STEP) -> Decisions:
    """Return every walk's strides, a decision each `step` samples; `later` as `impaired.laid_later` gives it.

    Raises:
        UnusableData: nobody has a stride.

    """
    parts = [part for walk in walks for part in _of_walk(walk, later[walk.sensor], step) if len(part[0])]
    if not parts:
        raise UnusableData(f"nobody has strides of {STRIDE_S[0]:g} to {STRIDE_S[1]:g} s: nothing is learned")
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    columns[2] = apart([part[2] for part in parts])
    return Decisions(*columns)


def _of_walk(walk: impaired.Walk, later: int, step: int) -> Iterator[tuple[Any, ...]]:
    pitches = walk.rates[:, 1], walk.rates[:, 4]
    for recipe, pitch, moving in zip(PHASES, pitches, walk.moving, strict=True):
        strikes = strikes_of(moving, later)
        phase = phases(strikes, len(moving))
        ends = np.arange(0, len(phase), step)
        ends = ends[~np.isnan(phase[ends])]
        stride = np.searchsorted(strikes, ends, side="right")
        own = phases(heel_strikes(pitch), len(moving))[ends]
        about = (np.full(len(ends), walk.subject), np.full(len(ends), walk.number))
        yield features(recipe, walk.rates, ends), phase[ends], stride, own, *about


def strikes_of(moving: Flags, later: int) -> npt.NDArray[np.intp]:
    """Return the rows at which the labels have the foot lie flat, `later` samples earlier."""
    flat = impaired.landings(moving) - later
    return flat[flat >= 0]


def phases(strikes: npt.NDArray[np.intp], rows: int) -> Floats:
    """Return each row's phase: 0 at a strike, linear to the next one; NaN outside strides."""
    return ipol.phase(strikes, rows, STRIDE_S)


def minutes(walks: Sequence[impaired.Walk], later: Mapping[str, int]) -> dict[int, int]:
    """Return each person's walk in which the first minute within strides ends."""
    walked: dict[int, float] = {}
    ends: dict[int, int] = {}
    for walk in walks:
        known = [
            ~np.isnan(phases(strikes_of(moving, later[walk.sensor]), len(moving))) for moving in walk.moving
        ]
        if walked.get(walk.subject, 0.0) < MINUTE_S:
            ends[walk.subject] = walk.number
        walked[walk.subject] = walked.get(walk.subject, 0.0) + float((known[0] | known[1]).sum()) / RATE_HZ
    return ends


def late_of(data: Decisions, minute: Mapping[int, int]) -> Flags:
    """Mark the decisions in walks after each person's first minute."""
    last = np.array([minute[subject] for subject in data.subject.tolist()])
    return np.asarray(data.walk > last)
