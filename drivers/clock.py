"""Relates a device's wrapping counter to the robot's clock, follows its drift, and says how sure it is.

What is received at r was taken at device time d, so r − d is the clocks' offset plus a delay that is never
negative. The smallest r − d of each second lie close to a line: its slope is the drift. A sample's time is
the line's, so the jitter of the way (USB polls, several frames in one read) does not reach the samples. A
constant delay that every frame has cannot be seen from one end, and is not in the stated uncertainty.
"""

from collections import deque
from typing import NamedTuple

SECOND_NS = 1_000_000_000
WINDOW = 60  # seconds of minima that the line is fitted to
FEWEST = 3
MOST_DRIFT = 0.05  # no counter is further off than this
RESTARTED_NS = SECOND_NS  # a counter further than this from where it should be has begun anew
STEPPED_NS = SECOND_NS // 4  # a counter that falls so far behind has stood still
UNTRUSTED = (
    2  # a counter that does so in as many seconds on end is no clock: samples are stamped on reception
)


class DeviceClock:
    """One device's counter: `ticks_per_second` nominal, wrapping at `modulus`."""

    def __init__(self, ticks_per_second: int, modulus: int) -> None:
        self.restarts = 0
        self.steps = 0  # how often it stood still for a while
        self._ticks_per_second = ticks_per_second
        self._modulus = modulus
        self._half = modulus // 2
        self._last_ticks: int | None = None
        self._last_received_ns = 0
        self._stamp_ns = 0
        self._forget()

    @property
    def drift(self) -> float:
        """The device's clock error (1e-6: it loses 1 µs a second)."""
        return self._drift

    @property
    def uncertainty_ns(self) -> int | None:
        """Uncertainty of a sample's time, without the constant delay; `None` before a second has passed."""
        return self._uncertainty_ns

    def stamp(self, ticks: int, received_ns: int) -> int | None:
        """Return the robot's time (monotonic, ns) at which the frame of `ticks` was taken.

        Never after `received_ns` and never before the stamp of the frame before. `None` for a frame that is
        older than one already seen.
        """
        if not self._advance(ticks, received_ns):
            return None
        device_ns = self._device_ns
        offset_ns = received_ns - device_ns
        predicted_ns = self._predict(device_ns)
        if offset_ns < predicted_ns:  # it came sooner than the line allows: the line was too high
            if predicted_ns - offset_ns > STEPPED_NS:
                self._minima.clear()  # they are of a way that was slow for seconds
            self._offset_ns -= predicted_ns - offset_ns
            predicted_ns = offset_ns
        self._note(offset_ns)
        stamp_ns = received_ns if self._steps_on_end >= UNTRUSTED else device_ns + predicted_ns
        self._stamp_ns = stamp_ns if stamp_ns > self._stamp_ns else self._stamp_ns + 1
        return self._stamp_ns

    def _forget(self) -> None:
        self._device_ns = 0  # since the first frame
        self._reference_ns = 0  # device time at which the line has the value `_offset_ns`
        self._offset_ns = 0
        self._drift = 0.0
        self._uncertainty_ns: int | None = None
        self._minima: deque[tuple[int, int]] = deque(maxlen=WINDOW)
        self._second = 0  # of reception
        self._steps_on_end = 0
        self._smallest: tuple[int, int] | None = None

    def _advance(self, ticks: int, received_ns: int) -> bool:
        """Move device time to `ticks`; false for a frame that is not newer than the last."""
        if self._last_ticks is None:
            self._begin(ticks, received_ns)
            return True
        elapsed_ns = received_ns - self._last_received_ns
        step = (ticks - self._last_ticks) % self._modulus
        # Whole turns of the counter that passed unseen; −1 for a frame from before the last.
        expected = elapsed_ns * self._ticks_per_second // SECOND_NS
        if abs(expected - step) > self._half:
            step += self._modulus * round((expected - step) / self._modulus)
        step_ns = step * SECOND_NS // self._ticks_per_second
        if abs(step_ns - elapsed_ns) > RESTARTED_NS:
            self.restarts += 1
            self._begin(ticks, received_ns)
            return True
        if step <= 0:
            return False
        self._device_ns += step_ns
        self._last_ticks, self._last_received_ns = ticks, received_ns
        return True

    def _begin(self, ticks: int, received_ns: int) -> None:
        self._forget()
        self._offset_ns = received_ns
        self._second = received_ns // SECOND_NS
        self._last_ticks, self._last_received_ns = ticks, received_ns

    def _predict(self, device_ns: int) -> int:
        return self._offset_ns + round(self._drift * (device_ns - self._reference_ns))

    def _note(self, offset_ns: int) -> None:
        """Keep the smallest offset of each second; at the second's end, fit the line anew."""
        second = (self._device_ns + offset_ns) // SECOND_NS
        if second != self._second and self._smallest is not None:
            if self._has_stepped(*self._smallest):
                self._minima.clear()
                self.steps += 1
                self._steps_on_end += 1
            else:
                self._steps_on_end = 0
            self._minima.append(self._smallest)
            self._second, self._smallest = second, None
            self._fit()
        if self._smallest is None or offset_ns < self._smallest[1]:
            self._smallest = (self._device_ns, offset_ns)

    def _has_stepped(self, at_ns: int, offset_ns: int) -> bool:
        """Return whether the counter stood still: a whole second in which nothing came near the line.

        If it was the way that had been slow instead, the first frame that comes sooner corrects the line.
        """
        return bool(self._minima) and offset_ns - self._predict(at_ns) > STEPPED_NS

    def _fit(self) -> None:
        count = len(self._minima)
        if count < FEWEST:
            offsets = [offset for _, offset in self._minima]
            self._offset_ns, self._reference_ns = min(offsets), self._device_ns
            self._uncertainty_ns = max(offsets) - min(offsets) + SECOND_NS // 1000
            return
        mid = sum(at for at, _ in self._minima) // count
        mean = sum(offset for _, offset in self._minima) // count
        spread = sum((at - mid) ** 2 for at, _ in self._minima)
        slope = sum((at - mid) * (offset - mean) for at, offset in self._minima) / spread
        self._drift = max(-MOST_DRIFT, min(MOST_DRIFT, slope))
        above = [offset - mean - round(self._drift * (at - mid)) for at, offset in self._minima]
        self._reference_ns, self._offset_ns = mid, mean + min(above)
        self._uncertainty_ns = max(above) - min(above)


class ClockSpec(NamedTuple):
    """Properties of a format's counter."""

    ticks_per_second: int
    modulus: int

    def make(self) -> DeviceClock:
        return DeviceClock(self.ticks_per_second, self.modulus)
