"""(a) Tracking: each joint's following error and angle against its own mean at this phase of the stride."""

from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import JOINTS, STANDING, Observation, readable_name

FEWEST: Final = 15  # samples of a bin before it is judged
FOLLOWS: Final = np.array([[0.0], [0.3]])  # of a sample: an angle is compared with the last strides
SMOOTH: Final = 0.6  # of the newest sample
LEAST: Final = np.array([[0.004], [0.05]])  # rad: the smallest spreads of following errors and angles
POSITION, ERROR = 0, 3  # rows of Observation.joint
LEG: Final = np.array([0, 0, 0, 1, 1, 1])
JOINT: Final = np.arange(6)


class Tracking:
    """Mean and spread by twentieths of the stride; a leg that does not step has a bin of its own."""

    name = "tracking"
    keys = (*(f"{joint}.error" for joint in JOINTS), *(f"{joint}.angle" for joint in JOINTS))
    least = np.full(12, 0.4)
    needs = "following_error or position of a joint"

    def __init__(self) -> None:
        self._count = np.zeros((2, 6, STANDING + 1))
        self._mean = np.zeros((2, 6, STANDING + 1))
        self._square = np.zeros((2, 6, STANDING + 1))
        self._seen = np.zeros((2, 6))

    def measure(self, now: Observation, *, learn: bool) -> Floats:
        bins = np.array(now.bins())[LEG]
        values = now.joint[[ERROR, POSITION]]
        count, mean = self._count[:, JOINT, bins], self._mean[:, JOINT, bins]
        square = self._square[:, JOINT, bins]
        off = values - mean
        apart = np.abs(off) / np.sqrt(square + LEAST * LEAST)
        told = np.where(np.isfinite(apart), np.minimum(apart, 20.0), self._seen)
        self._seen += SMOOTH * (told - self._seen)
        if learn:
            self._learn(bins, values, off, count)
        found: Floats = np.where((count >= FEWEST) & np.isfinite(values), self._seen, np.nan).ravel()
        return found

    def _learn(self, bins: Floats, values: Floats, off: Floats, count: Floats) -> None:
        more = np.isfinite(values)
        count = np.minimum(count + more, 20_000.0)
        share = np.where(more, 1.0 / np.maximum(count, 1.0), 0.0)
        follow = np.where(more, np.maximum(share, FOLLOWS), 0.0)
        off = np.where(more, off, 0.0)
        self._count[:, JOINT, bins] = count
        self._mean[:, JOINT, bins] += follow * off
        square = self._square[:, JOINT, bins]
        self._square[:, JOINT, bins] = square + share * (off * off - square)

    def words(self, key: str) -> str:
        joint, _, what = key.partition(".")
        if what == "error":
            return f"{readable_name(joint)}: does not follow its set-point as it does at this phase"
        return f"{readable_name(joint)}: is at an angle where it never is at this phase"
