"""(c) Each stride against this wearer's most similar ones: asymmetry, loads, lean and torque.

Stairs, ramps and turns have strides of their own; so a part of a stride is compared with the same part of
healthy strides whose other parts were similar. Without any, as on a first stride on stairs, it counts little.
"""

import math
from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import JOINTS, SIDES, Observation, or_zero, readable_name

KEPT: Final = 160  # strides of each side; newer ones replace older ones
FEWEST: Final = 14  # strides before the first comparison
NEIGHBOURS: Final = 4
FARTHEST: Final = 9.0  # squared spreads: larger differences in one number are clipped
DOUBTED: Final = 1.5  # squared spreads a number: at this distance of the neighbours a difference counts half
STALE_S: Final = 3.0
MEASURES: Final = 34
KILO: Final = 1000.0  # loads in kilonewtons are of the magnitude of angles
# The smallest difference of each number that counts (rad, N·m, shares, m), and the numbers of each part.
_LEAST: Final = np.array([0.02] * 18 + [0.5] * 6 + [0.03] * 4 + [0.003] * 2 + [0.01] * 2 + [0.03] * 2)
PARTS: Final = (
    *((f"{joint}.angle", [at, at + 6, at + 12]) for at, joint in enumerate(JOINTS)),
    *((f"{joint}.torque", [18 + at]) for at, joint in enumerate(JOINTS)),
    *((f"{side} load", [24 + at]) for at, side in enumerate(SIDES)),
    ("stance times", [26, 27]),
    ("pressure", [28, 29]),
    ("lean", [30, 31]),
    ("asymmetry", [32, 33]),
)
_IN_PART: Final = np.array(
    [[at in numbers for at in range(MEASURES)] for _, numbers in PARTS], dtype=np.float64
)
_OTHERS: Final = MEASURES - _IN_PART.sum(axis=1)


class _Side:
    """Strides of one foot, from heel strike to heel strike."""

    def __init__(self) -> None:
        self.kept = np.zeros((KEPT, MEASURES))
        self.count = 0
        self.spread = np.full(MEASURES, np.nan)  # of one stride to the next
        self._before: Floats | None = None
        self.begin()

    def begin(self) -> None:
        """Begin a stride."""
        self.samples = 0
        self._low, self._high = np.full(6, np.inf), np.full(6, -np.inf)
        self._sums = np.zeros(24)  # angles, squared torques; then load, samples and place by foot; lean

    def take(self, now: Observation) -> None:
        """Take a sample of the stride under way."""
        angle = now.joint[0]
        self.samples += 1
        np.minimum(self._low, angle, out=self._low)
        np.maximum(self._high, angle, out=self._high)
        down = [leg.down for leg in now.legs]
        self._sums[:6] += angle
        self._sums[6:12] += now.joint[2] ** 2
        self._sums[12:14] += now.foot[0] * down
        self._sums[14:16] += down
        self._sums[16:18] += or_zero(now.foot[1]) * down
        self._sums[18:20] += now.trunk[6:8]

    def stride(self) -> Floats:
        """Return the measures of the stride (MEASURES,)."""
        sums, count = self._sums, max(self.samples, 1)
        stance = np.maximum(sums[14:16], 1.0)
        reach = self._high - self._low
        load = sums[12:14] / count
        knees = self._high[[1, 4]]
        apart = [
            (reach[0] - reach[3]) / max(reach[0] + reach[3], 0.1),
            (knees[0] - knees[1]) / max(knees.sum(), 0.2),
        ]
        return np.concatenate(
            [
                self._low,
                self._high,
                sums[:6] / count,
                np.sqrt(sums[6:12] / count),
                load / KILO,
                stance / count,
                sums[16:18] / stance,
                sums[18:20] / count,
                apart,
            ]
        )

    def compare(self, stride: Floats) -> Floats:
        """Return the difference of each part from the most similar strides, in spreads; NaN where unknown."""
        if self.count < FEWEST:
            return np.full(len(PARTS), np.nan)
        kept = self.kept[: min(self.count, KEPT)]
        off = (kept - stride) / np.maximum(self.spread, _LEAST)
        square = or_zero(np.minimum(off * off, FARTHEST))
        of_part = square @ _IN_PART.T
        others = of_part.sum(axis=1, keepdims=True) - of_part
        near = np.argpartition(others, NEIGHBOURS, axis=0)[:NEIGHBOURS]
        distance = np.take_along_axis(others, near, axis=0).mean(axis=0) / _OTHERS
        found = np.empty(len(PARTS))
        for at, (_, numbers) in enumerate(PARTS):
            found[at] = np.abs(off[near[:, at]][:, numbers].mean(axis=0)).max()
        believed: Floats = found / (1.0 + (distance / DOUBTED) ** 2)
        return believed

    def learn(self, stride: Floats) -> None:
        """Keep the stride, and update the usual difference between strides."""
        if self._before is not None:
            step = np.abs(stride - self._before)
            first = np.isnan(self.spread)
            # Quicker down than up: towards the lower half, which changes of activity do not touch.
            rate = np.where(step > self.spread, 0.02, 0.04)
            self.spread = np.where(first, step, self.spread + rate * (step - self.spread))
        self._before = stride
        self.kept[self.count % KEPT] = stride
        self.count += 1


class Strides:
    """Every stride of both sides; the smaller deviation of the last two: one odd stride is ignored."""

    name = "strides"
    keys = tuple(name for name, _ in PARTS)
    least = np.full(len(PARTS), 0.5)
    needs = "both insoles, and positions of both legs"

    def __init__(self) -> None:
        self._sides = _Side(), _Side()
        self._last = [np.full(len(PARTS), np.nan), np.full(len(PARTS), np.nan)]
        self._told = np.full(len(PARTS), np.nan)
        self._told_s = -math.inf

    def measure(self, now: Observation, *, learn: bool) -> Floats:
        for side, leg in zip(self._sides, now.legs, strict=True):
            if leg.struck:
                if 0.5 < side.samples * max(now.step_s, 0.01) < STALE_S:
                    self._stride(side, now.at_s, learn=learn)
                side.begin()
            side.take(now)
        return self._told if now.at_s - self._told_s < STALE_S else np.full(len(PARTS), np.nan)

    def _stride(self, side: _Side, at_s: float, *, learn: bool) -> None:
        stride = side.stride()
        found = side.compare(stride)
        if learn and np.isfinite(stride).any():
            side.learn(or_zero(stride))
        self._last = [self._last[1], found]
        self._told, self._told_s = np.minimum(*self._last), at_s

    def words(self, key: str) -> str:
        joint, _, what = key.partition(".")
        if what:
            does = "bends" if what == "angle" else "takes a torque"
            return f"{readable_name(joint)}: {does} as in none of its own strides alike"
        if key == "asymmetry":
            return "left and right differ more than in any stride alike"
        return f"{key}: as in no stride alike"
