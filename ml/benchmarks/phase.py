"""`ipol-phase`: the gait phase of both feet, of people never seen before."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import coverage, folds, ipol, losses, metrics
from ml.benchmarks.models.gait_phase import PhaseModel, PhaseSettings
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search, chosen, told
from ml.benchmarks.strides import Decisions, decisions, lessons

SETTINGS: Final = PhaseSettings()
GRID: Final = (
    SETTINGS,
    PhaseSettings(penalty=0.1),
    PhaseSettings(doubtful=0.1),
    PhaseSettings(hidden=(64, 32)),
)
WITHIN: Final = 0.05  # of a cycle: what `accuracy` counts as right
WHY: Final = (
    "Labels have an error of their own: hindsight_rmse_percent is how far the heel strikes in the foot's own "
    "signal, known before and after, are from them. in_step_… counts the strides where both agree within "
    "0.12 s."
)


def evaluate(path: Path, search: Search) -> Outcome:
    """Leave one subject out, and judge by subjects."""
    trials = ipol.read(path)
    taught, data = lessons(trials), decisions(trials)
    every = {0.0: data} | {share: decisions(ipol.lossy(trials, share)) for share in losses.SHARES}
    people = np.unique(data.subject).tolist()
    work = folds.over(lambda person: _fold(taught, every, person, search), people)
    error = {share: np.empty(len(data.phase)) for share in every}
    for person, (found, _) in zip(people, work, strict=True):
        for share, errors in found.items():
            error[share][data.subject == person] = errors
    return _outcome(data, error, told([settings for _, settings in work], search))


Errors = dict[float, npt.NDArray[np.float64]]  # by the share of packets that are lost


def _fold(
    taught: Decisions, every: Mapping[float, Decisions], person: int, search: Search
) -> tuple[Errors, PhaseSettings]:
    others = taught.of(taught.subject != person)
    settings = chosen(
        SETTINGS,
        GRID,
        others.subject,
        search,
        lambda one, rows, judge: -metrics.rms(errors_of(fitted(others.of(rows), one), others.of(judge))),
    )
    model = fitted(others, settings)
    return {
        share: errors_of(model, data.of(data.subject == person)) for share, data in every.items()
    }, settings


def fitted(data: Decisions, settings: PhaseSettings) -> PhaseModel:
    return PhaseModel(settings).fit(data.features, data.phase, data.stride)


def errors_of(model: PhaseModel, data: Decisions) -> npt.NDArray[np.float64]:
    return metrics.circular_error(model.predict(data.features), data.phase)


def _outcome(data: Decisions, by_share: Errors, settings: str) -> Outcome:
    error = by_share[0.0]
    hindsight = metrics.circular_error(data.hindsight, data.phase)
    covered, width = coverage.of_intervals(error, data.subject)
    by_subject = {}
    for subject in np.unique(data.subject):
        own = data.subject == subject
        by_subject[str(subject)] = {
            "rmse_percent": percent(error[own]),
            "in_step_rmse_percent": percent(error[own & data.in_step]),
            "hindsight_rmse_percent": percent(hindsight[own & ~np.isnan(hindsight)]),
            "in_step_fraction": float(data.in_step[own].mean()),
            "covered": float(covered[own].mean()),
            "interval_percent": 100.0 * float(width[own].mean()),
        }
    figures = {
        "rmse_percent": _mean(by_subject, "rmse_percent"),
        "worst_subject_rmse_percent": max(one["rmse_percent"] for one in by_subject.values()),
        "in_step_rmse_percent": _mean(by_subject, "in_step_rmse_percent"),
        "hindsight_rmse_percent": _mean(by_subject, "hindsight_rmse_percent"),
        "in_step_fraction": float(data.in_step.mean()),
        "accuracy": float((np.abs(error) <= WITHIN).mean()),
        **coverage.figures(by_subject),
        "interval_percent": _mean(by_subject, "interval_percent"),
    }
    for share in losses.SHARES:
        of_people = [percent(by_share[share][data.subject == one]) for one in np.unique(data.subject)]
        figures[losses.at("rmse_percent", share)] = float(np.mean(of_people))
    return Outcome(figures, len(by_subject), by_subject, settings=settings, notes=(WHY,))


def percent(errors: npt.NDArray[np.float64]) -> float:
    """Return the RMS error in percent of the cycle; NaN without any."""
    return 100.0 * metrics.rms(errors) if len(errors) else float("nan")


def _mean(by_subject: dict[str, dict[str, float]], figure: str) -> float:
    return float(np.nanmean([one[figure] for one in by_subject.values()]))
