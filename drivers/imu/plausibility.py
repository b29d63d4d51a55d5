"""Plausibility of an IMU: against gravity, its own channels, and the limits of a trunk."""

import math
from collections import deque

from drivers.findings import FindingState
from drivers.imu.rotation import Vector

STANDARD_GRAVITY = 9.80665
SETTLED_S = 10.0
TIME_CONSTANT_S = 5.0
DISAGREES = math.radians(6.0)
SCALE = 0.25  # share by which the mean acceleration may differ from g
FASTEST = 15.0  # rad/s; no trunk turns faster, not even in a fall
TOO_FAST, TOO_FAST_IN_S = 3, 10.0  # so many frames that are too fast, in so short a time
FROZEN_S = 5.0
PERIOD_NS = 39_000_000  # for slow means, faster frames are left out


class ImuCheck(FindingState):
    """Watches one IMU in trunk axes."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name = name
        self.restart()

    def restart(self) -> None:
        """Restart with the stream."""
        self.clear()
        self._judged_ns = 0
        self._force: Vector | None = None  # specific force, slow mean
        self._up: Vector | None = None  # the attitude's up, slow mean
        self._began_ns: int | None = None
        self._last_force_ns = self._last_up_ns = 0
        self._previous: Vector | None = None
        self._changed_ns = 0
        self._now_ns = 0
        self._fast_ns: deque[int] = deque(maxlen=TOO_FAST)  # when it was too fast

    def update(
        self, stamp_ns: int, acceleration: Vector | None, angular_velocity: Vector | None, up: Vector | None
    ) -> None:
        """Take the values of one frame: m/s², rad/s, and the direction of up by the attitude."""
        self._now_ns = stamp_ns
        if self._began_ns is None:
            self._began_ns = self._changed_ns = stamp_ns
        if acceleration is not None and stamp_ns - self._last_force_ns >= PERIOD_NS:
            self._force = _slow(self._force, acceleration, (stamp_ns - self._last_force_ns) / 1e9)
            self._last_force_ns = stamp_ns
            if acceleration != self._previous:
                self._previous, self._changed_ns = acceleration, stamp_ns
        if up is not None and stamp_ns - self._last_up_ns >= PERIOD_NS:
            self._up = _slow(self._up, up, (stamp_ns - self._last_up_ns) / 1e9)
            self._last_up_ns = stamp_ns
        if angular_velocity is not None and math.hypot(*angular_velocity) > FASTEST:
            self._fast_ns.append(stamp_ns)
        if stamp_ns - self._judged_ns >= PERIOD_NS and stamp_ns - self._began_ns >= SETTLED_S * 1e9:
            self._judged_ns = stamp_ns
            self._look(stamp_ns)

    def _look(self, stamp_ns: int) -> None:
        if self._force is not None and stamp_ns - self._changed_ns > FROZEN_S * 1e9:
            words = f"{self._name} sends the same acceleration again and again, it hangs"
            self.note(self._changed_ns, words, "restart it")
        elif (wrong := self._judge()) is not None:
            self.note(stamp_ns, *wrong)
        else:
            self.clear()

    def _judge(self) -> tuple[str, str] | None:
        """Return the implausibility of its values, and what to check."""
        if len(self._fast_ns) == TOO_FAST and self._now_ns - self._fast_ns[0] < TOO_FAST_IN_S * 1e9:
            return (
                f"{self._name} reports turns faster than {FASTEST:.0f} rad/s, which no trunk does",
                "check the range set in the device, and its wires for noise",
            )
        if self._force is None:
            return None
        length = math.hypot(*self._force)
        if abs(length / STANDARD_GRAVITY - 1.0) > SCALE:
            return (
                f"{self._name} measures {length:.1f} m/s² on average instead of 9.8, its scale is off",
                "check the range set in the device and its format",
            )
        return self._against_gravity(length)

    def _against_gravity(self, length: float) -> tuple[str, str] | None:
        force, up = self._force, self._up
        if force is None or up is None:
            return None
        if up[2] < -0.5 and force[2] < 0.0:
            return f"{self._name} is upside down", f"correct `axes` in [imu.{self._name}] or turn it over"
        cosine = sum(a * b for a, b in zip(force, up, strict=True)) / (length * (math.hypot(*up) or 1.0))
        angle = math.acos(max(-1.0, min(1.0, cosine)))
        if angle > DISAGREES:
            disagree = f"{self._name}'s tilt and gravity disagree by {math.degrees(angle):.0f}°"
            why = "an angle's sign or order is wrong, or it drifts"
            return f"{disagree}: {why}", "check `format`, or set attitude = 'filter'"
        return None


def _slow(mean: Vector | None, value: Vector, step_s: float) -> Vector:
    """Return the mean moved towards `value`, as a low-pass of the time constant does."""
    if mean is None:
        return value
    share = min(1.0, step_s / TIME_CONSTANT_S)
    (a, b, c), (x, y, z) = mean, value
    return (a + share * (x - a), b + share * (y - b), c + share * (z - c))
