"""`ipol-phase`: the gait phase of both feet, of people never seen before."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.errors import UnusableData
from ml.evaluate import folds, ipol, metrics
from ml.evaluate.outcome import Outcome
from ml.evaluate.search import Search, chosen, told
from ml.features import Recipe, features
from ml.features.gait_phase import LEFT_PHASE, RIGHT_PHASE
from ml.features.gait_status import CHANNELS
from ml.models.gait_phase import PhaseModel, PhaseSettings

STEP: Final = 10  # samples between decisions: 100 ms
SETTINGS: Final = PhaseSettings()
GRID: Final = (
    SETTINGS,
    PhaseSettings(penalty=0.1),
    PhaseSettings(doubtful=0.1),
    PhaseSettings(hidden=(64, 32)),
)
FEET: Final = tuple(
    (recipe, CHANNELS.index(f"{side}_foot.angular_velocity_y"))
    for side, recipe in (("left", LEFT_PHASE), ("right", RIGHT_PHASE))
)
SWUNG: Final = 1.5  # rad/s of pitch that a foot surely reaches in its swing
AT_LEAST: Final = 45  # samples between two heel strikes of a foot
LABELLED_LATER: Final = 3  # samples: the labels put the foot on the ground this much after its rate's zero
AGREE: Final = 12  # samples that the labels and the foot's own signal may lie apart
WITHIN: Final = 0.05  # of a cycle: what `accuracy` counts as right
WHY: Final = (
    "The labels of some trials drift away from the sensors' samples, up to two seconds within a walk. "
    "hindsight_rmse_percent is what the heel strikes in the foot's own signal give, known before and after: "
    "no causal estimate can be much better. in_step_… counts the strides where both agree within 0.12 s."
)


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """Every decision within a stride, of both feet; arrays have a row each."""

    features: npt.NDArray[np.float32]
    phase: npt.NDArray[np.float64]
    stride: npt.NDArray[np.int_]  # a number of its own for each stride
    in_step: npt.NDArray[np.bool_]  # whether the foot's own signal strikes where the labels say
    hindsight: npt.NDArray[np.float64]  # the phase by the strikes in the foot's own signal; NaN without any
    subject: npt.NDArray[np.int_]
    trial: npt.NDArray[np.int_]

    def of(self, rows: npt.NDArray[Any]) -> "Decisions":
        return Decisions(*(getattr(self, field.name)[rows] for field in fields(self)))


def decisions(trials: Sequence[ipol.Trial]) -> Decisions:
    """Read every trial's strides.

    Raises:
        UnusableData: there is none of which to learn.

    """
    parts = [part for trial in trials for part in _of_trial(trial) if len(part[0])]
    if len({part[-2][0] for part in parts}) < 2:
        raise UnusableData("fewer than two subjects have strides of 0.7 to 2.0 s: nothing can be learned")
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    columns[2] = _apart([part[2] for part in parts])
    return Decisions(*columns)


def _apart(numbers: Sequence[npt.NDArray[np.int_]]) -> npt.NDArray[np.int_]:
    """Numbers counted on from list to list, so that no two lists share one."""
    sizes = [int(own.max()) + 1 for own in numbers]
    offsets = np.cumsum([0, *sizes[:-1]])
    return np.concatenate([own + offset for own, offset in zip(numbers, offsets, strict=True)])


def _of_trial(trial: ipol.Trial) -> Iterator[tuple[Any, ...]]:
    for (recipe, pitch), in_air in zip(FEET, trial.in_air, strict=True):
        yield _of_foot(trial, recipe, trial.samples[:, pitch], in_air)


def _of_foot(
    trial: ipol.Trial, recipe: Recipe, pitch: npt.NDArray[np.float64], in_air: npt.NDArray[np.bool_]
) -> tuple[Any, ...]:
    labelled, own = ipol.strikes(in_air), heel_strikes(pitch) + LABELLED_LATER
    phase = ipol.phase(labelled, len(in_air))
    ends = np.arange(0, len(phase), STEP)
    ends = ends[~np.isnan(phase[ends])]
    stride = np.searchsorted(labelled, ends, side="right")
    agrees = np.zeros(len(labelled) + 1, dtype=bool)
    if len(own):
        agrees[:-1] = np.abs(labelled[:, None] - own).min(axis=1) <= AGREE
    return (
        features(recipe, trial.samples, ends),
        phase[ends],
        stride,
        agrees[stride - 1] & agrees[stride],
        ipol.phase(own, len(in_air))[ends],
        np.full(len(ends), trial.subject),
        np.full(len(ends), trial.number),
    )


def heel_strikes(pitch: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
    """Where a foot's pitch rate falls through zero after a swing; with hindsight, for judging labels."""
    smooth = np.convolve(pitch, np.ones(3) / 3.0, mode="same")
    falling = np.flatnonzero((smooth[:-1] > 0) & (smooth[1:] <= 0)) + 1
    found: list[int] = []
    begin = 0
    for at in falling.tolist():
        if smooth[begin:at].max() > SWUNG and (not found or at - found[-1] >= AT_LEAST):
            found.append(at)
        begin = at
    return np.array(found, dtype=np.intp)


def evaluate(path: Path, search: Search) -> Outcome:
    """Leave one subject out, and judge by subjects."""
    data = decisions(ipol.read(path))
    splits = list(folds.one_left_out(data.subject))
    work = folds.over(lambda split: _fold(data, split, search), splits)
    error = np.empty(len(data.phase))
    for (_, held_out), (errors, _) in zip(splits, work, strict=True):
        error[held_out] = errors
    return _outcome(data, error, told([settings for _, settings in work], search))


def _fold(
    data: Decisions, split: folds.Split, search: Search
) -> tuple[npt.NDArray[np.float64], PhaseSettings]:
    train, held_out = (data.of(rows) for rows in split)
    settings = chosen(
        SETTINGS,
        GRID,
        train.subject,
        search,
        lambda one, rows, judge: -metrics.rms(errors_of(fitted(train.of(rows), one), train.of(judge))),
    )
    return errors_of(fitted(train, settings), held_out), settings


def fitted(data: Decisions, settings: PhaseSettings = SETTINGS) -> PhaseModel:
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
