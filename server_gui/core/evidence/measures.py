"""The metrics of one joint in one gait cycle, from curves over the stride (0–100 %)."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

POINTS: Final = 201  # 0, 0.5 … 100 % of the stride
MOVES_RAD: Final = 0.02  # over the stride: a target that moves less is a posture that is held
SMOOTHED: Final = 7  # points on each side that jerk is fitted to
CURVES: Final = ("position", "velocity", "torque", "current", "temperature", "following_error")

# The second derivative of a cubic through the points around (Savitzky & Golay 1964, Anal. Chem. 36, 1627).
_AROUND: Final = np.arange(-SMOOTHED, SMOOTHED + 1)
_SECOND: Final = 2.0 * np.linalg.pinv(np.vander(_AROUND, 4, increasing=True).astype(float))[2]


def of_joint(curves: Mapping[str, Floats], seconds: float) -> dict[str, float]:
    """Return the measures of these curves, by the keys of `metrics.OF_JOINTS`; unknown ones are missing.

    Each curve has `POINTS` values, evenly over the `seconds` of the stride, in SI units. What holds still has
    neither lag nor overshoot: of noise, they would be anything.
    """
    found: dict[str, float] = {}
    position, error = curves.get("position"), curves.get("following_error")
    velocity, torque, current = curves.get("velocity"), curves.get("torque"), curves.get("current")
    if error is not None:
        found |= {"error_rms": rms(error), "error_peak": _peak(error)}
    if position is not None and error is not None:
        target = position + error
        if float(np.ptp(target)) >= MOVES_RAD:
            found |= {"lag": lag(target, position, seconds), "overshoot": overshoot(target, position)}
    if current is not None:
        found |= {"current_rms": rms(current), "current_peak": _peak(current)}
    if (temperature := curves.get("temperature")) is not None:
        found["temperature"] = float(temperature.mean())
    if torque is not None:
        found["torque_rms"] = rms(torque)
        if velocity is not None:
            found["power"] = float(np.abs(torque * velocity).mean())
    if velocity is not None:
        found["jerk"] = jerk(velocity, seconds)
    return found


def rms(curve: Floats) -> float:
    """Return the root mean square."""
    return math.sqrt(float(curve @ curve) / len(curve))


def _peak(curve: Floats) -> float:
    return float(np.abs(curve).max())


def overshoot(target: Floats, position: Floats) -> float:
    """Return how far the position goes beyond the furthest that it was told to go, on either side (rad)."""
    beyond = max(position.max() - target.max(), target.min() - position.min())
    return max(float(beyond), 0.0)


def lag(target: Floats, position: Floats, seconds: float) -> float:
    """Return by how much the position is later than its target (s), where both resemble each other most.

    Cross-correlation over the stride, which is taken as periodic; its peak lies on a parabola through the
    highest point and its neighbours.
    """
    wanted, actual = _periodic(target), _periodic(position)
    points = len(wanted)
    alike = np.fft.irfft(np.fft.rfft(actual) * np.conj(np.fft.rfft(wanted)), points)
    best = int(np.argmax(alike))
    before, at, behind = (float(alike[(best + shift) % points]) for shift in (-1, 0, 1))
    bend = before - 2.0 * at + behind
    share = 0.5 * (before - behind) / bend if bend < 0.0 else 0.0
    shift = (best + share + points / 2) % points - points / 2
    return shift * seconds / points


def _periodic(curve: Floats) -> Floats:
    """One period about its mean, without the last point, which is the next stride's first; no jump there."""
    ramp = np.linspace(0.0, curve[-1] - curve[0], len(curve))
    level = (curve - ramp)[:-1]
    return np.asarray(level - level.mean())


def jerk(velocity: Floats, seconds: float) -> float:
    """Return the RMS of the position's third derivative (rad/s³), as far as 15 points show it."""
    step_s = seconds / (len(velocity) - 1)
    return rms(np.convolve(velocity, _SECOND[::-1], "valid")) / step_s**2
