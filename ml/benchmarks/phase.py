"""`ipol-phase`: the gait phase of both feet, of people never seen before."""

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import folds, ipol, metrics
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
    people = np.unique(data.subject).tolist()
    work = folds.over(lambda person: _fold(taught, data, person, search), people)
    error = np.empty(len(data.phase))
    for person, (errors, _) in zip(people, work, strict=True):
        error[data.subject == person] = errors
    return _outcome(data, error, told([settings for _, settings in work], search))


def _fold(
    taught: Decisions, data: Decisions, person: int, search: Search
) -> tuple[npt.NDArray[np.float64], PhaseSettings]:
    others = taught.of(taught.subject != person)
    settings = chosen(
        SETTINGS,
        GRID,
        others.subject,
        search,
        lambda one, rows, judge: -metrics.rms(errors_of(fitted(others.of(rows), one), others.of(judge))),
    )
    return errors_of(fitted(others, settings), data.of(data.subject == person)), settings


def fitted(data: Decisions, settings: PhaseSettings) -> PhaseModel:
    return PhaseModel(settings).fit(data.features, data.phase, data.stride)


def errors_of(model: PhaseModel, data: Decisions) -> npt.NDArray[np.float64]:
    return metrics.circular_error(model.predict(data.features), data.phase)


def _outcome(data: Decisions, error: npt.NDArray[np.float64], settings: str) -> Outcome:
    hindsight = metrics.circular_error(data.hindsight, data.phase)
    by_subject = {}
    for subject in np.unique(data.subject):
        own = data.subject == subject
        by_subject[str(subject)] = {
            "rmse_percent": percent(error[own]),
            "in_step_rmse_percent": percent(error[own & data.in_step]),
            "hindsight_rmse_percent": percent(hindsight[own & ~np.isnan(hindsight)]),
            "in_step_fraction": float(data.in_step[own].mean()),
        }
    figures = {
        "rmse_percent": _mean(by_subject, "rmse_percent"),
        "worst_subject_rmse_percent": max(one["rmse_percent"] for one in by_subject.values()),
        "in_step_rmse_percent": _mean(by_subject, "in_step_rmse_percent"),
        "hindsight_rmse_percent": _mean(by_subject, "hindsight_rmse_percent"),
        "in_step_fraction": float(data.in_step.mean()),
        "accuracy": float((np.abs(error) <= WITHIN).mean()),
    }
    return Outcome(figures, len(by_subject), by_subject, settings=settings, notes=(WHY,))


def percent(errors: npt.NDArray[np.float64]) -> float:
    """The RMS error in percent of the cycle; NaN without any."""
    return 100.0 * metrics.rms(errors) if len(errors) else float("nan")


def _mean(by_subject: dict[str, dict[str, float]], figure: str) -> float:
    return float(np.nanmean([one[figure] for one in by_subject.values()]))
