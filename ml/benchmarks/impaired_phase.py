"""`impaired-phase`: the gait phase of patients by models of healthy people, and by models of both.

Five folds of people. In each, one model learns from the healthy people of the other folds, and another from
as many, a third of each group. Everybody is judged by both, before and after a minute of their own.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import folds, impaired, losses, metrics
from ml.benchmarks.impaired_groups import MODELS, Person, figures_of, lost_of, rows_of
from ml.benchmarks.impaired_strides import Decisions, decisions, late_of, lessons, minutes
from ml.benchmarks.models.gait_phase import PhaseModel, PhaseSettings
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search
from ml.errors import UnusableData
from ml.features.gait_status import RATE_HZ
from ml.robot import conformal

FOLDS: Final = 5
LEAST_LATER: Final = 50  # decisions after the minute, to judge what it taught
SETTINGS: Final = PhaseSettings()  # those of `ipol-phase`, which never saw these people
WHY: Final = (
    "healthy and mixed: by a model of healthy people, and by one of as many, a third of each group. Phase 0"
    " is where the labels have the foot lie flat, moved to healthy people's heel strike by a constant of each"
    " make of sensor; hindsight_…: how far the foot's own heel strikes, known before and after, are from"
    " that. …_low and …_high: 95 % intervals over people. The worst third are those who were"
    " worst in their first minute, which is not judged."
)

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Lost = Mapping[float, Decisions]  # the same decisions, by the share of packets that are lost


@dataclass(frozen=True, slots=True)
class Fold:
    """Who is judged, and by models of whom."""

    held_out: list[int]
    teachers: tuple[list[int], list[int]]  # of each of MODELS


@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """What one model said of one person: errors of the phase, in cycles."""

    error: Floats
    adapted: Floats  # of the later decisions, after the minute
    lost: Mapping[float, Floats]  # of all, by the share of packets that are lost


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What the models said of one person."""

    said: tuple[Said, Said]  # of MODELS
    late: Flags  # which decisions come after the minute


