"""Stalls of a bus's reader: while it does not read, frames wait, and no node is heard.

A starved computer hands out what waited in one burst. Nobody can say then how a joint moved meanwhile, nor
that a device was silent; how old a value is, is judged all the same.
"""

from drivers.findings import FindingState

STOOD_NS = 100_000_000  # without a look at the bus; it waits half as long for a frame at most
GAP_NS = 60_000_000  # likewise: too short to miss a device, long enough for a joint to be elsewhere
EVEN_NS = 75_000_000  # after a gap what comes has come evenly again: a tick later
TOLD_S = 0.3  # shorter ones are told only where they are many
MANY = 5
SHOWN_S = 10.0
EXCUSED_NS = 1_000_000_000  # of a silence, at most
SHORTEST_SETTLING_NS, LONGEST_SETTLING_NS = 100_000_000, 1_000_000_000
CHECK = "see what keeps it busy (gwrms blame, gwrms snapshot resource), or take load from it"


class ReaderStalls(FindingState):
    """Told by the bus's thread that it ran; read by any. The last one is told for `SHOWN_S`."""

    def __init__(self) -> None:
        super().__init__()
        self.times = 0  # since it was made
        self.gap: tuple[int, int] | None = None  # the last time without a look, however short (ns)
        self._passed_ns: int | None = None  # None: nobody is to read
        self._listening_since_ns = 0
        self._settled_ns = 0
        self._began_ns, self._before_ns = 0, 0  # beginning and end of the one before
        self._row, self._longest_s = 0, 0.0  # of those that follow each other

    def closed(self) -> None:
        """Note that nobody reads any more, and nobody has to."""
        self._passed_ns = None
        self.clear()

    def passed(self, now_ns: int) -> None:
        """Note that the thread has read the bus and handed out its frames."""
        passed_ns = self._passed_ns
        if passed_ns is None:
            self._listening_since_ns = now_ns
        elif now_ns - passed_ns > GAP_NS:
            self.gap = passed_ns, now_ns
            if now_ns - passed_ns > STOOD_NS:
                self._stood(passed_ns, now_ns)
        if self.finding is not None and now_ns - self._before_ns > SHOWN_S * 1e9:
            self.clear()
        self._passed_ns = now_ns  # last: who reads meanwhile takes it for standing still, not for a silence

    def silent_ns(self, since_ns: int, now_ns: int) -> int:
        """Return for how long nothing came since `since_ns`, as far as somebody looked; 0 at least.

        What passed until the last standstill's end does not count, up to `EXCUSED_NS`: who stands still again
        and again would never miss anybody. While it stands still all counts: nobody knows then.
        """
        passed_ns = self._passed_ns
        looked_ns = now_ns if passed_ns is None or now_ns - passed_ns > STOOD_NS else passed_ns
        listened_ns = looked_ns - max(since_ns, self._listening_since_ns)
        return max(0, listened_ns, now_ns - since_ns - EXCUSED_NS)

    def until(self, now_ns: int) -> int:
        """Return the number of stalls, including a present one."""
        passed_ns = self._passed_ns
        return self.times + (passed_ns is not None and now_ns - passed_ns > STOOD_NS)

    def is_settled(self, now_ns: int) -> bool:
        """Return whether what comes now has not waited, so that its time is its own."""
        return now_ns >= self._settled_ns

    def is_even(self, now_ns: int) -> bool:
        """Return whether there is no gap between this sample and the ones before it, nor just before."""
        return self.gap is None or now_ns - self.gap[1] > EVEN_NS

    def explains(self) -> None:
        """Report the last gap, however short: it explains a problem elsewhere."""
        if self.gap is not None and self.finding is None:
            began_ns, self._before_ns = self.gap
            self.note(
                began_ns, f"this computer stood still for {(self._before_ns - began_ns) / 1e9:.2f} s", CHECK
            )

    def words(self, now_ns: int, since_ns: int | None, allowed_s: float) -> str | None:
        """Return why nothing came since `since_ns`: it stands still, or has just begun anew; what to check.

        `None` where it runs, and where nothing had come for more than `allowed_s` when it stood still: that
        has another cause, however often it stands still since.
        """
        passed_ns = self._passed_ns
        stood_ns = 0 if passed_ns is None else now_ns - passed_ns
        began_ns = now_ns - stood_ns if stood_ns > STOOD_NS else self._began_ns
        if since_ns is None or began_ns - since_ns > allowed_s * 1e9:
            return None
        if stood_ns > STOOD_NS:
            return f"this computer has stood still for {stood_ns / 1e9:.1f} s: {CHECK}"
        if not self.is_settled(now_ns):
            return f"this computer stood still until just now: {CHECK}"
        return None

    def _stood(self, passed_ns: int, now_ns: int) -> None:
        stood_ns = now_ns - passed_ns
        follows = passed_ns - self._before_ns < SHOWN_S * 1e9 and self.times > 0
        self.times += 1
        self._row = self._row + 1 if follows else 1
        self._longest_s = max(self._longest_s if follows else 0.0, stood_ns / 1e9)
        self._began_ns = passed_ns
        self._listening_since_ns = self._before_ns = now_ns
        self._settled_ns = now_ns + min(max(stood_ns // 2, SHORTEST_SETTLING_NS), LONGEST_SETTLING_NS)
        if self._longest_s >= TOLD_S or self._row >= MANY:
            self.note(passed_ns, self._told(), CHECK)

    def _told(self) -> str:
        once = f"this computer stood still for {self._longest_s:.1f} s"
        if self._row == 1:
            return once
        return f"this computer stood still {self._row} times, for up to {self._longest_s:.1f} s"
