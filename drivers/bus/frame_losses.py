"""Losses among frames that come at a steady rate, from the arrival times of the others."""

from collections import deque
from itertools import pairwise

from drivers.findings import FindingState

KEPT = 256  # frames
FEWEST = 32  # that say something
STEADY_SHARE = 0.5  # of the gaps must be about as long as the usual one; else there is no pace
LOOK_S = 1.0
MANY, FEW = 0.05, 0.02  # share of missing frames from which it is told, and below which no more
LOOKS = 2  # in a row


class FrameLosses(FindingState):
    """Losses of one frame. The hot path does no more than `stamps.append`; judgement is once a second."""

    def __init__(self) -> None:
        super().__init__()
        self.stamps: deque[int] = deque(maxlen=KEPT)  # ns
        self.missing: float | None = None  # share of those that were due; None: not known
        self._looked_ns = 0
        self._looks = 0  # in a row that say otherwise than what is told

    def restart(self) -> None:
        """Forget the time before a restart."""
        self.clear()
        self.stamps.clear()
        self.missing, self._looks = None, 0

    def skip(self) -> None:
        """Restart the count after frames have waited; findings stay."""
        self.stamps.clear()

    def excuse(self, began_ns: int, ended_ns: int) -> None:
        """Excuse frames without a stamp of a time when nobody read; all others count as missing.

        Where stamps lie in between they are the frames' own, as a socket's: then nothing is to be excused.
        """
        known = list(self.stamps)
        around = [
            place
            for place, (before, after) in enumerate(pairwise(known))
            if before < ended_ns and after > began_ns
        ]
        if len(known) < 3 or not around:
            return
        place = max(around, key=lambda one: known[one + 1] - known[one])
        usual = sorted(later - earlier for earlier, later in pairwise(known))[(len(known) - 1) // 2]
        if any(began_ns + usual / 2 < stamp < ended_ns - usual / 2 for stamp in known):
            return
        excess = min(known[place + 1] - known[place] - usual, ended_ns - began_ns)
        if excess > usual / 2:
            self.stamps.clear()
            self.stamps.extend([*(stamp + excess for stamp in known[: place + 1]), *known[place + 1 :]])

    def look(self, now_ns: int) -> None:
        """Judge what came until now; in the thread that appends."""
        if now_ns - self._looked_ns < LOOK_S * 1e9:
            return
        self._looked_ns = now_ns
        self.missing = missing_share(self.stamps)
        if self.missing is None:
            return
        is_told = self.finding is not None
        says_otherwise = self.missing < FEW if is_told else self.missing >= MANY
        self._looks = self._looks + 1 if says_otherwise else 0
        if self._looks >= LOOKS and is_told:
            self.clear()
            self._looks = 0
        elif self._looks >= LOOKS or (is_told and self.missing >= FEW):
            self._looks = 0
            self.note(
                now_ns,
                f"{100 * self.missing:.0f} % of its PDOs are missing",
                "check its cable and connectors, the load of the bus, and whether SYNC comes evenly",
            )


def missing_share(stamps: deque[int]) -> float | None:
    """Return the share of frames that are missing between the first and the last stamp.

    `None` without a pace.
    """
    known = list(stamps)
    gaps = [later - earlier for earlier, later in pairwise(known)]
    if len(gaps) < FEWEST:
        return None
    usual = sorted(gaps)[len(gaps) // 2]
    steady = sum(usual / 2 < gap < usual * 1.5 for gap in gaps)
    if usual <= 0 or steady < STEADY_SHARE * len(gaps):
        return None
    due = max(len(gaps), round((known[-1] - known[0]) / _mean(gaps, usual)))
    return 1 - len(gaps) / due


def _mean(gaps: list[int], usual: int) -> float:
    """Return the pace: the mean of the gaps between two frames that are neighbours."""
    near = [gap for gap in gaps if usual / 2 < gap < usual * 1.5]
    return sum(near) / len(near)
