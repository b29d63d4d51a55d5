"""`sisfall-prefall`: an alarm before a fall's impact, and none in daily life, of people never seen before."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import folds, losses, sisfall
from ml.benchmarks.models.falling import FAR, FallDetector, FallSettings
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search, chosen, told
from ml.features import features
from ml.features.falling import FALLING, RATE_HZ

STEP: Final = 2  # samples between decisions: 40 ms
FIRST: Final = 25  # samples of a recording before its first decision
IN_TIME: Final = 75  # samples: an alarm up to 1.5 s before the impact is of this fall
FOLDS: Final = 5
LOST: Final = ("sensitivity", "false_alarm_fraction")  # figures told with packets lost too
NEVER: Final = -1
MS: Final = 1000 // RATE_HZ
SETTINGS: Final = FallSettings()
GRID: Final = (SETTINGS, FallSettings(falling=25), FallSettings(falling=16), FallSettings(leaves=31))


@dataclass(frozen=True, slots=True)
class Alarm:
    """Result of one recording."""

    fall: bool
    stumble: bool
    came: bool  # before the impact, where there is one
    lead: int  # samples from the first alarm to the impact

    @classmethod
    def of(cls, recording: sisfall.Recording, first: int) -> "Alarm":
        """`first`: the sample of the first alarm, or NEVER."""
        lead = NEVER if recording.impact is None else recording.impact - first
        return cls(recording.impact is not None, recording.activity == sisfall.STUMBLE, first != NEVER, lead)

    @property
    def detected(self) -> bool:
        return self.fall and self.came and 0 <= self.lead <= IN_TIME

    @property
    def early(self) -> bool:
        return self.fall and self.came and self.lead > IN_TIME


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """Every decision of every recording, up to the impact of a fall; arrays have a row each."""

    features: npt.NDArray[np.float32]
    recording: npt.NDArray[np.int_]
    at: npt.NDArray[np.int_]  # sample in its recording
    to_impact: npt.NDArray[np.int_]  # samples; FAR where there is none
    subject: npt.NDArray[Any]
    stumble: npt.NDArray[np.bool_]


def decisions(recordings: list[sisfall.Recording]) -> Decisions:
    parts = [_of_recording(number, recording) for number, recording in enumerate(recordings)]
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Decisions(_features(recordings, columns[1], columns[0]), *columns)


def _features(
    recordings: list[sisfall.Recording], at: npt.NDArray[np.int_], number: npt.NDArray[np.int_]
) -> npt.NDArray[np.float32]:
    """Written where they stay: half a gigabyte for twenty people."""
    width = features(FALLING, recordings[0].samples, np.arange(0)).shape[1]
    every = np.empty((len(at), width), dtype=np.float32)
    bounds = np.searchsorted(number, np.arange(len(recordings) + 1))
    for recording, (begin, end) in zip(recordings, pairwise(bounds), strict=True):
        every[begin:end] = features(FALLING, recording.samples, at[begin:end])
    return every


def _of_recording(number: int, recording: sisfall.Recording) -> tuple[npt.NDArray[Any], ...]:
    # What an alarm after the impact says changes no figure.
    last = len(recording.samples) if recording.impact is None else recording.impact + 1
    at = np.arange(min(FIRST, last - 1), last, STEP)
    return (
        np.full(len(at), number),
        at,
        np.full(len(at), FAR) if recording.impact is None else recording.impact - at,
        np.full(len(at), recording.subject),
        np.full(len(at), recording.activity == sisfall.STUMBLE),
    )


def evaluate(path: Path, search: Search) -> Outcome:
    """Five folds of subjects; the threshold of each by inner folds of its training subjects."""
    recordings = sisfall.read(path)
    data = decisions(recordings)
    splits = list(grouped(recordings, data))
    work = folds.over(lambda split: _fold(recordings, data, split, search), splits)
    first = {share: np.full(len(recordings), NEVER) for share in (0.0, *losses.SHARES)}
    for (_, held_out), (found, _) in zip(splits, work, strict=True):
        for share, alarms in found.items():
            rows = held_out[alarms][::-1]  # the earliest of each recording is written last
            first[share][data.recording[rows]] = data.at[rows]
    return _outcome(recordings, first, told([settings for _, settings in work], search))


def grouped(recordings: list[sisfall.Recording], data: Decisions) -> Iterator[folds.Split]:
    """Folds of the decisions, by folds of the recordings."""
    for train, held_out in folds.grouped(np.array([recording.subject for recording in recordings]), FOLDS):
        yield (
            np.flatnonzero(np.isin(data.recording, train)),
            np.flatnonzero(np.isin(data.recording, held_out)),
        )


Alarms = dict[float, npt.NDArray[np.bool_]]  # by the share of packets that are lost


def _fold(
    recordings: list[sisfall.Recording], data: Decisions, split: folds.Split, search: Search
) -> tuple[Alarms, FallSettings]:
    """Return the held-out decisions that are alarms, and the settings."""
    train, held_out = split
    train = train[~data.stumble[train]]
    settings = chosen(
        SETTINGS,
        GRID,
        data.subject[train],
        search,
        lambda one, rows, judge: _score(data, train[rows], train[judge], one),
    )
    model = _fitted(data, train, settings)
    found = {0.0: model.alarms(data.features, data.recording, held_out)}
    for share in losses.SHARES:
        found[share] = _lossy_alarms(model, recordings, data, held_out, share)
    return found, settings


def _fitted(data: Decisions, train: folds.Rows, settings: FallSettings) -> FallDetector:
    return FallDetector(settings).fit(data.features, data.to_impact, data.recording, data.subject, train)


def _lossy_alarms(
    model: FallDetector, recordings: list[sisfall.Recording], data: Decisions, rows: folds.Rows, share: float
) -> npt.NDArray[np.bool_]:
    """Return the alarms at `rows` where so many packets are lost.

    Recording by recording, to need little memory.
    """
    number = data.recording[rows]
    alarms = np.zeros(len(rows), dtype=bool)
    for one in np.unique(number).tolist():
        own = number == one
        samples = recordings[one].samples
        lost = losses.lossy(samples, (samples.shape[1],), share, one)
        lost[0] = samples[0]
        alarms[own] = model.alarms(features(FALLING, lost, data.at[rows[own]]), number[own])
    return alarms


def _score(data: Decisions, train: folds.Rows, judge: folds.Rows, settings: FallSettings) -> float:
    """Return, for a search, the falls alarmed in time, at about the same false alarms."""
    alarmed = judge[_fitted(data, train, settings).alarms(data.features, data.recording, judge)]
    in_time = alarmed[data.to_impact[alarmed] <= IN_TIME]
    falls = judge[data.to_impact[judge] < FAR]
    return len(np.unique(data.recording[in_time])) / max(len(np.unique(data.recording[falls])), 1)


def _outcome(
    recordings: list[sisfall.Recording], by_share: dict[float, npt.NDArray[np.int_]], settings: str
) -> Outcome:
    every = {
        share: [Alarm.of(recording, int(at)) for recording, at in zip(recordings, first, strict=True)]
        for share, first in by_share.items()
    }
    rows = every[0.0]
    subjects = sorted({recording.subject for recording in recordings})
    by_subject = {
        one: _figures(
            [row for row, recording in zip(rows, recordings, strict=True) if recording.subject == one]
        )
        for one in subjects
    }
    figures = _figures(rows)
    for share in losses.SHARES:
        found = _figures(every[share])
        figures |= {losses.at(name, share): found[name] for name in LOST}
    return Outcome(figures, len(subjects), by_subject, settings=settings)


def _figures(alarms: list["Alarm"]) -> dict[str, float]:
    falls = [alarm for alarm in alarms if alarm.fall]
    daily = [alarm for alarm in alarms if not alarm.fall and not alarm.stumble]
    stumbles = [alarm for alarm in alarms if alarm.stumble]
    leads = [alarm.lead for alarm in falls if alarm.detected]
    right = sum(alarm.detected for alarm in falls) + sum(not alarm.came for alarm in daily)
    return {
        "sensitivity": _share([alarm.detected for alarm in falls]),
        "median_lead_ms": float(np.median(leads)) * MS if leads else float("nan"),
        "false_alarm_fraction": _share([alarm.came for alarm in daily]),
        "early_alarm_fraction": _share([alarm.early for alarm in falls]),
        "stumble_alarm_fraction": _share([alarm.came for alarm in stumbles]),
        "accuracy": right / max(len(falls) + len(daily), 1),
    }


def _share(flags: list[bool]) -> float:
    return sum(flags) / len(flags) if flags else float("nan")
