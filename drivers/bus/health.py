"""Health of a bus: its load, error frames and controller state, checked once a second.

For each frame the bus only counts. What is told here is of the time for which somebody has the bus open.
"""

from collections import deque
from collections.abc import Callable

from drivers.bus.interfaces.controller_state import BusState, bus_state
from drivers.findings import FindingState, active_findings
from drivers.samples import Finding

LOOK_S = 1.0
FRAME_BITS, BYTE_BITS = 49.5, 8.6  # of an 11-bit data frame with its gap, and of a byte: average stuff bits
BUSY, BUSY_NO_MORE = 80.0, 70.0  # % of its time
ERROR_LOOKS, MANY_ERRORS = 10, 5  # so many error frames within so many looks are told

_WIRE = "check termination, wiring and bitrate"
STATE_WORDS = {
    BusState.WARNING: "the CAN controller counts many errors",
    BusState.PASSIVE: "the CAN controller is error passive",
    BusState.OFF: "the CAN controller is bus off, no frame can pass",
}


def bits_per_s(frames_per_s: float, bytes_per_s: float) -> float:
    """Return the bus time of frames with so many bytes of data, in bits."""
    return FRAME_BITS * frames_per_s + BYTE_BITS * bytes_per_s


class BusHealth:
    """Written by the bus's thread, read by any; the counters are since it was made."""

    def __init__(self, bitrate: int | None) -> None:
        self.state = BusState.ACTIVE  # as the controller's error frames say, where the interface has them
        self.error_frames = 0
        self.bus_offs = 0
        self.load_percent: float | None = None  # of the last second; None: bitrate or time not known
        self.frames_per_s: float | None = None
        self._bitrate = bitrate
        self._state, self._load, self._errors, self._lost = (
            FindingState(),
            FindingState(),
            FindingState(),
            FindingState(),
        )
        self._before: tuple[int, int, int, int] | None = None
        self._errors_before = 0
        self._recent_errors: deque[int] = deque(maxlen=ERROR_LOOKS)

    @property
    def state_text(self) -> str | None:
        """The controller's report on the wire, and what to check; `None` if nothing is wrong."""
        words = STATE_WORDS.get(self.state)
        return None if words is None else f"{words}: {_WIRE}"

    @property
    def findings(self) -> tuple[Finding, ...]:
        return active_findings((self._state, self._load, self._errors, self._lost))

    def opened(self) -> None:
        """Restart all measurements with the controller."""
        self.state = BusState.ACTIVE
        self.load_percent = self.frames_per_s = self._before = None
        self._errors_before = self.error_frames
        self._recent_errors.clear()
        for noted in (self._state, self._load, self._errors, self._lost):
            noted.clear()

    def take_error(self, stamp_ns: int, can_id: int, data: bytes) -> None:
        """Take an error frame: of the wire, or of our controller's state."""
        state = bus_state(can_id, data)
        if state is None:
            self.error_frames += 1
            return
        if state is BusState.OFF and self.state is not BusState.OFF:
            self.bus_offs += 1
        self.state = state
        words = STATE_WORDS.get(state)
        if words is None:
            self._state.clear()
        else:
            self._state.note(stamp_ns, words, _WIRE)

    def look(self, now_ns: int, counts: Callable[[], tuple[int, int, int]]) -> None:
        """Take frames and data bytes on the bus, and frames that were lost, since it opened."""
        before = self._before
        if before is not None and now_ns - before[0] < LOOK_S * 1e9:
            return
        frames, data_bytes, dropped = counts()
        self._before = now_ns, frames, data_bytes, dropped
        if before is None:
            return
        seconds = (now_ns - before[0]) / 1e9
        self.frames_per_s = (frames - before[1]) / seconds
        self._judge_load(now_ns, bits_per_s(self.frames_per_s, (data_bytes - before[2]) / seconds))
        self._judge_errors(now_ns)
        self._judge_lost(now_ns, dropped - before[3])

    def _judge_load(self, now_ns: int, bits_per_s: float) -> None:
        if self._bitrate is None:
            return
        load = self.load_percent = 100 * bits_per_s / self._bitrate
        if load < BUSY_NO_MORE:
            self._load.clear()
        elif load >= BUSY or self._load.finding is not None:
            self._load.note(
                now_ns,
                f"{min(load, 100.0):.0f} % of its time is taken",
                "send fewer PDOs, or SYNC less often; find what sends so much (candump)",
            )

    def _judge_errors(self, now_ns: int) -> None:
        self._recent_errors.append(self.error_frames - self._errors_before)
        self._errors_before = self.error_frames
        count = sum(self._recent_errors)
        if count >= MANY_ERRORS or (count and self._errors.finding is not None):
            words = f"{count} error frames in the last {len(self._recent_errors) * LOOK_S:.0f} s"
            self._errors.note(now_ns, words, f"{_WIRE}, and for a device that disturbs")
        else:
            self._errors.clear()

    def _judge_lost(self, now_ns: int, lost: int) -> None:
        if lost > 0:
            self._lost.note(
                now_ns, f"{lost} frames were lost on their way to us", "look what keeps this computer busy"
            )
        else:
            self._lost.clear()
