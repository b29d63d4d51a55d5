"""One robot watched for danger: rows in, a number, a level and reasons in words out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.danger.agreement import Agreement
from ml.danger.balance import Balance
from ml.danger.combine import Calibration
from ml.danger.creep import Creep
from ml.danger.detector import DETECTORS, Detector
from ml.danger.drift import Drift
from ml.danger.levels import Level, Levels
from ml.danger.memory import Memory, kinds
from ml.danger.now import CHANNELS, Now, or_zero
from ml.danger.rhythm import Rhythm
from ml.danger.strides import Strides
from ml.danger.support import Support
from ml.danger.torque import Torque
from ml.danger.tracking import Tracking
from ml.danger.usual import Usual

Floats = npt.NDArray[np.float64]

PERIOD_S: Final = 0.035  # rows that come sooner after another are passed over: 25 a second are enough
JUMP_S: Final = 1.0  # back: from there on the clock is another one, and what was learned is of the old
HELD_S: Final = 0.1  # a value that is older is missing
LEARNS_BELOW: Final = 15.0  # spreads above what is usual: models follow what is less
TOLD: Final = 3  # reasons
STRANGE_S: Final = 0.8  # after a moment that was like none before, some detectors cannot judge yet
COMPARE: Final = ("tracking", "torque", "strides", "support", "rhythm", "agreement")  # these
TELLING: Final = 2.0  # spreads from which on a detector is a reason


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is so at `stamp_ns` of the robot's clock.

    `number` is the probability that something has begun that does harm within 30 s; None where no detector
    speaks. `why` are the reasons, the worst first; `silent` the detectors that lack data, of `DETECTORS`.
    """

    stamp_ns: int
    number: float | None
    level: Level
    why: tuple[str, ...]
    silent: tuple[str, ...]

    @property
    def speaking(self) -> int:
        """How many detectors the number is made of."""
        return len(DETECTORS) - len(self.silent)

    @property
    def reasons(self) -> str:
        """Why, in words."""
        return "; ".join(self.why) or "several things together, none of which would tell it alone"


def detectors(memory: Memory) -> tuple[Detector, ...]:
    """Return new ones, for one robot, in the order of `DETECTORS`."""
    first = (Tracking(), Torque(), Strides(), Support(), Balance(), Rhythm(), Agreement(), Drift(), Creep())
    return *first, *kinds(memory)


class Evidence:
    """How far each detector is above what is usual on this robot, moment by moment; bounded in memory."""

    def __init__(self) -> None:
        self._memory = Memory()
        self.detectors = detectors(self._memory)
        bounds = accumulate((len(one.keys) for one in self.detectors), initial=0)
        self._parts = [slice(*pair) for pair in pairwise(bounds)]
        self._starts = np.array([part.start for part in self._parts])
        least = np.concatenate([one.least for one in self.detectors])
        self._usual = Usual(least), Usual(least)  # of somebody who stands, and who walks
        self._now = Now()
        self._compare = [at for at, one in enumerate(self.detectors) if one.name in COMPARE]
        self._strange_s = -math.inf
        self._worst = 0.0
        self.keys = np.full(self._parts[-1].stop, np.nan)

    def take(self, at_s: float, values: Floats) -> Floats:
        """Take values in the order of `CHANNELS`, NaN where missing; spreads (detectors,), likewise."""
        self._now.take(at_s, values)
        learn = self._worst < LEARNS_BELOW
        with np.errstate(invalid="ignore", over="ignore"):
            numbers = np.concatenate([one.measure(self._now, learn=learn) for one in self.detectors])
        self.keys = self._usual[self._now.walking].take(at_s, numbers, quiet=learn)
        above = np.fmax.reduceat(self.keys, self._starts)
        worst = float(np.fmax.reduce(above))
        self._worst = 0.0 if math.isnan(worst) else worst
        if not self._memory.alike:
            self._strange_s = at_s
        if at_s - self._strange_s <= STRANGE_S:
            above[self._compare] = math.nan
        return above

    def why(self, above: Floats) -> tuple[str, ...]:
        """Return the reasons of the last moment, the worst first."""
        order = np.argsort(-or_zero(above))[:TOLD].tolist()
        return tuple(self._words(at) for at in order if above[at] >= TELLING)

    def _words(self, at: int) -> str:
        own = self.keys[self._parts[at]]
        return self.detectors[at].words(self.detectors[at].keys[int(np.nanargmax(own))])


class Watch:
    """One robot; a robot that has booted, or another wearer, needs a new one."""

    def __init__(self, calibration: Calibration) -> None:
        self.verdict: Verdict | None = None
        self._calibration = calibration
        self._begin()

    def _begin(self) -> None:
        self._evidence = Evidence()
        self._levels = Levels(self._calibration.by_level)
        self._held = np.full(len(CHANNELS), np.nan)
        self._held_ns = np.zeros(len(CHANNELS), dtype=np.int64)
        self._taken_ns = -(2**62)

    def take(self, stamp_ns: int, values: Sequence[float | None]) -> Verdict | None:
        """Take a row in the order of `CHANNELS`; the verdict, where one was due.

        Where the clock has jumped back, all begins anew: else nothing was said until it is as late again.
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

    def _judged(self, stamp_ns: int, values: Floats) -> Verdict:
        above = self._evidence.take(stamp_ns / 1e9, values)
        silent = tuple(name for name, one in zip(DETECTORS, above, strict=True) if math.isnan(one))
        odds = float(self._calibration.log_odds(above))
        level = self._levels.take(stamp_ns / 1e9, odds)
        if len(silent) == len(DETECTORS):
            return Verdict(stamp_ns, None, Level.UNKNOWN, (), silent)
        if level is Level.NONE and 2 * len(silent) > len(DETECTORS):
            level = Level.UNKNOWN  # too few speak to say that nothing is wrong
        why = self._evidence.why(above) if level > Level.NONE else ()
        return Verdict(stamp_ns, float(self._calibration.probability(odds)), level, why, silent)
