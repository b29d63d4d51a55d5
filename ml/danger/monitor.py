"""Monitoring of one robot for danger: rows in; a probability, a level and reasons in words out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.danger.balance import Balance
from ml.danger.baseline import Baseline
from ml.danger.calibration import Calibration
from ml.danger.detector import DETECTORS, Detector
from ml.danger.encoder_slip import EncoderSlip
from ml.danger.levels import Level, Levels
from ml.danger.nearest_neighbours import NearestNeighbours, residual_detectors
from ml.danger.observation import CHANNELS, Observation, or_zero
from ml.danger.overheating import Overheating
from ml.danger.sensor_consistency import SensorConsistency
from ml.danger.step_timing import StepTiming
from ml.danger.strides import Strides
from ml.danger.support import Support
from ml.danger.torque import Torque
from ml.danger.tracking import Tracking

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

PERIOD_S: Final = 0.035  # rows that come sooner after another are skipped: 25 a second are enough
JUMP_S: Final = 1.0  # a clock set back by more is a new clock, and the model starts anew
HELD_S: Final = 0.1  # an older value is missing
LEARNS_BELOW: Final = 15.0  # spreads above normal: the models follow smaller deviations
TOLD: Final = 3  # reasons
STRANGE_S: Final = 0.8  # for so long after a sample without neighbours, these detectors cannot judge
COMPARE: Final = ("tracking", "torque", "strides", "support", "rhythm", "agreement")
HARM_S: Final = 30.0  # within which what has begun does harm; so long a level is not over unseen
WATCHED: Final = np.r_[0:24, 30:32]  # joints but their temperatures, and loads: they come with every row
TELLING: Final = 2.0  # spreads from which on a detector is a reason


@dataclass(frozen=True, slots=True)
class DangerVerdict:
    """The state at `stamp_ns` of the robot's clock.

    `number` is the probability of harm within 30 s from something that has already begun; None if no detector
    has data. `why` are the reasons, the worst first; `silent` are those of `DETECTORS` without data.
    """

    stamp_ns: int
    number: float | None
    level: Level
    why: tuple[str, ...]
    silent: tuple[str, ...]

    @property
    def speaking(self) -> int:
        """The number of detectors with data."""
        return len(DETECTORS) - len(self.silent)

    @property
    def reasons(self) -> str:
        """The reasons in words."""
        return "; ".join(self.why) or "several things together, none of which would tell it alone"


def detectors(neighbours: NearestNeighbours) -> tuple[Detector, ...]:
    """Return new detectors for one robot, in the order of `DETECTORS`."""
    first = (
        Tracking(),
        Torque(),
        Strides(),
        Support(),
        Balance(),
        StepTiming(),
        SensorConsistency(),
        Overheating(),
        EncoderSlip(),
    )
    return *first, *residual_detectors(neighbours)


class Evidence:
    """Deviation of each detector from this robot's normal range, sample by sample; bounded in memory."""

    def __init__(self) -> None:
        self._neighbours = NearestNeighbours()
        self.detectors = detectors(self._neighbours)
        bounds = accumulate((len(one.keys) for one in self.detectors), initial=0)
        self._parts = [slice(*pair) for pair in pairwise(bounds)]
        self._starts = np.array([part.start for part in self._parts])
        least = np.concatenate([one.least for one in self.detectors])
        self._baseline = Baseline(least), Baseline(least)  # of standing, and of walking
        self._now = Observation()
        self._compare = [at for at, one in enumerate(self.detectors) if one.name in COMPARE]
        self._strange_s = -math.inf
        self._worst = 0.0
        self.keys = np.full(self._parts[-1].stop, np.nan)

    def take(self, at_s: float, values: Floats) -> Floats:
        """Take values in the order of `CHANNELS`, NaN if missing; return spreads (detectors,), likewise."""
        self._now.take(at_s, values)
        learn = self._worst < LEARNS_BELOW
        with np.errstate(invalid="ignore", over="ignore"):
            numbers = np.concatenate([one.measure(self._now, learn=learn) for one in self.detectors])
        self.keys = self._baseline[self._now.walking].take(at_s, numbers, quiet=learn)
        above = np.fmax.reduceat(self.keys, self._starts)
        worst = float(np.fmax.reduce(above))
        self._worst = 0.0 if math.isnan(worst) else worst
        if not self._neighbours.alike:
            self._strange_s = at_s
        if at_s - self._strange_s <= STRANGE_S:
            above[self._compare] = math.nan
        return above

    def why(self, above: Floats) -> tuple[str, ...]:
        """Return the reasons of the last sample, the worst first."""
        order = np.argsort(-or_zero(above))[:TOLD].tolist()
        return tuple(self._words(at) for at in order if above[at] >= TELLING)

    def _words(self, at: int) -> str:
        own = self.keys[self._parts[at]]
        return self.detectors[at].words(self.detectors[at].keys[int(np.nanargmax(own))])


