"""Models' output on the benchmarks' recordings, moment by moment, for people unseen in training.

For rules on predictions, which are to be tried on recordings before they may act on a robot.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import fall, folds, ipol, sisfall, status
from ml.benchmarks.models.falling import FallDetector, probability_of
from ml.benchmarks.models.gait_status import status_model
from ml.features import features
from ml.features.falling import FALLING, RATE_HZ
from ml.features.gait_context import GAIT_CONTEXT

Floats = npt.NDArray[np.float64]
Causes = Mapping[str, Sequence[tuple[float, float]]]
IPOL_STEP: Final = 10  # samples between decisions: 100 ms
TO_FALLING: Final = 2  # IPOL has 100 Hz, and falls are looked for at 50


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """Model output on one recording; times in seconds since it began.

    `probabilities`: of each class, (n,) at `at_s` (n,). `causes`: of each class, from when to when it was so;
    a fall is at its impact. `length_s` of the recording were looked at.
    """

    subject: str
    at_s: Floats
    probabilities: Mapping[str, Floats]
    length_s: float
    causes: Causes


def falls(path: Path) -> list[Told]:
    """SisFall, up to the impact of each fall, by people of other folds: `fall` and `near_fall` are one here.

    Raises:
        UnusableData: it is no such file.

    """
    recordings = sisfall.read(path)
    data = fall.decisions(recordings)
    probability = np.empty(len(data.at))

    def told(split: folds.Split) -> Floats:
        train, held_out = split
        return probability_of(_detector(data, train[~data.stumble[train]]), data.features, held_out)

    splits = list(fall.grouped(recordings, data))
    for (_, held_out), found in zip(splits, folds.over(told, splits), strict=True):
        probability[held_out] = found
    return [
        _of_fall(recording, data.at[rows], probability[rows])
        for recording, rows in zip(recordings, _rows(data, len(recordings)), strict=True)
    ]


def walks(path: Path, falls_path: Path) -> list[Told]:
    """Falls looked for in IPOL's walks, by people of SisFall: there are none.

    Raises:
        UnusableData: one of them is no such file.

    """
    data = fall.decisions(sisfall.read(falls_path))
    detector = _detector(data, np.flatnonzero(~data.stumble))
    found = []
    for trial in ipol.read(path):
        samples = trial.samples[::TO_FALLING, : len(FALLING.channels)]
        ends = np.arange(fall.FIRST, len(samples), fall.STEP)
        probability = probability_of(detector, features(FALLING, samples, ends), np.arange(len(ends)))
        found.append(_told_falling(str(trial.subject), ends, probability, len(samples), {}))
    return found


def statuses(path: Path) -> list[Told]:
    """Standing, walking and turning in IPOL's walks, by all other people.

    Raises:
        UnusableData: it is no such file.

    """
    trials = ipol.read(path)
    data = status.decisions(trials)

    def told(split: folds.Split) -> list[Told]:
        train, held_out = split
        model = status_model(status.SETTINGS).fit(data.features[train], data.truth[train])
        own = {str(subject) for subject in np.unique(data.subject[held_out])}
        return [_of_walk(model, trial) for trial in trials if str(trial.subject) in own]

    return [one for found in folds.over(told, list(folds.one_left_out(data.subject))) for one in found]


# --- inside


def _detector(data: fall.Decisions, rows: folds.Rows) -> FallDetector:
    return FallDetector(fall.SETTINGS).fit(data.features, data.to_impact, data.recording, data.subject, rows)


def _rows(data: fall.Decisions, recordings: int) -> Iterator[folds.Rows]:
    """Yield each recording's decisions."""
    bounds = np.searchsorted(data.recording, np.arange(recordings + 1))
    yield from (np.arange(begin, end) for begin, end in pairwise(bounds))


def _of_fall(recording: sisfall.Recording, at: npt.NDArray[np.int_], probability: Floats) -> Told:
    """Decisions end with the impact; who stumbles nearly falls all the time."""
    impact = recording.impact
    length = len(recording.samples) if impact is None else impact + 1
    fallen = [] if impact is None else [(impact / RATE_HZ, impact / RATE_HZ)]
    stumbled = [(0.0, length / RATE_HZ)] if recording.activity == sisfall.STUMBLE else []
    causes = {"fall": fallen, "near_fall": fallen + stumbled}
    return _told_falling(recording.subject, at, probability, length, causes)


def _told_falling(
    subject: str,
    at: npt.NDArray[np.int_],
    probability: Floats,
    length: int,
    causes: Causes,
) -> Told:
    said = {"steady": 1.0 - probability, "near_fall": probability, "fall": probability}
    return Told(subject, at / RATE_HZ, said, length / RATE_HZ, causes)


def _of_walk(model: Any, trial: ipol.Trial) -> Told:
    ends = np.arange(status.FIRST, len(trial.samples), IPOL_STEP)
    found = model.predict_proba(features(GAIT_CONTEXT, trial.samples, ends))
    said = {ipol.STATUSES[number]: found[:, at] for at, number in enumerate(model.classes_)}
    length_s = len(trial.samples) / GAIT_CONTEXT.rate_hz
    return Told(str(trial.subject), ends / GAIT_CONTEXT.rate_hz, said, length_s, _spells(trial))


def _spells(trial: ipol.Trial) -> Causes:
    """Return from when to when somebody was in each state."""
    bounds = [0, *(np.flatnonzero(np.diff(trial.status)) + 1), len(trial.status)]
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in ipol.STATUSES}
    for begin, end in pairwise(bounds):
        spell = (begin / GAIT_CONTEXT.rate_hz, end / GAIT_CONTEXT.rate_hz)
        found[ipol.STATUSES[trial.status[begin]]].append(spell)
    return found
