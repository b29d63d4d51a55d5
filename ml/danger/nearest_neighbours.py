"""(i) Residuals against the nearest neighbours among the robot's own healthy samples.

The joints of a sample are searched for among earlier samples; each joint's set-point and torque, each foot's
load and the trunk's lean should be as they were in the most similar ones. The search for a joint uses the
other joints alone, so that a joint which deviates is compared with samples in which it was normal. Without a
similar sample, as in the first steps on stairs, the result is NaN: a new activity changes all joints at once.
"""

import collections
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.danger.detector import Floats
from ml.danger.observation import JOINTS, SIDES, Observation, or_zero, readable_name

KEPT: Final = 1000  # samples
FEWEST: Final = 150  # samples before the first search
LOOKS: Final = 600  # 42 s of health before the first result: until then much is new, not wrong
ALIKE: Final = 5  # neighbours
NEW: Final = 0.3  # squared: a sample so far from all others is kept …
WAITS_S: Final = 10.0  # … unless something was wrong within this time
FARTHEST: Final = 4.0  # largest distance of a neighbour; beyond it the result is unknown
DOUBTED: Final = 2.0  # at this distance a residual counts half
EVERY_S: Final = 0.07  # between two samples
SMOOTH: Final = np.array([0.3] * 12 + [0.15] * 3)  # weight of the newest sample: over ¼ s, ½ s
# The scales of a joint's angle (rad) and velocity (rad/s) in a distance.
_SCALE: Final = np.array([0.08] * 6 + [0.6, 0.8, 0.6] * 2)[:, None]
_OWN: Final = np.array([*range(6), *[6] * 9])  # the search for each value

Bools = npt.NDArray[np.bool_]


class NearestNeighbours:
    """Difference of each quantity from its mean over the nearest neighbours, smoothed over half a second."""

    keys = (
        *(f"{joint}.target" for joint in JOINTS),
        *(f"{joint}.torque" for joint in JOINTS),
        *(f"{side} load" for side in SIDES),
        "lean",
    )
    least = np.array([0.01] * 6 + [0.5] * 6 + [5.0] * 2 + [0.004])  # rad, N·m, N, rad
    needs = "positions and velocities of the joints"

    def __init__(self) -> None:
        self._there: Bools = np.zeros(12, dtype=np.bool_)
        self.said = np.full(15, np.nan)
        self.alike = True  # whether the newest sample had neighbours, or could not be compared
        self._due_s = -math.inf
        self._forget()

    def _forget(self) -> None:
        self._states = np.zeros((12, KEPT))
        self._values = np.zeros((KEPT, 15))
        self._count = 0
        self._looks = 0
        self._off = np.zeros(15)
        self._waiting: collections.deque[tuple[float, Floats, Floats]] = collections.deque()
        self._source = np.random.default_rng(0)

    def measure(self, now: Observation, *, learn: bool) -> Floats:
        if not learn:
            self._waiting.clear()
        if now.at_s < self._due_s:
            return self.said
        self._due_s = now.at_s + EVERY_S
        position, velocity, torque, error = now.joint[:4]
        target = position + or_zero(error)
        values = np.concatenate([target, torque, now.foot[0], now.trunk[6:7]])
        self.alike = True
        self.said = self._asked(now.at_s, np.concatenate([target, velocity]), values, learn=learn)
        return self.said

    def _asked(self, at_s: float, state: Floats, values: Floats, *, learn: bool) -> Floats:
        there = np.isfinite(state)
        if (there & ~self._there).any():  # another robot: old samples cannot be compared
            self._there = there
            self._forget()
        if not there.any() or not (there == self._there).all():
            return np.full(15, np.nan)
        found, nearest = np.full(15, np.nan), math.inf
        state = np.where(there, state, 0.0)[:, None] / _SCALE
        if self._count >= FEWEST:
            found, nearest = self._compared(state, values)
        if self._looks < LOOKS:
            found[:] = np.nan
        self._looks += learn
        if learn and nearest > NEW:
            self._waiting.append((at_s, state, values))
        while self._waiting and at_s - self._waiting[0][0] > WAITS_S:
            self._keep(*self._waiting.popleft()[1:])
        return found

    def _compared(self, state: Floats, values: Floats) -> tuple[Floats, float]:
        apart = self._states[:, : self._count] - state
        apart *= apart
        whole = apart.sum(axis=0)
        joint = apart[:6] + apart[6:]
        search = whole - np.concatenate([joint, np.zeros((1, self._count))])
        near = np.argpartition(search, ALIKE, axis=1)[:, :ALIKE]
        distance = np.sqrt(np.maximum(np.take_along_axis(search, near, axis=1).mean(axis=1), 0.0))[_OWN]
        was = _mean(self._values[near[_OWN], np.arange(15)[:, None]])
        off = (values - was) / (1.0 + (distance / DOUBTED) ** 2)
        off[:6] *= _alone(distance[:6], self._there[:6] | self._there[6:])
        known = np.isfinite(off) & (distance < FARTHEST)
        self._off += SMOOTH * np.where(known, off - self._off, 0.0)
        found = np.abs(self._off)
        # Less load on one foot and as much more on the other is a shift of weight.
        found[12:14] = np.minimum(found[12:14], abs(self._off[12:14].sum()))
        self.alike = bool(distance[6] < FARTHEST)
        # A neighbour that lacks a value known now does not count, or the value would stay unknown for ever.
        lacks = (np.isnan(self._values[near[6]]) & np.isfinite(values)).any(axis=1)
        return np.where(known, found, np.nan), float(np.where(lacks, np.inf, search[6, near[6]]).min())

    def _keep(self, state: Floats, values: Floats) -> None:
        at = self._count if self._count < KEPT else int(self._source.integers(KEPT))
        self._states[:, at], self._values[at] = state[:, 0], values
        self._count = min(self._count + 1, KEPT)


