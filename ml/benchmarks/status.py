"""`ipol-status`: standing, walking or turning, 200 ms late, of people never seen before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import coverage, folds, ipol, losses, metrics
from ml.benchmarks.models.gait_status import StatusSettings, status_model
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search, chosen, told
from ml.errors import UnusableData
from ml.features import features
from ml.features.gait_context import GAIT_CONTEXT

FIRST: Final = 50  # the first sample of a trial that is judged, and then each STEP later
STEP: Final = 20
DELAY: Final = 20  # samples: the truth is what was 200 ms before the newest sample
NEAR: Final = 50  # samples around a change that are not steady
SETTINGS: Final = StatusSettings()
GRID: Final = (
    SETTINGS,
    StatusSettings(rounds=100),
    StatusSettings(leaves=31),
    StatusSettings(penalty=0.1),
    StatusSettings(turn_weight=1.0),
)


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """Every decision of every trial; arrays have a row each."""

    features: npt.NDArray[np.float32]
    truth: npt.NDArray[np.int_]
    subject: npt.NDArray[np.int_]
    steady: npt.NDArray[np.bool_]


def decisions(trials: Sequence[ipol.Trial]) -> Decisions:
    parts = [_of_trial(trial) for trial in trials]
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Decisions(*columns)


def _of_trial(trial: ipol.Trial) -> tuple[Any, ...]:
    ends = np.arange(FIRST, len(trial.samples), STEP)
    judged = ends - DELAY
    changes = np.flatnonzero(np.diff(trial.status)) + 1
    near = (np.abs(judged[:, None] - changes) <= NEAR).any(axis=1)
    return (
        features(GAIT_CONTEXT, trial.samples, ends),
        trial.status[judged],
        np.full(len(ends), trial.subject),
        ~near,
    )


def evaluate(path: Path, search: Search) -> Outcome:
    """Leave one subject out, and judge by subjects."""
    trials = ipol.read(path)
    data = decisions(trials)
    if len(np.unique(data.truth)) < 2:
        raise UnusableData(f"{path} has one state alone: there is nothing to tell apart")
    splits = list(folds.one_left_out(data.subject))
    rows = {0.0: data.features}
    rows |= {share: decisions(ipol.lossy(trials, share)).features for share in losses.SHARES}
    work = folds.over(lambda split: _fold(data, rows, split, search), splits)
    likely = {share: np.zeros((len(data.truth), len(ipol.STATUSES))) for share in rows}
    for (_, held_out), (found, _) in zip(splits, work, strict=True):
        for share, probabilities in found.items():
            likely[share][held_out] = probabilities
    return _outcome(data, likely, told([settings for _, settings in work], search))


Rows = Mapping[float, npt.NDArray[np.float32]]  # features by the share of packets that are lost
Floats = npt.NDArray[np.float64]
Likely = dict[float, Floats]  # (n, statuses) probabilities


def _fold(data: Decisions, every: Rows, split: folds.Split, search: Search) -> tuple[Likely, StatusSettings]:
    train, held_out = split
    settings = chosen(
        SETTINGS,
        GRID,
        data.subject[train],
        search,
        lambda one, rows, judge: _score(data, one, train[rows], train[judge]),
    )
    model = _fitted(data, settings, train)
    return {share: _likely(model, rows[held_out], settings) for share, rows in every.items()}, settings


def _fitted(data: Decisions, settings: StatusSettings, train: folds.Rows) -> Any:
    return status_model(settings).fit(data.features[train], data.truth[train])


def _likely(model: Any, features: npt.NDArray[np.float32], settings: StatusSettings) -> Floats:
    """(n, statuses): the probability of each, turns weighted."""
    weights = np.where(model.classes_ == ipol.TURN, settings.turn_weight, 1.0)
    likely = np.zeros((len(features), len(ipol.STATUSES)))
    likely[:, model.classes_] = model.predict_proba(features) * weights
    return np.asarray(likely / likely.sum(axis=1, keepdims=True))


def _score(data: Decisions, settings: StatusSettings, train: folds.Rows, judge: folds.Rows) -> float:
    likely = _likely(_fitted(data, settings, train), data.features[judge], settings)
    return _mean_f1(data.truth[judge], likely.argmax(axis=1), data.subject[judge])


def _mean_f1(
    truth: npt.NDArray[np.int_], predicted: npt.NDArray[np.int_], subject: npt.NDArray[np.int_]
) -> float:
    return float(np.mean([_f1(truth, predicted, subject == one) for one in np.unique(subject)]))


def _f1(truth: npt.NDArray[np.int_], predicted: npt.NDArray[np.int_], rows: npt.NDArray[np.bool_]) -> float:
    return metrics.macro_f1(truth[rows], predicted[rows], len(ipol.STATUSES))


def _outcome(data: Decisions, by_share: Likely, settings: str) -> Outcome:
    predicted = by_share[0.0].argmax(axis=1)
    covered, said = coverage.of_sets(by_share[0.0], data.truth, data.subject)
    right = predicted == data.truth
    by_subject = {}
    for subject in np.unique(data.subject):
        own = data.subject == subject
        by_subject[str(subject)] = {
            "macro_f1": _f1(data.truth, predicted, own),
            "steady_macro_f1": _f1(data.truth, predicted, own & data.steady),
            "accuracy": metrics.accuracy(data.truth[own], predicted[own]),
            **coverage.of_rows(covered, said, right, own),
        }
    figures = {
        "macro_f1": float(np.mean([one["macro_f1"] for one in by_subject.values()])),
        "worst_subject_macro_f1": min(one["macro_f1"] for one in by_subject.values()),
        "steady_macro_f1": float(np.mean([one["steady_macro_f1"] for one in by_subject.values()])),
        "accuracy": metrics.accuracy(data.truth, predicted),
        **coverage.of_rows(covered, said, right, np.ones_like(said)),
        **coverage.figures(by_subject),
    }
    for share in losses.SHARES:
        figures[losses.at("macro_f1", share)] = _mean_f1(
            data.truth, by_share[share].argmax(axis=1), data.subject
        )
    counts = metrics.confusion(data.truth, predicted, len(ipol.STATUSES))
    return Outcome(figures, len(by_subject), by_subject, "subject", ipol.STATUSES, counts, settings)
