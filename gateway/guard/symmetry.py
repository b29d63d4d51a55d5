"""Left against right over some strides: at no instant do two legs do the same."""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

SLICES = 16  # of a window: it moves on by one of them at a time


@dataclass(slots=True)
class _Slice:
    """Statistics of a part of the window."""

    number: int
    low: float
    high: float
    total: float
    count: int

    def take(self, value: float) -> None:
        self.low, self.high = min(self.low, value), max(self.high, value)
        self.total += value
        self.count += 1


def _range(slices: Iterable[_Slice]) -> float:
    seen = tuple(slices)
    return max(one.high for one in seen) - min(one.low for one in seen)


def _mean(slices: Iterable[_Slice]) -> float:
    seen = tuple(slices)
    return sum(one.total for one in seen) / sum(one.count for one in seen)


_OF: Mapping[str, Callable[[Iterable[_Slice]], float]] = {"range": _range, "mean": _mean}


class Window:
    """Range or mean of the last `window_s`, in slices; a gap of more than `longest_s` begins it anew."""

    def __init__(self, of: str, window_s: float, longest_s: float) -> None:
        self.result: float | None = None  # `None` as long as not all of it was seen
        self._of = _OF[of]
        self._slice_ns = max(1, round(window_s * 1e9 / SLICES))
        self._longest_ns = round(longest_s * 1e9)
        self._slices: deque[_Slice] = deque()
        self._first = 0  # the slice in which it began
        self._stamp_ns: int | None = None

    def take(self, stamp_ns: int, value: float) -> None:
        """Take a value, not older than the last one."""
        if self._stamp_ns is None or stamp_ns - self._stamp_ns > self._longest_ns:
            self._begin(stamp_ns)
        elif stamp_ns < self._stamp_ns:
            return
        self._stamp_ns = stamp_ns
        number = stamp_ns // self._slice_ns
        if not self._slices or self._slices[-1].number != number:
            self._turn(number)
            self._slices.append(_Slice(number, value, value, 0.0, 0))
        self._slices[-1].take(value)

    def _begin(self, stamp_ns: int) -> None:
        self._slices.clear()
        self._first = stamp_ns // self._slice_ns
        self.result = None

    def _turn(self, number: int) -> None:
        """End a slice, and judge the complete ones before it."""
        while self._slices and self._slices[0].number < number - SLICES:
            self._slices.popleft()
        whole = number - self._first > SLICES and self._slices
        self.result = self._of(self._slices) if whole else None


class Asymmetry:
    """By how much the left side (part 0) is above the right one (part 1), over the same window of both."""

    def __init__(self, of: str, window_s: float, longest_s: float) -> None:
        self._sides = tuple(Window(of, window_s, longest_s) for _ in range(2))

    def after(self, part: int, stamp_ns: int, value: float) -> float | None:
        """With what is known now; `None` as long as one window is not full."""
        self._sides[part].take(stamp_ns, value)
        left, right = (side.result for side in self._sides)
        return None if left is None or right is None else left - right
