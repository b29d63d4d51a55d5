"""Gait events of both feet from hip and knee angles: where the foot is, before and behind the hip."""

import collections
import math
import statistics

from server_gui.core.processing.gait_events import Continuity, EventKind, Follows, GaitEvent, Leg

STRIKE_AFTER_NS, OFF_BEFORE_NS = 60_000_000, 40_000_000  # contact and lift-off against the extremes
TURN_SHARE, TURN_LEAST = 0.08, 0.03  # of the usual excursion, in leg lengths: then an extreme is behind us
FIRST_EXCURSION = 0.3  # leg lengths, until steps have shown another
APART = 0.12  # leg lengths between the feet: closer together, nobody steps


class KinematicEvents:
    """Heel strike and toe off of both legs from their joints' angles (rad, flexion positive).

    A foot strikes where it is farthest before the hip and leaves where it is farthest behind (Zeni, Richards
    & Higginson 2008, Gait & Posture 27, 710), here in leg lengths with thigh and shank alike; the constant
    difference between these extremes and contact is taken out. Both feet must be apart at that moment, so
    that sitting down, where they move together, is no step. Known as soon as the foot has turned back by
    `TURN_SHARE` of its usual way.
    """

    def __init__(self) -> None:
        self._ways = {Leg.LEFT: _Way(Leg.LEFT), Leg.RIGHT: _Way(Leg.RIGHT)}
        self._continuity = Continuity()

    def feed(
        self, stamp_ns: int, left: tuple[float, float], right: tuple[float, float], trunk: float = 0.0
    ) -> list[GaitEvent]:
        """Hip and knee of each leg at one moment; `trunk` leans forward."""
        follows = self._continuity.take(stamp_ns)
        if follows is Follows.OLD:
            return []
        if follows is Follows.GAP:
            for way in self._ways.values():
                way.restart()
        feet = foot_forward(*left, trunk), foot_forward(*right, trunk)
        apart = feet[0] - feet[1]
        found = (
            self._ways[Leg.LEFT].feed(stamp_ns, feet[0], apart),
            self._ways[Leg.RIGHT].feed(stamp_ns, feet[1], -apart),
        )
        return [event for event in found if event is not None]


def foot_forward(hip: float, knee: float, trunk: float) -> float:
    """Return how far the ankle is before the hip, in leg lengths; `hip` is against the trunk, which leans."""
    thigh = hip - trunk
    return 0.5 * (math.sin(thigh) + math.sin(thigh - knee))


class _Way:
    """The way of one foot, forward and back."""

    def __init__(self, leg: Leg) -> None:
        self._leg = leg
        self._excursions: collections.deque[float] = collections.deque(maxlen=4)
        self._turn = max(TURN_LEAST, TURN_SHARE * FIRST_EXCURSION)
        self.restart()

    def restart(self) -> None:
        """Restart after a gap: what was seen before does not belong to what comes."""
        self._seek = 0.0  # 1: the foot goes forward, −1: back, 0: not known yet
        self._extreme, self._extreme_ns, self._apart = 0.0, 0, 0.0
        self._before: float | None = None  # the extreme before, on the other end
        self._after_gap = True

    def feed(self, stamp_ns: int, forward: float, apart: float) -> GaitEvent | None:
        """`apart` is how far this foot is before the other one."""
        if not self._seek:
            self._seek = 1.0
            self._move(stamp_ns, forward, apart)
        beyond = (forward - self._extreme) * self._seek
        if beyond > 0.0:
            self._move(stamp_ns, forward, apart)
        elif beyond < -self._turn:
            return self._turned(stamp_ns, forward, apart)
        return None

    def _move(self, stamp_ns: int, forward: float, apart: float) -> None:
        self._extreme, self._extreme_ns, self._apart = forward, stamp_ns, apart

    def _turned(self, stamp_ns: int, forward: float, apart: float) -> GaitEvent | None:
        event = self._event(stamp_ns) if self._apart * self._seek > APART else None
        self._before = self._extreme
        self._seek = -self._seek
        self._move(stamp_ns, forward, apart)
        return event

    def _event(self, now_ns: int) -> GaitEvent:
        if self._before is not None:
            self._excursions.append(abs(self._extreme - self._before))
            self._turn = max(TURN_LEAST, TURN_SHARE * statistics.median(self._excursions))
        strikes = self._seek > 0.0
        kind = EventKind.HEEL_STRIKE if strikes else EventKind.TOE_OFF
        stamp_ns = self._extreme_ns + (STRIKE_AFTER_NS if strikes else -OFF_BEFORE_NS)
        after_gap, self._after_gap = self._after_gap, False
        return GaitEvent(self._leg, kind, stamp_ns, max(now_ns, stamp_ns), after_gap)
