"""Decisions within strides, of both feet: what the gait phase is learned from and judged by."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import ipol
from ml.errors import UnusableData
from ml.features import Recipe, features
from ml.features.gait_phase import LEFT_PHASE, RIGHT_PHASE
from ml.features.gait_status import CHANNELS
from ml.features.gaps import mended

STEP: Final = 10  # samples between decisions: 100 ms
PACES: Final = (0.8, 1.25)  # of duration: people are slower and faster than the few who were recorded
PACES_STEP: Final = 20  # samples between decisions that are learned at another pace
OWN_PACES: Final = (0.9, 1.1)  # a wearer's own minute is little, and he never walks quite like that again
OWN_STEP: Final = 3  # samples between decisions that are learned of it, and twice that at another pace
FEET: Final = tuple(
    (recipe, CHANNELS.index(f"{side}_foot.angular_velocity_y"))
    for side, recipe in (("left", LEFT_PHASE), ("right", RIGHT_PHASE))
)
SWUNG: Final = 1.5  # rad/s of pitch that a foot surely reaches in its swing
AT_LEAST: Final = 45  # samples between two heel strikes of a foot
LABELLED_LATER: Final = 3  # samples: the labels put the foot on the ground this much after its rate's zero
TOO_FEW: Final = "fewer than two subjects have strides of 0.7 to 2.0 s: nothing can be learned"
AGREE: Final = 12  # samples that the labels and the foot's own signal may lie apart


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


def lessons(trials: Sequence[ipol.Trial]) -> Decisions:
    """Return the training data: every trial, and each at slower and faster paces."""
    return _joined(decisions(trials), decisions(_paced(trials, PACES), PACES_STEP))


def own_lessons(trials: Sequence[ipol.Trial]) -> Decisions:
    """Return the training data of one wearer's trials."""
    return _joined(_decisions(trials, OWN_STEP), _decisions(_paced(trials, OWN_PACES), 2 * OWN_STEP))


def decisions(trials: Sequence[ipol.Trial], step: int = STEP) -> Decisions:
    """Return every trial's strides, a decision each `step` samples.

    Raises:
        UnusableData: there is none of which to learn.

    """
    made = _decisions(trials, step)
    if len(np.unique(made.subject)) < 2:
        raise UnusableData(TOO_FEW)
    return made


def _decisions(trials: Sequence[ipol.Trial], step: int) -> Decisions:
    parts = [part for trial in trials for part in _of_trial(trial, step) if len(part[0])]
    if not parts:
        raise UnusableData(TOO_FEW)
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    columns[2] = apart([part[2] for part in parts])
    return Decisions(*columns)


def _paced(trials: Sequence[ipol.Trial], paces: Sequence[float]) -> list[ipol.Trial]:
    made = (ipol.stretched(trial, factor) for factor in paces for trial in trials)
    return [one for one in made if len(one.samples)]  # of a single sample, faster, none is left


def _joined(*made: Decisions) -> Decisions:
    columns = {field.name: [getattr(one, field.name) for one in made] for field in fields(Decisions)}
    stride = apart(columns.pop("stride"))
    return Decisions(**{name: np.concatenate(column) for name, column in columns.items()}, stride=stride)


def apart(numbers: Sequence[npt.NDArray[np.int_]]) -> npt.NDArray[np.int_]:
    """Return numbers counted on from list to list, so that no two lists share one."""
    sizes = [int(own.max()) + 1 for own in numbers]
    offsets = np.cumsum([0, *sizes[:-1]])
    return np.concatenate([own + offset for own, offset in zip(numbers, offsets, strict=True)])


def _of_trial(trial: ipol.Trial, step: int) -> Iterator[tuple[Any, ...]]:
    for (recipe, pitch), in_air in zip(FEET, trial.in_air, strict=True):
        yield _of_foot(trial, recipe, mended(trial.samples[:, pitch]), in_air, step)


def _of_foot(
    trial: ipol.Trial,
    recipe: Recipe,
    pitch: npt.NDArray[np.float64],
    in_air: npt.NDArray[np.bool_],
    step: int,
) -> tuple[Any, ...]:
    labelled, own = ipol.strikes(in_air), heel_strikes(pitch) + LABELLED_LATER
    own = own[own < len(in_air)]  # moved later, the last one may lie beyond what was recorded
    phase = ipol.phase(labelled, len(in_air))
    ends = np.arange(0, len(phase), step)
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
    """Return where a foot's pitch rate falls through zero after a swing; in hindsight, to judge labels."""
    if len(pitch) < AT_LEAST:
        return np.array([], dtype=np.intp)
    smooth = np.convolve(pitch, np.ones(3) / 3.0, mode="same")
    falling = np.flatnonzero((smooth[:-1] > 0) & (smooth[1:] <= 0)) + 1
    found: list[int] = []
    begin = 0
    for at in falling.tolist():
        if smooth[begin:at].max() > SWUNG and (not found or at - found[-1] >= AT_LEAST):
            found.append(at)
        begin = at
    return np.array(found, dtype=np.intp)
