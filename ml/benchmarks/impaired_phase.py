"""`impaired-phase`: the gait phase of patients by models of healthy people, and by models of both.

Five folds of people. In each, one model learns from the healthy people of the other folds, and another from
as many, a third of each group. Everybody is judged by both, before and after a minute of their own.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import folds, impaired, ipol, metrics
from ml.benchmarks.groups import Person, figures_of, rows_of
from ml.benchmarks.models.gait_phase import PhaseModel, PhaseSettings
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search
from ml.errors import UnusableData
from ml.features import features
from ml.features.foot_rates import PHASES
from ml.features.gait_status import RATE_HZ
from ml.robot import conformal

FOLDS: Final = 5
STEP: Final = 20  # samples between decisions: 200 ms
PACES: Final = (0.8, 1.25)  # of duration: people are slower and faster than those who were recorded
PACES_STEP: Final = 40  # samples between decisions that are learned at another pace
STRIDE_S: Final = (0.5, 3.5)  # shorter and longer ones are no strides, also of who walks very slowly
MINUTE_S: Final = 60.0  # of walking
LEAST_LATER: Final = 50  # decisions after the minute, to judge what it taught
SETTINGS: Final = PhaseSettings()  # those of `ipol-phase`, which never saw these people
MODELS: Final = ("healthy", "mixed")
WHY: Final = (
    "healthy and mixed: by a model of healthy people, and by one of as many, a third of each group. Phase 0"
    " is where the labels have the foot lie flat, moved to the heel strike of healthy people, by a constant of"
    " each make of sensor. …_low and …_high: 95 % intervals over people. The worst third are those who were"
    " worst in their first minute, which is not judged."
)

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """Every decision within a stride, of both feet; arrays have a row each."""

    features: npt.NDArray[np.float32]
    phase: Floats
    stride: npt.NDArray[np.int_]  # a number of its own for each stride
    subject: npt.NDArray[np.int_]
    walk: npt.NDArray[np.int_]  # the number of the subject's walk

    def of(self, rows: npt.NDArray[Any]) -> "Decisions":
        return Decisions(*(getattr(self, field.name)[rows] for field in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What two models said of one person: errors of the phase, in cycles."""

    error: tuple[Floats, Floats]  # of MODELS
    adapted: tuple[Floats, Floats]  # of the later decisions, after the minute
    late: Flags  # which decisions come after the minute


def evaluate(path: Path, search: Search) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Five folds of people, judged by groups."""
    walks = impaired.read(path)
    later = impaired.laid_later(walks)
    if lacking := {walk.sensor for walk in walks} - set(later):
        raise UnusableData(
            f"{path}: no healthy person wore {' or '.join(sorted(lacking))}: its labels cannot be compared"
        )
    data = decisions(walks, later)
    taught = together(data, decisions(paced(walks), later, PACES_STEP))
    groups = {walk.subject: walk.group for walk in walks if (data.subject == walk.subject).any()}
    late = late_of(data, minutes(walks, later))
    split = list(people_in_folds(groups))
    work = folds.over(lambda held_out: _fold(taught, data, late, groups, held_out), split)
    judged = {subject: one for found in work for subject, one in found.items()}
    people = [_person(walks, groups, judged, subject) for subject in sorted(groups)]
    rows = rows_of(people)
    makes = ", ".join(f"{name} {samples / RATE_HZ * 1000:.0f} ms" for name, samples in sorted(later.items()))
    settings = f"fixed, those of ipol-phase; labels moved earlier: {makes}"
    return Outcome(figures_of(people, rows), len(people), rows, "group", settings=settings, notes=(WHY,))


# --- what is learned from and judged by


def paced(walks: Sequence[impaired.Walk]) -> list[impaired.Walk]:
    """Every walk as slower and faster people would have walked it."""
    return [_stretched(walk, factor) for factor in PACES for walk in walks]


def _stretched(walk: impaired.Walk, factor: float) -> impaired.Walk:
    rows = np.arange(int(len(walk.rates) * factor)) / factor
    whole = np.arange(len(walk.rates))
    rates = np.stack([np.interp(rows, whole, channel) for channel in walk.rates.T], axis=1) / factor
    nearest = np.minimum(np.rint(rows).astype(np.intp), len(whole) - 1)
    left, right = (moving[nearest] for moving in walk.moving)
    return impaired.Walk(walk.subject, walk.number, walk.group, walk.sensor, rates, (left, right))


def decisions(walks: Sequence[impaired.Walk], later: Mapping[str, int], step: int = STEP) -> Decisions:
    """Every walk's strides, a decision each `step` samples; `later` as `impaired.laid_later` gives it.

    Raises:
        UnusableData: nobody has a stride.

    """
    parts = [part for walk in walks for part in _of_walk(walk, later[walk.sensor], step) if len(part[0])]
    if not parts:
        raise UnusableData(f"nobody has strides of {STRIDE_S[0]:g} to {STRIDE_S[1]:g} s: nothing is learned")
    numbers = itertools.accumulate((len(part[1]) for part in parts), initial=0)
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    columns[2] = np.concatenate([part[2] + first for part, first in zip(parts, numbers, strict=False)])
    return Decisions(*columns)


def together(one: Decisions, other: Decisions) -> Decisions:
    """Both, with strides that stay apart."""
    columns = {
        field.name: np.concatenate([getattr(one, field.name), getattr(other, field.name)])
        for field in fields(Decisions)
    }
    columns["stride"][len(one.stride) :] += one.stride.max() + 1
    return Decisions(**columns)


def _of_walk(walk: impaired.Walk, later: int, step: int) -> Iterator[tuple[Any, ...]]:
    for recipe, moving in zip(PHASES, walk.moving, strict=True):
        strikes = strikes_of(moving, later)
        phase = phases(strikes, len(moving))
        ends = np.arange(0, len(phase), step)
        ends = ends[~np.isnan(phase[ends])]
        stride = np.searchsorted(strikes, ends, side="right")
        about = (np.full(len(ends), walk.subject), np.full(len(ends), walk.number))
        yield features(recipe, walk.rates, ends), phase[ends], stride, *about


def strikes_of(moving: Flags, later: int) -> npt.NDArray[np.intp]:
    """The rows at which the labels have the foot lie flat, `later` samples earlier."""
    flat = impaired.landings(moving) - later
    return flat[flat >= 0]


def phases(strikes: npt.NDArray[np.intp], rows: int) -> Floats:
    """Each row's phase: 0 at a strike, linear to the next one; NaN outside strides."""
    return ipol.phase(strikes, rows, STRIDE_S)


