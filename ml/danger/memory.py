"""(i) One thing that leaves what all others say: the robot's own moments, remembered, as its healthy model.

A moment's joints are looked up among those of before; what a joint's set-point, torque, a foot's load and the
trunk's lean were then, they should be now. A joint is looked up by the other joints alone, so that one which
goes its own way finds the moments in which it should be elsewhere. Where no
moment was alike, as in the first steps of stairs, nothing is said: a new activity changes all joints at once.
"""

import collections
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.danger.detector import Floats
from ml.danger.now import JOINTS, SIDES, Now, or_zero, spoken

KEPT: Final = 1000  # moments
FEWEST: Final = 150  # moments, before one is looked up
LOOKS: Final = 600  # 42 s of health, till anything is told: much is new before, not wrong
ALIKE: Final = 5  # moments that are asked
NEW: Final = 0.3  # squared: a moment that is so far from all others is remembered …
WAITS_S: Final = 10.0  # … unless something was wrong by so much later
FARTHEST: Final = 4.0  # from moments alike: beyond that nobody can say
DOUBTED: Final = 2.0  # at such a distance half is believed
EVERY_S: Final = 0.07  # between two moments
SMOOTH: Final = np.array([0.3] * 12 + [0.15] * 3)  # of the newest moment: over a quarter, and half a second
# What makes a joint's angle (rad) and velocity (rad/s) another one.
_SCALE: Final = np.array([0.08] * 6 + [0.6, 0.8, 0.6] * 2)[:, None]
_OWN: Final = np.array([*range(6), *[6] * 9])  # which search answers for which value

Bools = npt.NDArray[np.bool_]


class Memory:
    """How far each thing is from what it was in the moments alike, over half a second."""

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
        self.alike = True  # whether there were moments like this one, as far as anybody can say
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

    def measure(self, now: Now, *, learn: bool) -> Floats:
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
        if (there & ~self._there).any():  # another robot than before: nothing can be compared
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
        # What one foot bears less and the other more is a weight that was shifted.
        found[12:14] = np.minimum(found[12:14], abs(self._off[12:14].sum()))
        self.alike = bool(distance[6] < FARTHEST)
        # One that lacks what is known now does not stand for it: else what was missing once stays unknown.
        lacks = (np.isnan(self._values[near[6]]) & np.isfinite(values)).any(axis=1)
        return np.where(known, found, np.nan), float(np.where(lacks, np.inf, search[6, near[6]]).min())

    def _keep(self, state: Floats, values: Floats) -> None:
        at = self._count if self._count < KEPT else int(self._source.integers(KEPT))
        self._states[:, at], self._values[at] = state[:, 0], values
        self._count = min(self._count + 1, KEPT)


def _mean(values: Floats) -> Floats:
    """Of each row, of what is known there; NaN where nothing is."""
    known = np.isfinite(values)
    count = known.sum(axis=1)
    total: Floats = np.where(known, values, 0.0).sum(axis=1)
    return np.where(count, total / np.maximum(count, 1), np.nan)


def _alone(distance: Floats, there: Bools) -> Floats:
    """How far each of six searches found moments more alike than the others, 0 to 1: its joint spoils theirs.

    In a new activity all joints are new; one that is led astray is what the others cannot find. Only joints
    that are there are asked; a single one has no others, and nobody can say: NaN.
    """
    ranked = np.sort(distance[there])
    if len(ranked) < 2:
        return np.full(6, np.nan)
    middle = (len(ranked) - 2) // 2
    others = np.where(distance <= ranked[middle], ranked[middle + 1], ranked[middle])  # their median
    share: Floats = np.maximum(1.0 - distance / np.maximum(others, 1e-9), 0.0)
    return share


class Kind:
    """A detector: what the memory says of things of one kind, whose first asks it."""

    needs = Memory.needs

    def __init__(self, name: str, memory: Memory, keys: slice) -> None:
        self.name = name
        self.keys = Memory.keys[keys]
        self.least = Memory.least[keys]
        self._memory = memory
        self._own = keys

    def measure(self, now: Now, *, learn: bool) -> Floats:
        """Take the next sample; the memory takes it from the first of all kinds."""
        if self._own.start == 0:
            self._memory.measure(now, learn=learn)
        return self._memory.said[self._own]

    def words(self, key: str) -> str:
        """Say what is wrong where this key is the worst."""
        joint, _, what = key.partition(".")
        if what == "target":
            return f"{spoken(joint)}: is led where it never is while the other joints are as they are"
        if what:
            return f"{spoken(joint)}: takes another torque than it did for the same motion"
        if key == "lean":
            return "the trunk is told to lean otherwise than it did in the same motion"
        return f"the {key.replace(' load', ' foot')} bears another load than it did in the same motion"


def kinds(memory: Memory) -> tuple[Kind, ...]:
    """All that a memory says, each kind as a detector."""
    return tuple(Kind(name, memory, keys) for name, keys in _KINDS.items())


_KINDS: Final = {
    "set-points": slice(0, 6),
    "effort": slice(6, 12),
    "loads": slice(12, 14),
    "lean": slice(14, 15),
}
