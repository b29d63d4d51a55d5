"""Gait events of one foot from the force on its insole, by thresholds that follow load and drift."""

import collections
import statistics
from itertools import pairwise

from server_gui.core.processing.gait_events import Continuity, EventKind, Follows, GaitEvent, Leg

LAND_SHARE, LIFT_SHARE = 0.05, 0.03  # of a step's peak force: around the usual 5 % of body weight
CONFIRM_NS = 50_000_000  # a contact or swing that does not last so long is none
FIRST_PEAK_N = 600.0  # until steps have shown another
PEAKS = 5  # the peak is the median of so many steps'
BLOCK_NS, BLOCKS = 200_000_000, 20  # the last four seconds, in which a walker lifts each foot twice


class PressureEvents:
    """Heel strike and toe off of `leg`, sample by sample; the same live and over a recording.

    A foot is down from where the force passes `LAND_SHARE` of a usual step's peak to where it falls below
    `LIFT_SHARE`, counted from what the insole shows in the air (thresholds relative to the wearer's own load,
    with a minimum duration, as in Catalfamo et al. 2008, Gait & Posture 28, 420). An event is stamped where
    the line between two samples crosses the threshold, and known `CONFIRM_NS` later.
    """

    def __init__(self, leg: Leg) -> None:
        self._leg = leg
        self._down = False  # whether the foot is on the ground
        self._continuity = Continuity()
        self._last_ns, self._last = 0, 0.0
        self._crossed_ns: int | None = None  # where the present state may have ended
        self._after_gap = True
        self._floor = 0.0  # what the insole shows in the air
        self._highest = 0.0  # of this contact
        self._peaks: collections.deque[float] = collections.deque(maxlen=PEAKS)
        self._peak = FIRST_PEAK_N
        self._blocks: collections.deque[list[float]] = collections.deque(maxlen=BLOCKS)
        self._block_ends_ns = 0

    def feed(self, stamp_ns: int, force: float | None) -> GaitEvent | None:
        """Take one sample (N), None where it is missing; the event that it decides, if it does."""
        if force is None:
            return None
        follows = self._continuity.take(stamp_ns)
        if follows is Follows.OLD:
            return None
        event = None
        if follows is Follows.GAP:
            self._begin(force)
        else:
            event = self._judge(stamp_ns, force)
        self._remember(stamp_ns, force)
        self._last_ns, self._last = stamp_ns, force
        return event

    def _begin(self, force: float) -> None:
        """Restart from the first sample after a gap, without guessing events."""
        self._down = force > self._threshold(LAND_SHARE)
        self._crossed_ns, self._after_gap = None, True
        self._highest = force
        self._blocks.clear()

    def _judge(self, stamp_ns: int, force: float) -> GaitEvent | None:
        threshold = self._threshold(LIFT_SHARE if self._down else LAND_SHARE)
        if (force > threshold) == self._down:
            self._crossed_ns = None
            self._stay(force)
            return None
        if self._crossed_ns is None:
            self._crossed_ns = self._crossing_ns(stamp_ns, force, threshold)
        if stamp_ns - self._crossed_ns < CONFIRM_NS:
            return None
        return self._turn(stamp_ns, force)

    def _stay(self, force: float) -> None:
        if self._down:
            self._highest = max(self._highest, force)
        else:
            self._floor = min(self._floor, force)

    def _crossing_ns(self, stamp_ns: int, force: float, threshold: float) -> int:
        step = force - self._last
        share = (threshold - self._last) / step if step else 1.0
        return self._last_ns + round(min(max(share, 0.0), 1.0) * (stamp_ns - self._last_ns))

    def _turn(self, stamp_ns: int, force: float) -> GaitEvent:
        crossed_ns = stamp_ns if self._crossed_ns is None else self._crossed_ns
        kind = EventKind.TOE_OFF if self._down else EventKind.HEEL_STRIKE
        event = GaitEvent(self._leg, kind, crossed_ns, stamp_ns, self._after_gap)
        if self._down:
            self._peaks.append(self._highest - self._floor)
            self._peak = statistics.median(self._peaks)
            self._floor = force
        self._down, self._highest = not self._down, force
        self._crossed_ns, self._after_gap = None, False
        self._blocks.clear()
        return event

    def _threshold(self, share: float) -> float:
        return self._floor + share * self._peak

    def _remember(self, stamp_ns: int, force: float) -> None:
        """Extremes of the last seconds, by which lost thresholds are found again."""
        if stamp_ns >= self._block_ends_ns or not self._blocks:
            self._find_again(force)
            self._blocks.append([force, force])
            self._block_ends_ns = stamp_ns + BLOCK_NS
        block = self._blocks[-1]
        block[0], block[1] = min(block[0], force), max(block[1], force)

    def _find_again(self, force: float) -> None:
        """Follow the foot if drift has left the thresholds outside of what a stepping foot shows."""
        if len(self._blocks) < BLOCKS:
            return
        low, high = min(block[0] for block in self._blocks), max(block[1] for block in self._blocks)
        outside = low > self._threshold(LIFT_SHARE) or high < self._threshold(LAND_SHARE)
        unloaded = [block[1] < low + (high - low) / 4 for block in self._blocks]
        if outside and high - low > self._peak / 2 and sum(b > a for a, b in pairwise(unloaded)) >= 2:
            self._floor = low
            self._begin(force)