def _mean(values: Floats) -> Floats:
    """Return the mean of each row's known values; NaN for a row without any."""
    known = np.isfinite(values)
    count = known.sum(axis=1)
    total: Floats = np.where(known, values, 0.0).sum(axis=1)
    return np.where(count, total / np.maximum(count, 1), np.nan)


def _alone(distance: Floats, there: Bools) -> Floats:
    """Return by how much each of six searches has closer neighbours than the others, 0 to 1.

    In a new activity no search finds close ones; if a single joint deviates, only the search without it does.
    Only joints that exist are compared; a single one has no others to compare: NaN.
    """
    ranked = np.sort(distance[there])
    if len(ranked) < 2:
        return np.full(6, np.nan)
    middle = (len(ranked) - 2) // 2
    others = np.where(distance <= ranked[middle], ranked[middle + 1], ranked[middle])  # their median
    share: Floats = np.maximum(1.0 - distance / np.maximum(others, 1e-9), 0.0)
    return share


class NeighbourResiduals:
    """A detector: the residuals of one quantity, such as torque; the first one updates them for all."""

    needs = NearestNeighbours.needs

    def __init__(self, name: str, neighbours: NearestNeighbours, keys: slice) -> None:
        self.name = name
        self.keys = NearestNeighbours.keys[keys]
        self.least = NearestNeighbours.least[keys]
        self._neighbours = neighbours
        self._own = keys

    def measure(self, now: Observation, *, learn: bool) -> Floats:
        """Take the next sample; the detector of the first quantity hands it to the neighbours."""
        if self._own.start == 0:
            self._neighbours.measure(now, learn=learn)
        return self._neighbours.said[self._own]

    def words(self, key: str) -> str:
        """Return the problem in words, if this key deviates most."""
        joint, _, what = key.partition(".")
        if what == "target":
            return f"{readable_name(joint)}: is led where it never is while the other joints are as they are"
        if what:
            return f"{readable_name(joint)}: takes another torque than it did for the same motion"
        if key == "lean":
            return "the trunk is told to lean otherwise than it did in the same motion"
        return f"the {key.replace(' load', ' foot')} bears another load than it did in the same motion"


def residual_detectors(neighbours: NearestNeighbours) -> tuple[NeighbourResiduals, ...]:
    """Return a detector for each quantity."""
    return tuple(NeighbourResiduals(name, neighbours, keys) for name, keys in _KINDS.items())


_KINDS: Final = {
    "set-points": slice(0, 6),
    "effort": slice(6, 12),
    "loads": slice(12, 14),
    "lean": slice(14, 15),
}
