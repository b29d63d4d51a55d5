"""Round-trip times of one node's SDO answers, and its silence."""

import threading
from collections import deque

from drivers.findings import FindingState, active_findings
from drivers.samples import Finding

KEPT, RECENT_S = 64, 60.0  # answers that figures are made of
SILENT, SILENT_S = 3, 1.0  # requests in a row without an answer, over so long, that mean silence
PROMPT = 3  # answers in time, in a row, after which it is late no more


class RoundTrips:
    """From a request, as it is handed to the bus, to its answer. For any thread."""

    def __init__(self, timeout_s: float) -> None:
        self.late = 0  # answers that came when nobody waited for them any more
        self._timeout_s = timeout_s
        self._recent: deque[tuple[int, int]] = deque(maxlen=KEPT)  # when it was answered, and after how long
        self._silence, self._lateness = FindingState(), FindingState()
        self._unanswered, self._first_unanswered_ns = 0, 0
        self._prompt = 0
        self._lock = threading.Lock()

    def answered(self, sent_ns: int, stamp_ns: int, *, given_up: bool) -> None:
        """Take an answer of `stamp_ns`; `given_up`: nobody waited for it any more."""
        trip_ns = max(0, stamp_ns - sent_ns)
        with self._lock:
            self._recent.append((stamp_ns, trip_ns))
            self._unanswered = 0
            self._silence.clear()
            if given_up and trip_ns > self._timeout_s * 1e9:
                self.late += 1
                self._prompt = 0
                late = f"after {trip_ns / 1e6:.0f} ms, later than sdo_timeout_s = {self._timeout_s:g}"
                self._lateness.note(
                    stamp_ns,
                    f"it answers SDO {late}",
                    "raise sdo_timeout_s, or look at the load of the bus and of the device",
                )
            elif self._lateness.finding is not None:
                self._prompt += 1
                if self._prompt >= PROMPT:
                    self._lateness.clear()

    def unanswered(self, now_ns: int) -> None:
        """Note that a request was given up."""
        with self._lock:
            if self._unanswered == 0:
                self._first_unanswered_ns = now_ns
            self._unanswered += 1
            if self._unanswered >= SILENT and now_ns - self._first_unanswered_ns >= SILENT_S * 1e9:
                self._silence.note(
                    self._first_unanswered_ns,
                    f"it answers no SDO, {self._unanswered} requests in a row",
                    "is another SDO client using this channel (sdo_cob_ids)? Else switch it off and on",
                )

    def restart(self) -> None:
        """Restart with the node; counts stay."""
        with self._lock:
            self._recent.clear()
            self._unanswered = self._prompt = 0
            self._silence.clear()
            self._lateness.clear()

    def median_and_longest_ms(self, now_ns: int) -> tuple[float, float] | None:
        """Return median and longest of the last minute; `None` if nothing was answered."""
        with self._lock:
            trips = sorted(trip for stamp, trip in self._recent if now_ns - stamp <= RECENT_S * 1e9)
        return None if not trips else (trips[len(trips) // 2] / 1e6, trips[-1] / 1e6)

    @property
    def findings(self) -> tuple[Finding, ...]:
        return active_findings((self._silence, self._lateness))