def minutes(walks: Sequence[impaired.Walk], later: Mapping[str, int]) -> dict[int, int]:
    """Each person's walk in which the first minute within strides ends."""
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
    """The decisions in walks after each person's first minute."""
    last = np.array([minute[subject] for subject in data.subject.tolist()])
    return np.asarray(data.walk > last)


def people_in_folds(groups: Mapping[int, str]) -> Iterator[list[int]]:
    """Folds of people, each with its share of every group."""
    by_group = [[one for one in sorted(groups) if groups[one] == name] for name in sorted(set(groups.values()))]
    for fold in range(FOLDS):
        held_out = [one for people in by_group for one in people[fold::FOLDS]]
        if held_out:
            yield held_out


def mixed(groups: Mapping[int, str], count: int) -> list[int]:
    """`count` of these people, as many of each group as there are, spread over their numbers."""
    names = sorted(set(groups.values()))
    chosen: list[int] = []
    for place, name in enumerate(names):
        people = [one for one in sorted(groups) if groups[one] == name]
        wanted = min(len(people), (count + place) // len(names))
        chosen += [people[at] for at in np.linspace(0, len(people) - 1, wanted).round().astype(int).tolist()]
    return chosen


# --- judging


def _fold(
    taught: Decisions, data: Decisions, late: Flags, groups: Mapping[int, str], held_out: Sequence[int]
) -> dict[int, Judged]:
    others = {one: name for one, name in groups.items() if one not in held_out}
    healthy = [one for one, name in others.items() if name == impaired.HEALTHY]
    if not healthy:
        raise UnusableData("nobody healthy is left to learn from")
    models = [_fitted(taught, healthy), _fitted(taught, mixed(others, len(healthy)))]
    return {one: _judged(models, data.of(data.subject == one), late[data.subject == one]) for one in held_out}


def _fitted(taught: Decisions, people: Sequence[int]) -> PhaseModel:
    own = taught.of(np.isin(taught.subject, people))
    return PhaseModel(SETTINGS).fit(own.features, own.phase, own.stride)


def _judged(models: Sequence[PhaseModel], own: Decisions, late: Flags) -> Judged:
    early, later = own.of(~late), own.of(late)
    error, adapted = [], []
    for model in models:
        error.append(_errors(model, own))
        if late.sum() >= LEAST_LATER and len(early.phase):
            personal = model.personal(early.features, early.phase, early.stride)
            adapted.append(_errors(personal, later))
        else:
            adapted.append(np.zeros(0))
    return Judged((error[0], error[1]), (adapted[0], adapted[1]), late)


def _errors(model: PhaseModel, data: Decisions) -> Floats:
    return metrics.circular_error(model.predict(data.features), data.phase)


def _person(
    walks: Sequence[impaired.Walk], groups: Mapping[int, str], judged: Mapping[int, Judged], subject: int
) -> Person:
    """One person's figures. What is promised comes from others whom the same kind of model had not seen."""
    own = judged[subject]
    figures: dict[str, float] = {}
    for place, model in enumerate(MODELS):
        likes = [one for one in groups if one != subject and (place or groups[one] == impaired.HEALTHY)]
        errors = [np.abs(judged[one].error[place]) for one in likes]
        whose = np.repeat(likes, [len(one) for one in errors])
        width = conformal.reach(np.concatenate(errors), whose)
        before, after = own.error[place][own.late], own.adapted[place]
        figures |= {
            f"{model}_rmse_percent": _percent(own.error[place]),
            f"{model}_covered": float((np.abs(own.error[place]) <= width).mean()),
            f"{model}_interval_percent": 100.0 * width,
            f"{model}_early_rmse_percent": _percent(own.error[place][~own.late]),
            f"{model}_later_rmse_percent": _percent(before) if len(after) else np.nan,
            f"{model}_adapted_rmse_percent": _percent(after),
        }
    sensors = sorted({walk.sensor for walk in walks if walk.subject == subject})
    return Person(subject, groups[subject], "+".join(sensors), figures)


def _percent(errors: Floats) -> float:
    return 100.0 * metrics.rms(errors) if len(errors) else np.nan
