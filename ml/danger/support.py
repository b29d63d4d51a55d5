"""(d) Support: the centre of pressure leaves its usual part of the sole; the feet bear too little."""

import math
from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import SIDES, STANDING, Observation, or_zero

FEWEST: Final = 12  # samples of a bin
LOADED_N: Final = 100.0  # below that a centre of pressure says little
SMOOTH: Final = 0.6
LEAST_M: Final = 0.004


class Support:
    """Centre of pressure by phase, and what both feet bear together against the weight."""

    name = "support"
    keys = (*(f"{side} {way}" for way in ("forward", "sideways") for side in SIDES), "light", "heavy")
    least = np.array([0.4, 0.4, 0.4, 0.4, 0.05, 0.1])
    needs = "an insole's force and centre of pressure"

    def __init__(self) -> None:
        self._count = np.zeros((2, 2, STANDING + 1))
        self._mean = np.zeros((2, 2, STANDING + 1))
        self._square = np.zeros((2, 2, STANDING + 1))
        self._seen = np.zeros((2, 2))
        self._weight = math.nan
        self._borne = math.nan

    def measure(self, now: Observation, *, learn: bool) -> Floats:
        bins, feet = np.array(now.bins()), np.arange(2)
        place = np.where(now.foot[0] > LOADED_N, now.foot[1:], np.nan)
        count, mean = self._count[:, feet, bins], self._mean[:, feet, bins]
        # Whoever halts puts the last foot down as it stands, and not as in a stride.
        apart = np.fmin(self._apart(place, bins), self._apart(place, np.full(2, STANDING)))
        self._seen += SMOOTH * (or_zero(apart) - self._seen)
        if learn:
            square = self._square[:, feet, bins]
            off = place - mean
            there = np.isfinite(off)
            count = count + there
            share = np.where(there, 1.0 / np.maximum(count, 1.0), 0.0)
            moved = np.where(there, off, 0.0)
            self._count[:, feet, bins] = count
            self._mean[:, feet, bins] = mean + share * moved
            self._square[:, feet, bins] = square + share * (moved * moved - square)
        told = np.where(np.isfinite(now.foot[0]) & (count >= FEWEST), self._seen, np.nan).ravel()
        return np.concatenate([told, self._bearing(float(now.foot[0].sum()), learn=learn)])

    def _apart(self, place: Floats, bins: Floats) -> Floats:
        """Return how many spreads the centres of pressure are off at these phases; NaN: not known."""
        at = slice(None), np.arange(2), bins
        spread = np.sqrt(self._square[at] + LEAST_M * LEAST_M)
        apart = np.minimum(np.abs(place - self._mean[at]) / spread, 20.0)
        return np.where(self._count[at] >= FEWEST, apart, np.nan)

    def _bearing(self, force: float, *, learn: bool) -> Floats:
        """Return by how much less, and more, than the weight both feet bear."""
        if math.isnan(force):
            return np.full(2, np.nan)
        self._borne = force if math.isnan(self._borne) else self._borne + 0.5 * (force - self._borne)
        if learn:
            known = not math.isnan(self._weight)
            self._weight = self._weight + 0.004 * (force - self._weight) if known else force
        share = self._borne / max(self._weight, 1.0) - 1.0
        return np.array([max(-share, 0.0), max(share, 0.0)])

    def words(self, key: str) -> str:
        if key in ("light", "heavy"):
            return f"the feet bear {'less' if key == 'light' else 'more'} than the body weighs"
        side, _, way = key.partition(" ")
        return f"{side} foot: the centre of pressure leaves its usual place, {way}"
