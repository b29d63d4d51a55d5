"""Gait events of one foot from an IMU on it, by its angular velocity about the side axis."""

import collections
import statistics

from server_gui.core.processing.gait_events import Continuity, EventKind, Follows, GaitEvent, Leg

STANCE_NS, SWING_NS = 250_000_000, 150_000_000  # at least; the foot's slap after heel strike is no push-off
NO_SWING_NS = 1_500_000_000  # a push-off that no swing follows was none
STRIKE_AFTER_NS = 30_000_000  # contact comes so long after the foot has begun to turn down
SHARE = 0.3  # of the usual push-off, or swing, that a new one has at least
FIRST_RAD_S, LEAST_RAD_S = 1.5, 1.0  # before any was seen; and always


class FootImuEvents:
    """Heel strike and toe off of `leg` from its foot's pitch rate (rad/s, toes down positive: REP-103's y).

    The foot turns toes down while it pushes off, toes up in swing, and down again from contact on (Sabatini
    et al. 2005, IEEE Trans. Biomed. Eng. 52, 486; Jasiewicz et al. 2006, Gait & Posture 24, 502). Toe off is
    where the push-off's last half peak is passed, known when the rate changes its sign; heel strike is
    `STRIKE_AFTER_NS` after the rate's next change of sign, and known at the first sample from then on.
    """

    def __init__(self, leg: Leg) -> None:
        self._leg = leg
        self._continuity = Continuity()
        self._swinging = False
        self._since_ns = 0  # the present phase began
        self._peak = 0.0  # of push-off, or of swing
        self._half_ns: int | None = None  # the last sample above half of it
        self._strike_ns: int | None = None
        self._pushes: collections.deque[float] = collections.deque(maxlen=5)
        self._swings: collections.deque[float] = collections.deque(maxlen=5)
        self._after_gap = True

    def feed(self, stamp_ns: int, pitch_rate: float | None) -> GaitEvent | None:
        """Take one sample, None where it is missing; the event that it decides, if it does."""
        if pitch_rate is None:
            return None
        follows = self._continuity.take(stamp_ns)
        if follows is Follows.OLD:
            return None
        if follows is Follows.GAP:
            self._turn(stamp_ns, swinging=False)
            self._after_gap = True
        return self._swing(stamp_ns, pitch_rate) if self._swinging else self._stance(stamp_ns, pitch_rate)

    def _stance(self, stamp_ns: int, rate: float) -> GaitEvent | None:
        if stamp_ns - self._since_ns < STANCE_NS:
            return None
        if rate >= 0.0:
            self._peak = max(self._peak, rate)
            if rate >= self._peak / 2:
                self._half_ns = stamp_ns
            return None
        peak, half_ns, self._peak, self._half_ns = self._peak, self._half_ns, 0.0, None
        if half_ns is None or peak < _least(self._pushes):
            return None
        self._pushes.append(peak)
        self._turn(stamp_ns, swinging=True)
        return self._event(EventKind.TOE_OFF, half_ns, stamp_ns)

    def _swing(self, stamp_ns: int, rate: float) -> GaitEvent | None:
        if self._strike_ns is not None:
            return self._strike(stamp_ns, self._strike_ns)
        self._peak = max(self._peak, -rate)
        lasted_ns = stamp_ns - self._since_ns
        if rate >= 0.0 and lasted_ns >= SWING_NS and self._peak >= _least(self._swings):
            self._strike_ns = stamp_ns + STRIKE_AFTER_NS
        elif lasted_ns > NO_SWING_NS:
            self._turn(stamp_ns, swinging=False)
            self._after_gap = True
        return None

    def _strike(self, stamp_ns: int, strike_ns: int) -> GaitEvent | None:
        if stamp_ns < strike_ns:
            return None
        self._swings.append(self._peak)
        self._turn(strike_ns, swinging=False)
        return self._event(EventKind.HEEL_STRIKE, strike_ns, stamp_ns)

    def _turn(self, stamp_ns: int, swinging: bool) -> None:
        self._swinging, self._since_ns = swinging, stamp_ns
        self._peak, self._half_ns, self._strike_ns = 0.0, None, None

    def _event(self, kind: EventKind, stamp_ns: int, known_ns: int) -> GaitEvent:
        after_gap, self._after_gap = self._after_gap, False
        return GaitEvent(self._leg, kind, stamp_ns, known_ns, after_gap)


def _least(seen: collections.deque[float]) -> float:
    return max(LEAST_RAD_S, SHARE * statistics.median(seen)) if seen else FIRST_RAD_S
