"""`ipol-danger`: what is said of healthy people who walk, stand and turn, of whom nothing is in danger."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import danger_trunk, ipol
from ml.benchmarks.danger import Judged
from ml.benchmarks.danger_trunk import Person
from ml.benchmarks.outcome import Outcome
from ml.danger.calibration import load
from ml.danger.levels import Level
from ml.danger.observation import CHANNELS, SIDES
from ml.features.gait_status import RATE_HZ

Floats = npt.NDArray[np.float64]

AXES: Final = ((0, 0, -1), (0, 1, 0), (1, 0, 0))  # forward, left, up: its x points up, its z out of the back
UPRIGHT_S: Final = 1.0  # of each trial's beginning, in which everybody stands: the sensor was put on anew
BODY_N: Final = 700.0
FORCES: Final = [CHANNELS.index(f"{side}_insole.force") for side in SIDES]
FEET: Final = (
    "with_feet…: besides, insoles that bear 700 N in all by the feet that the labels have on the ground. Real"
    " insoles tell more: this shows what walking and standing apart, and the rhythm, change."
)


def evaluate(path: Path, search: bool) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Everybody's trials one after the other, by the trunk alone and with made-up insoles."""
    trials = ipol.read(path)
    trunk, feet = (list(_judged(trials, feet=feet)) for feet in (False, True))
    groups: dict[str, dict[str, float]] = {}
    for name, judged in (("", trunk), (", with feet", feet)):
        groups |= {f"{state}{name}": _figures(judged, state) for state in ipol.STATUSES}
    advised = {one.seen.subject for one in trunk if (one.level[one.seen.healthy] >= Level.ADVICE).any()}
    figures = _figures(trunk) | {"people_with_advice": float(len(advised))}
    figures |= {f"with_feet_{name}": value for name, value in _figures(feet).items()}
    people = len({one.subject for one in trials})
    notes = (danger_trunk.NOTE, FEET)
    return Outcome(figures, people, groups, "state", settings="fixed; as shipped", notes=notes)


def _figures(judged: Sequence[Judged], state: str | None = None) -> dict[str, float]:
    rows = [one.seen.healthy & ((one.seen.label == state) | (state is None)) for one in judged]
    return danger_trunk.figures(judged, rows)


def _judged(trials: Sequence[ipol.Trial], *, feet: bool) -> Iterator[Judged]:
    calibration = load()
    for subject, own in groupby(trials, key=lambda one: one.subject):
        person = Person.of(str(subject), calibration)
        for trial in own:
            yield person.take(rows(trial, feet=feet), RATE_HZ, np.array(ipol.STATUSES)[trial.status])


def rows(trial: ipol.Trial, *, feet: bool) -> Floats:
    """Return the trial as rows of `CHANNELS`; with `feet`, as insoles would tell of it."""
    back = trial.samples[:, :6]
    found = danger_trunk.channels(danger_trunk.upright(back, back[: int(UPRIGHT_S * RATE_HZ)], AXES), RATE_HZ)
    if feet:
        down = ~np.stack(trial.in_air, axis=1)
        found[:, FORCES] = BODY_N * down / np.maximum(down.sum(axis=1, keepdims=True), 1)
    return found
