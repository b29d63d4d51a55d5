"""`ipol-adapt`: what a minute of a new wearer's walking does for the gait phase in the later trials."""

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.errors import UnusableData
from ml.evaluate import folds, ipol, metrics
from ml.evaluate.outcome import Outcome
from ml.evaluate.phase import WHY, WITHIN, Decisions, decisions, errors_of, fitted, percent
from ml.evaluate.search import Search, chosen, told
from ml.features.gait_status import RATE_HZ
from ml.models.gait_phase import PhaseSettings

MINUTE_S: Final = 60.0  # of walking
SETTINGS: Final = PhaseSettings()
GRID: Final = (
    SETTINGS,
    PhaseSettings(personal_epochs=8),
    PhaseSettings(personal_epochs=40),
    PhaseSettings(general_share=1.0),
)

Pair = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]  # errors without and with adaptation


def evaluate(path: Path, search: Search) -> Outcome:
    """Leave one subject out; his first minute adapts, his later trials judge."""
    trials = ipol.read(path)
    data, minute = decisions(trials), _minutes(trials)
    late = np.array(
        [number > minute[subject] for subject, number in zip(data.subject, data.trial, strict=True)]
    )
    splits = [
        split
        for split in folds.one_left_out(data.subject)
        if late[split[1]].any() and not late[split[1]].all()
    ]
    if not splits:
        raise UnusableData(f"{path}: nobody walks on in a later trial after {MINUTE_S:.0f} s of walking")
    work = folds.over(lambda split: _fold(data, late, split, search), splits)
    return _outcome(data, late, splits, [pair for pair, _ in work], told([one for _, one in work], search))


def _minutes(trials: list[ipol.Trial]) -> dict[int, int]:
    """Each subject's trial in which the first minute of walking ends."""
    walked: dict[int, float] = {}
    ends: dict[int, int] = {}
    for trial in trials:
        seconds = float((trial.status == ipol.WALK).sum()) / RATE_HZ
        if walked.get(trial.subject, 0.0) < MINUTE_S:
            ends[trial.subject] = trial.number
        walked[trial.subject] = walked.get(trial.subject, 0.0) + seconds
    return ends


def _fold(
    data: Decisions, late: npt.NDArray[np.bool_], split: folds.Split, search: Search
) -> tuple[Pair, PhaseSettings]:
    train, held_out = split
    settings = chosen(
        SETTINGS,
        GRID,
        data.subject[train],
        search,
        lambda one, rows, judge: _cut(data, late, train[rows], train[judge], one),
    )
    return _both(data, late, train, held_out, settings), settings


def _both(
    data: Decisions,
    late: npt.NDArray[np.bool_],
    train: folds.Rows,
    person: folds.Rows,
    settings: PhaseSettings,
) -> Pair:
    model = fitted(data.of(train), settings)
    early, later = data.of(person[~late[person]]), data.of(person[late[person]])
    own = model.personal(early.features, early.phase, early.stride)
    return errors_of(model, later), errors_of(own, later)


def _cut(
    data: Decisions,
    late: npt.NDArray[np.bool_],
    train: folds.Rows,
    judge: folds.Rows,
    settings: PhaseSettings,
) -> float:
    """The mean over people, for a search."""
    pairs = [
        _both(data, late, train, judge[data.subject[judge] == person], settings)
        for person in np.unique(data.subject[judge])
        if late[judge[data.subject[judge] == person]].any()
    ]
    before, after = (np.mean([metrics.rms(pair[which]) for pair in pairs]) for which in (0, 1))
    return float(1.0 - after / before)


def _outcome(
    data: Decisions,
    late: npt.NDArray[np.bool_],
    splits: list[folds.Split],
    pairs: list[Pair],
    settings: str,
) -> Outcome:
    by_subject = {}
    for (_, person), (before, after) in zip(splits, pairs, strict=True):
        rows = person[late[person]]
        in_step = data.in_step[rows]
        by_subject[str(data.subject[rows[0]])] = {
            "rmse_percent": percent(before),
            "adapted_rmse_percent": percent(after),
            "in_step_rmse_percent": percent(before[in_step]),
            "in_step_adapted_rmse_percent": percent(after[in_step]),
        }
    mean = {
        key: float(np.nanmean([one[key] for one in by_subject.values()]))
        for key in by_subject[min(by_subject)]
    }
    adapted = np.concatenate([after for _, after in pairs])
    figures = mean | {
        "adaptation_cut": 1.0 - mean["adapted_rmse_percent"] / mean["rmse_percent"],
        "in_step_adaptation_cut": 1.0 - mean["in_step_adapted_rmse_percent"] / mean["in_step_rmse_percent"],
        "accuracy": float((np.abs(adapted) <= WITHIN).mean()),
    }
    return Outcome(figures, len(by_subject), by_subject, settings=settings, notes=(WHY,))