class DangerMonitor:
    """Monitor of one robot; a reboot or another wearer needs a new one."""

    def __init__(self, calibration: Calibration) -> None:
        self.verdict: DangerVerdict | None = None
        self._calibration = calibration
        self._begin()

    def _begin(self) -> None:
        self._evidence = Evidence()
        self._levels = Levels(self._calibration.by_level)
        self._held = np.full(len(CHANNELS), np.nan)
        self._held_ns = np.zeros(len(CHANNELS), dtype=np.int64)
        self._taken_ns = -(2**62)
        self._met: dict[Level, tuple[Bools, float]] = {}  # channels that were there then; how long it lasts

    def take(self, stamp_ns: int, values: Sequence[float | None]) -> DangerVerdict | None:
        """Take a row in the order of `CHANNELS`; return the verdict if one was due.

        If the clock has jumped back, the monitor starts anew, or it would be silent until the old time.
        """
        if self._taken_ns - stamp_ns > JUMP_S * 1e9:
            self._begin()
        row = np.array(values, dtype=np.float64)  # None becomes NaN
        there = np.isfinite(row)
        row[~there] = np.nan
        self._held[there] = row[there]
        self._held_ns[there] = stamp_ns
        if stamp_ns - self._taken_ns < PERIOD_S * 1e9:
            return None
        self._taken_ns = stamp_ns
        fresh = np.where(stamp_ns - self._held_ns <= HELD_S * 1e9, self._held, np.nan)
        fresh[32:36] = row[32:36]  # a centre of pressure is unknown while its foot is in the air
        self.verdict = self._judged(stamp_ns, fresh)
        return self.verdict

    def _judged(self, stamp_ns: int, values: Floats) -> DangerVerdict:
        above = self._evidence.take(stamp_ns / 1e9, values)
        silent = tuple(name for name, one in zip(DETECTORS, above, strict=True) if math.isnan(one))
        odds = float(self._calibration.log_odds(above))
        level = self._unless_blind(self._levels.take(stamp_ns / 1e9, odds), stamp_ns / 1e9, values)
        if len(silent) == len(DETECTORS):
            return DangerVerdict(stamp_ns, None, Level.UNKNOWN, (), silent)
        if level is Level.NONE and 2 * len(silent) > len(DETECTORS):
            level = Level.UNKNOWN  # too few detectors have data to rule danger out
        why = self._evidence.why(above) if level > Level.NONE else ()
        return DangerVerdict(stamp_ns, float(self._calibration.probability(odds)), level, why, silent)

    def _unless_blind(self, level: Level, at_s: float, values: Floats) -> Level:
        """Return the level; UNKNOWN where it would fall only because what has raised it is not seen.

        A lower one that what is still seen gives is told.
        """
        there = np.isfinite(values[WATCHED])
        is_met = self._levels.is_met
        if is_met:
            self._met[level] = there, at_s + HARM_S
        higher = [met for one, met in self._met.items() if one > level]
        if any(at_s < until_s and bool((seen_by & ~there).any()) for seen_by, until_s in higher):
            return level if level > Level.NONE and is_met else Level.UNKNOWN
        if higher:
            self._met = {one: met for one, met in self._met.items() if one <= level}
        return level