def evaluate(path: Path, search: Search) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Judge five folds of people, by groups."""
    walks = impaired.read(path)
    later = impaired.laid_later(walks)
    if lacking := {walk.sensor for walk in walks} - set(later):
        raise UnusableData(
            f"{path}: no healthy person wore {' or '.join(sorted(lacking))}: its labels cannot be compared"
        )
    data = decisions(walks, later)
    groups = {walk.subject: walk.group for walk in walks if (data.subject == walk.subject).any()}
    makes_of = {
        one: "+".join(sorted({walk.sensor for walk in walks if walk.subject == one})) for one in groups
    }
    lost = {
        share: replace(data, features=decisions(impaired.lossy(walks, share), later).features)
        for share in losses.SHARES
    }
    late = late_of(data, minutes(walks, later))
    split = list(folds_of(groups))
    teachers = {one for fold in split for model in fold.teachers for one in model}
    taught = lessons([walk for walk in walks if walk.subject in teachers], later, data)
    del walks  # they fill a fifth of a gigabyte
    work = folds.over(lambda fold: _fold(taught, data, lost, late, fold), split)
    judged = {subject: one for found in work for subject, one in found.items()}
    people = [_person(data, groups, makes_of[subject], judged, subject) for subject in sorted(groups)]
    rows = rows_of(people)
    makes = ", ".join(f"{name} {samples / RATE_HZ * 1000:.0f} ms" for name, samples in sorted(later.items()))
    settings = f"fixed, those of ipol-phase; labels moved earlier: {makes}"
    figures = figures_of(people, rows) | lost_of(people, losses.SHARES)
    return Outcome(figures, len(people), rows, "group", settings=settings, notes=(WHY,))


def folds_of(groups: Mapping[int, str]) -> Iterator[Fold]:
    """Make folds of people, each with its share of every group.

    Raises:
        UnusableData: nobody healthy is left in one.

    """
    names = sorted(set(groups.values()))
    by_group = [[one for one in sorted(groups) if groups[one] == name] for name in names]
    for number in range(FOLDS):
        held_out = [one for people in by_group for one in people[number::FOLDS]]
        others = {one: name for one, name in groups.items() if one not in held_out}
        healthy = [one for one, name in others.items() if name == impaired.HEALTHY]
        if not healthy:
            raise UnusableData("nobody healthy is left to learn from")
        if held_out:
            yield Fold(held_out, (healthy, mixed(others, len(healthy))))


def mixed(groups: Mapping[int, str], count: int) -> list[int]:
    """Choose `count` of these people, as many of each group as there are, spread over their numbers."""
    names = sorted(set(groups.values()))
    chosen: list[int] = []
    for place, name in enumerate(names):
        people = [one for one in sorted(groups) if groups[one] == name]
        wanted = min(len(people), (count + place) // len(names))
        chosen += [people[at] for at in np.linspace(0, len(people) - 1, wanted).round().astype(int).tolist()]
    return chosen


def _fold(taught: Decisions, data: Decisions, lost: Lost, late: Flags, fold: Fold) -> dict[int, Judged]:
    own = {one: data.subject == one for one in fold.held_out}
    # One model after the other: each keeps what it has learned from.
    healthy, both = (_of_model(_fitted(taught, people), data, lost, late, own) for people in fold.teachers)
    return {one: Judged((healthy[one], both[one]), late[rows]) for one, rows in own.items()}


def _fitted(taught: Decisions, people: Sequence[int]) -> PhaseModel:
    own = taught.of(np.isin(taught.subject, people))
    return PhaseModel(SETTINGS).fit(own.features, own.phase, own.stride)


def _of_model(
    model: PhaseModel, data: Decisions, lost: Lost, late: Flags, people: Mapping[int, Flags]
) -> dict[int, Said]:
    found = {}
    for subject, rows in people.items():
        early, later = data.of(rows & ~late), data.of(rows & late)
        adapted = np.zeros(0)
        if len(later.phase) >= LEAST_LATER and len(early.phase):
            adapted = _errors(model.personal(early.features, early.phase, early.stride), later)
        less = {share: _errors(model, one.of(rows)) for share, one in lost.items()}
        found[subject] = Said(_errors(model, data.of(rows)), adapted, less)
    return found


def _errors(model: PhaseModel, data: Decisions) -> Floats:
    return metrics.circular_error(model.predict(data.features), data.phase)


def _person(
    data: Decisions, groups: Mapping[int, str], makes: str, judged: Mapping[int, Judged], subject: int
) -> Person:
    """Return one person's figures; what is promised comes from others, judged as he is."""
    own, rows = judged[subject], data.subject == subject
    hindsight = metrics.circular_error(data.hindsight[rows], data.phase[rows])
    figures = {"hindsight_rmse_percent": _percent(hindsight[~np.isnan(hindsight)])}
    for place, model in enumerate(MODELS):
        likes = [one for one in groups if one != subject and (place or groups[one] == impaired.HEALTHY)]
        errors = [np.abs(judged[one].said[place].error) for one in likes]
        whose = np.repeat(likes, [len(one) for one in errors])
        width = conformal.reach(np.concatenate(errors), whose)
        said = own.said[place]
        before, after = said.error[own.late], said.adapted
        figures |= {
            f"{model}_rmse_percent": _percent(said.error),
            f"{model}_covered": float((np.abs(said.error) <= width).mean()),
            f"{model}_interval_percent": 100.0 * width,
            f"{model}_early_rmse_percent": _percent(said.error[~own.late]),
            f"{model}_later_rmse_percent": _percent(before) if len(after) else np.nan,
            f"{model}_adapted_rmse_percent": _percent(after),
        }
        for share, less in said.lost.items():
            figures[losses.at(f"{model}_rmse_percent", share)] = _percent(less)
    return Person(subject, groups[subject], makes, figures)


def _percent(errors: Floats) -> float:
    return 100.0 * metrics.rms(errors) if len(errors) else np.nan
