"""Relay feedback (Åström and Hägglund, 1984): ultimate gain and period of a limit cycle, and gains by rules.

With a relay of ±d and a swing of ±a the ultimate gain is 4 d / (π √(a² − ε²)), ε its hysteresis. It is that
of a loop over the bus: the delay of a cycle is in it, so that a loop inside the drive stands more than this.
"""

import math
from itertools import pairwise
from typing import Final

import numpy as np

from server_gui.core.joint_tests.file import Samples, Test
from server_gui.core.joint_tests.measures import Curve, JointTestResult, Measure, Proposal, unknown

SKIPPED: Final = 2  # cycles, before it has settled
LEAST_CYCLES: Final = 3
MOST_SPREAD: Final = 0.15  # of period and swing, from cycle to cycle
# Rule: shares of Ku for the gain, of Tu for integral and derivative time; source.
RULES: Final = {
    "Tyreus–Luyben": (1 / 2.2, 2.2, 1 / 6.3, "Tyreus and Luyben, Ind. Eng. Chem. Res. 31 (1992) 2625"),
    "Ziegler–Nichols": (0.6, 0.5, 0.125, "Ziegler and Nichols, Trans. ASME 64 (1942) 759"),
}


def relay(test: Test) -> JointTestResult:
    """Analyse a relay test."""
    times, target, position = test.times, test["target"], test["position"]
    curves = [
        Curve("position", times.tolist(), np.degrees(position).tolist(), "s", "°"),
        Curve("torque", times.tolist(), target.tolist(), "s", "N·m"),
    ]
    rises = _rises(target)[SKIPPED:]
    cycles = list(pairwise(rises))
    if len(cycles) < LEAST_CYCLES:
        return _none("it did not swing for enough cycles: a larger relay, or more of them", curves)
    periods = np.array([times[b] - times[a] for a, b in cycles])
    swings = np.array([np.ptp(position[a:b]) / 2.0 for a, b in cycles])
    lopsided = max(float(np.std(one, ddof=1) / np.mean(one)) for one in (periods, swings))
    if lopsided > MOST_SPREAD:
        return _none(f"its cycles differ by {100 * lopsided:.0f} %: it has not settled", curves)
    size, hysteresis = float(test.head.wish["torque"]), float(test.head.wish["hysteresis"])
    swing = float(np.mean(swings))
    if swing <= hysteresis:
        return _none("it swings by no more than the hysteresis", curves)
    gain = 4.0 * size / (math.pi * math.sqrt(swing**2 - hysteresis**2))
    period = float(np.mean(periods))
    share = float(np.std(swings, ddof=1)) / swing
    return JointTestResult(
        [
            Measure("ultimate_gain", gain, "N·m/rad", gain * share),
            Measure("ultimate_period", period, "s", float(np.std(periods, ddof=1))),
            Measure("swing", swing, "rad", float(np.std(swings, ddof=1))),
        ],
        curves,
        proposals=[_proposal(name, gain, period) for name in RULES],
        notes=["Friction damps the swing: with much of it the ultimate gain comes out too high."],
    )


def _rises(target: Samples) -> list[int]:
    """Return where the relay goes from pushing back to pushing forth."""
    change = np.diff(target)
    most = float(np.max(np.abs(change))) if len(change) else 0.0
    return [int(at) + 1 for at in np.flatnonzero(change > most / 2.0)] if most else []


def _none(why: str, curves: list[Curve]) -> JointTestResult:
    names = (("ultimate_gain", "N·m/rad"), ("ultimate_period", "s"), ("swing", "rad"))
    return JointTestResult([unknown(name, unit, why) for name, unit in names], curves)


def _proposal(name: str, gain: float, period: float) -> Proposal:
    share, integral, derivative, source = RULES[name]
    stiffness = share * gain
    gains = {
        "position gain (N·m/rad)": stiffness,
        "damping (N·m·s/rad)": stiffness * derivative * period,
        "integral (N·m/(rad·s))": stiffness / (integral * period),
    }
    reason = f"{name}: {share:.3g} of the ultimate gain {gain:.4g} N·m/rad, period {period:.3g} s"
    return Proposal(gains, reason, source)
