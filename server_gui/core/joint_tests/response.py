"""Frequency response of the closed position loop, target to position, by Welch's method (H1), with coherence.

The phase margin is that of the loop as the setpoint sees it: of T, which is measured, L = T / (1 − T) is the
open loop of a unity feedback, with whatever the drive feeds forward in it, and the delay of the bus. What is
measured with too little coherence is left out; where the crossing lies in that, the figure is unknown.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from server_gui.core.joint_tests.file import Samples, Test
from server_gui.core.joint_tests.measures import Curve, JointTestResult, Measure, unknown

LEAST_COHERENCE: Final = 0.8
SEGMENTS: Final = 8  # that the sweep is cut into, each half over the next
LEAST_SEGMENT: Final = 64
NOT_COHERENT: Final = "the coherence is too low there: a larger amplitude, or a slower sweep, may help"
NOT_REACHED: Final = "not within the frequencies that were swept"
GOOD_MARGIN: Final = (30.0, 60.0)  # °, of textbooks on servo loops


@dataclass(frozen=True, slots=True)
class Response:
    """Complex closed loop `closed` and `coherence` at `hz`; each (n,), rising in frequency."""

    hz: Samples
    closed: NDArray[np.complex128]
    coherence: Samples


def frequency_response(test: Test) -> JointTestResult:
    """Analyse a chirp."""
    response = measured(test)
    if response is None:
        why = "the test has too few samples"
        names = (("bandwidth", "Hz"), ("phase_margin", "°"), ("crossover", "Hz"), ("peak", "dB"))
        return JointTestResult([unknown(name, unit, why) for name, unit in names], [])
    magnitude = 20.0 * np.log10(np.abs(response.closed))
    good = response.coherence >= LEAST_COHERENCE
    loop = response.closed / (1.0 - response.closed)
    crossover, margin = _margin(response, loop, good)
    return JointTestResult(
        [
            _bandwidth(response.hz, magnitude, good),
            margin,
            crossover,
            _peak(magnitude, good),
            Measure("coherence", float(np.median(response.coherence)), ""),
        ],
        _curves(response, magnitude),
        notes=_words(margin.value),
    )


def measured(test: Test) -> Response | None:
    """T by cross and power spectral density, on an even grid; `None` where there is too little."""
    times, period = test.times, test.head.period_s
    if len(times) < LEAST_SEGMENT * 2:
        return None
    even = np.arange(0.0, float(times[-1]), period)
    target, position = (
        signal.detrend(np.interp(even, times, test[name]), type="constant") for name in ("target", "position")
    )
    # Even, so that they reach to the end: there alone are the highest frequencies.
    segment = max(LEAST_SEGMENT, 2 * (len(even) // (SEGMENTS + 1)))
    segment = min(segment, len(even) // 2)
    spectral = {"fs": 1.0 / period, "nperseg": segment}
    hz, cross = signal.csd(target, position, **spectral)
    _, power = signal.welch(target, **spectral)
    _, coherence = signal.coherence(target, position, **spectral)
    low, high = float(test.head.wish["low_hz"]), float(test.head.wish["high_hz"])
    swept = (hz >= low) & (hz <= high) & (power > 0.0)
    if not np.any(swept):
        return None
    return Response(hz[swept], cross[swept] / power[swept], coherence[swept])


def _bandwidth(hz: Samples, magnitude: Samples, good: NDArray[np.bool_]) -> Measure:
    """Return where it is first 3 dB below what it is at the lowest frequency."""
    fallen = np.flatnonzero(magnitude < magnitude[0] - 3.0)
    if not len(fallen):
        return unknown("bandwidth", "Hz", f"{NOT_REACHED}: above {hz[-1]:.1f} Hz")
    at = int(fallen[0])
    if not good[: at + 1].all():
        return unknown("bandwidth", "Hz", NOT_COHERENT)
    part = (magnitude[at - 1] - magnitude[0] + 3.0) / (magnitude[at - 1] - magnitude[at])
    return Measure("bandwidth", float(hz[at - 1] + part * (hz[at] - hz[at - 1])), "Hz")


def _margin(
    response: Response, loop: NDArray[np.complex128], good: NDArray[np.bool_]
) -> tuple[Measure, Measure]:
    size = np.abs(loop)
    falls = np.flatnonzero((size[:-1] >= 1.0) & (size[1:] < 1.0))
    if not len(falls):
        return unknown("crossover", "Hz", NOT_REACHED), unknown("phase_margin", "°", NOT_REACHED)
    at = int(falls[-1])
    if not (good[at] and good[at + 1]):
        return unknown("crossover", "Hz", NOT_COHERENT), unknown("phase_margin", "°", NOT_COHERENT)
    part = float((size[at] - 1.0) / (size[at] - size[at + 1]))
    hz = float(response.hz[at] + part * (response.hz[at + 1] - response.hz[at]))
    phase = np.degrees(np.unwrap(np.angle(loop[at : at + 2])))
    margin = (180.0 + float(phase[0] + part * (phase[1] - phase[0])) + 180.0) % 360.0 - 180.0
    return Measure("crossover", hz, "Hz"), Measure("phase_margin", margin, "°")


def _peak(magnitude: Samples, good: NDArray[np.bool_]) -> Measure:
    if not good.any():
        return unknown("peak", "dB", NOT_COHERENT)
    return Measure("peak", float(np.max(magnitude[good]) - magnitude[0]), "dB")


def _words(margin: float | None) -> list[str]:
    if margin is None:
        return ["No gains are judged by it: the phase margin is not known."]
    low, high = GOOD_MARGIN
    if margin < low:
        return [f"A phase margin below {low:g}° rings: less stiffness, more damping, or less delay."]
    if margin > high:
        return [f"A phase margin above {high:g}° leaves room for more stiffness, if torque allows."]
    return [f"A phase margin between {low:g}° and {high:g}° is usual of servo loops."]


def _curves(response: Response, magnitude: Samples) -> list[Curve]:
    hz = response.hz.tolist()
    phase = np.degrees(np.unwrap(np.angle(response.closed)))
    return [
        Curve("magnitude", hz, magnitude.tolist(), "Hz", "dB"),
        Curve("phase", hz, phase.tolist(), "Hz", "°"),
        Curve("coherence", hz, response.coherence.tolist(), "Hz", ""),
    ]
