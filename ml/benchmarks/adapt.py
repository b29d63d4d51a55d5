"""`ipol-adapt`: what a minute of a new wearer's walking does for the gait phase in the later trials."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import coverage, folds, ipol, losses, metrics
from ml.benchmarks.models.gait_phase import PhaseModel, PhaseSettings
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.phase import WHY, WITHIN, errors_of, fitted, percent
from ml.benchmarks.search import Search, chosen, told
from ml.benchmarks.strides import Decisions, decisions, lessons, own_lessons
from ml.errors import UnusableData
from ml.features.gait_status import RATE_HZ

MINUTE_S: Final = 60.0  # of walking
SETTINGS: Final = PhaseSettings()
GRID: Final = (
    SETTINGS,
    PhaseSettings(personal_epochs=6),
    PhaseSettings(trust=1.0),
    PhaseSettings(general_share=1.0),
)

Pair = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]  # errors without and with adaptation
Pairs = dict[float, Pair]  # by the share of packets that are lost, in the minute too


def evaluate(path: Path, search: Search) -> Outcome:
    """Leave one subject out; his first minute adapts, his later trials judge."""
    trials = ipol.read(path)
    taught, data, minute = lessons(trials), decisions(trials), _minutes(trials)
    late = _late(data, minute)
    people = [
        person
        for person in np.unique(data.subject).tolist()
        if 0 < late[data.subject == person].sum() < (data.subject == person).sum()
    ]
    if not people:
        raise UnusableData(f"{path}: nobody walks on in a later trial after {MINUTE_S:.0f} s of walking")
    walks = {0.0: trials} | {share: ipol.lossy(trials, share) for share in losses.SHARES}
    every = {share: decisions(walked) for share, walked in walks.items()}

    def work_of(person: int) -> tuple[Pairs, PhaseSettings]:
        own = {
            share: (_minute(walked, person, minute), every[share].of((data.subject == person) & late))
            for share, walked in walks.items()
        }
        others = taught.of(taught.subject != person)
        return _fold(others, minute, own, search)

    work = folds.over(work_of, people)
    judged = [data.of((data.subject == person) & late) for person in people]
    return _outcome(judged, [pairs for pairs, _ in work], told([one for _, one in work], search))


def _late(data: Decisions, minute: dict[int, int]) -> npt.NDArray[np.bool_]:
    """Return the decisions of trials after a subject's first minute."""
    last = np.array([minute[person] for person in data.subject.tolist()])
    return np.asarray(data.trial > last)


def _minutes(trials: list[ipol.Trial]) -> dict[int, int]:
    """Return each subject's trial in which the first minute of walking ends."""
    walked: dict[int, float] = {}
    ends: dict[int, int] = {}
    for trial in trials:
        seconds = float((trial.status == ipol.WALK).sum()) / RATE_HZ
        if walked.get(trial.subject, 0.0) < MINUTE_S:
            ends[trial.subject] = trial.number
        walked[trial.subject] = walked.get(trial.subject, 0.0) + seconds
    return ends


def _minute(trials: list[ipol.Trial], person: int, minute: dict[int, int]) -> Decisions:
    """Return the training data of a person's first minute."""
    return own_lessons([one for one in trials if one.subject == person and one.number <= minute[person]])


def _fold(
    others: Decisions,
    minute: dict[int, int],
    own: Mapping[float, tuple[Decisions, Decisions]],
    search: Search,
) -> tuple[Pairs, PhaseSettings]:
    """`own`: a person's first minute, and what comes later."""
    settings = chosen(
        SETTINGS,
        GRID,
        others.subject,
        search,
        lambda one, rows, judge: _cut(others.of(rows), minute, others.of(judge), one),
    )
    model = fitted(others, settings)
    return {share: _both(model, early, later) for share, (early, later) in own.items()}, settings


def _both(model: PhaseModel, early: Decisions, later: Decisions) -> Pair:
    personal = model.personal(early.features, early.phase, early.stride)
    return errors_of(model, later), errors_of(personal, later)


def _cut(others: Decisions, minute: dict[int, int], judge: Decisions, settings: PhaseSettings) -> float:
    """Return, for a search, how much of the error adaptation takes away, over these people."""
    people = [judge.of(judge.subject == person) for person in np.unique(judge.subject)]
    model = fitted(others, settings)
    parts = [(own, _late(own, minute)) for own in people]
    pairs = [_both(model, own.of(~late), own.of(late)) for own, late in parts if late.any()]
    before, after = (np.mean([metrics.rms(pair[which]) for pair in pairs]) for which in (0, 1))
    return float(1.0 - after / before)


def _outcome(judged: list[Decisions], every: list[Pairs], settings: str) -> Outcome:
    pairs = [one[0.0] for one in every]
    subject = np.concatenate([own.subject for own in judged])
    intervals = [
        coverage.of_intervals(np.concatenate(column), subject) for column in zip(*pairs, strict=True)
    ]
    by_subject = {}
    for own, (before, after) in zip(judged, pairs, strict=True):
        rows = subject == own.subject[0]
        by_subject[str(own.subject[0])] = {
            "rmse_percent": percent(before),
            "adapted_rmse_percent": percent(after),
            "in_step_rmse_percent": percent(before[own.in_step]),
            "in_step_adapted_rmse_percent": percent(after[own.in_step]),
            **_intervals("", rows, *intervals[0]),
            **_intervals("adapted_", rows, *intervals[1]),
        }
    first = next(iter(by_subject.values()))
    mean = {name: float(np.nanmean([one[name] for one in by_subject.values()])) for name in first}
    adapted = np.concatenate([after for _, after in pairs])
    figures = mean | {
        "adaptation_cut": 1.0 - mean["adapted_rmse_percent"] / mean["rmse_percent"],
        "in_step_adaptation_cut": 1.0 - mean["in_step_adapted_rmse_percent"] / mean["in_step_rmse_percent"],
        "accuracy": float((np.abs(adapted) <= WITHIN).mean()),
    }
    for name in ("", "adapted_"):
        alone = {one: {"covered": found[f"{name}covered"]} for one, found in by_subject.items()}
        figures |= {f"{name}{figure}": value for figure, value in coverage.figures(alone).items()}
    for share in losses.SHARES:
        general, personal = (
            float(np.mean([percent(one[share][which]) for one in every])) for which in (0, 1)
        )
        figures[losses.at("adapted_rmse_percent", share)] = personal
        figures[losses.at("adaptation_cut", share)] = 1.0 - personal / general
    return Outcome(figures, len(by_subject), by_subject, settings=settings, notes=(WHY,))


def _intervals(
    name: str, rows: npt.NDArray[np.bool_], covered: npt.NDArray[np.bool_], width: npt.NDArray[np.float64]
) -> dict[str, float]:
    """One subject's interval, which comes from all the others', and how much of his errors it holds."""
    return {
        f"{name}covered": float(covered[rows].mean()),
        f"{name}interval_percent": 100.0 * float(width[rows].mean()),
    }
