"""Comparison of a joint with the same joint of the other leg, in gait, where both move far."""

import math

from drivers.findings import FindingState

GAIT_S = 10.0
LEAST_SPEED = 0.3  # rad/s on average over that time, of both joints
LEAST_RANGE = 0.3  # rad
LIKE = 1.6  # by which the ranges of left and right may differ
ONE_SIDED = 0.3  # of its range: how far from 0 a joint's middle must be to have a side
WINDOWS = 2  # in a row
LONGEST_STEP_S = 0.1  # between two samples of one window


class MirrorCheck(FindingState):
    """Watches a joint against the same one of the other leg: in gait both bend the same way."""

    def __init__(self, name: str, other: str) -> None:
        super().__init__()
        self._names = name, other
        self.restart()

    def restart(self) -> None:
        self.clear()
        self._own, self._others = _Range(), _Range()
        self._began_ns: int | None = None
        self._last_ns = 0
        self._wrong = 0  # windows in a row

    def update(self, stamp_ns: int, position: float, other: float) -> None:
        """Both joints' positions (rad) at about the same time."""
        if self._began_ns is None or stamp_ns - self._last_ns > LONGEST_STEP_S * 1e9:
            self._begin(stamp_ns)
        self._last_ns = stamp_ns
        self._own.add(position)
        self._others.add(other)
        if self._began_ns is not None and stamp_ns - self._began_ns >= GAIT_S * 1e9:
            self._judge(stamp_ns)
            self._begin(stamp_ns)

    def _begin(self, stamp_ns: int) -> None:
        self._began_ns = stamp_ns
        self._own, self._others = _Range(), _Range()

    def _judge(self, stamp_ns: int) -> None:
        own, other = self._own, self._others
        if not (own.walks and other.walks) or not 1 / LIKE <= own.size / other.size <= LIKE:
            return
        if own.side * other.side > 0.0:
            self._wrong = 0
            self.clear()
        elif own.side * other.side < 0.0:
            self._wrong += 1
        if self._wrong >= WINDOWS:
            name, other_name = self._names
            self.note(
                stamp_ns,
                f"it bends where {other_name} stretches",
                f"check direction and zero_offset in [joint.{name}] and [joint.{other_name}]",
            )


class _Range:
    """Range and total travel of a joint."""

    def __init__(self) -> None:
        self._low, self._high, self._path = math.inf, -math.inf, 0.0
        self._last: float | None = None

    def add(self, position: float) -> None:
        self._low, self._high = min(self._low, position), max(self._high, position)
        self._path += 0.0 if self._last is None else abs(position - self._last)
        self._last = position

    @property
    def size(self) -> float:
        return self._high - self._low

    @property
    def walks(self) -> bool:
        return self.size >= LEAST_RANGE and self._path >= LEAST_SPEED * GAIT_S

    @property
    def side(self) -> int:
        """1 where it moves above 0, -1 below, 0 on both sides alike."""
        middle = (self._low + self._high) / 2
        return 0 if abs(middle) < ONE_SIDED * self.size else (1 if middle > 0.0 else -1)
