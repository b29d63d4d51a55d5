"""Step response: rise 10–90 %, overshoot, settling into ±5 % and ±2 %, steady error; the mean of all steps.

All are told by the joint's own way, from where it stood to where it came to rest; the steady error is between
that and the target.
"""

from itertools import pairwise
from typing import Final

import numpy as np

from server_gui.core.joint_tests.file import Samples, Test
from server_gui.core.joint_tests.measures import Curve, JointTestResult, Measure, unknown

TAIL: Final = 0.2  # of the time after a step, in which it is taken to be at rest
LEAST_SHARE: Final = 0.2  # of the target's way: a joint that goes less has not followed it
BANDS: Final = (0.05, 0.02)
_UNITS: Final = {
    "rise_time": "s",
    "target_rise_time": "s",
    "overshoot": "%",
    "settling_5": "s",
    "settling_2": "s",
    "steady_error": "rad",
    "delay": "s",
}


def step_response(test: Test) -> JointTestResult:
    """Analyse every step of a test."""
    times, target, position = test.times, test["target"], test["position"]
    steps = [_one(times[a:b], target[a:b], position[a:b]) for a, b in _bounds(target)]
    steps = [one for one in steps if one is not None]
    if not steps:
        why = "the joint did not follow its target, or the test ended before it came to rest"
        return JointTestResult([unknown(name, unit, why) for name, unit in _UNITS.items()], [])
    measures = [
        _mean(name, unit, [one[name] for one in steps if one is not None]) for name, unit in _UNITS.items()
    ]
    return JointTestResult(measures, _curves(times, target, position))


def _bounds(target: Samples) -> list[tuple[int, int]]:
    """From just before each step to just before the next: the beginnings of each change of the target."""
    moves = np.diff(target) != 0.0
    begins = [int(at) for at in np.flatnonzero(moves) if at == 0 or not moves[at - 1]]
    return list(pairwise([*begins, len(target) - 1]))


def _one(times: Samples, target: Samples, position: Samples) -> dict[str, float] | None:
    tail = max(3, round(TAIL * len(times)))
    if len(times) < 4 * tail // 2 or np.any(np.diff(target[-tail:]) != 0.0):
        return None
    start, end = float(position[0]), float(np.mean(position[-tail:]))
    asked = float(target[-1] - target[0])
    if abs(end - start) < LEAST_SHARE * abs(asked):
        return None
    share = (position - start) / (end - start)
    aimed = (target - target[0]) / asked
    since = times - times[0]
    rise = _crossing(since, share, 0.9) - _crossing(since, share, 0.1)
    found = {
        "rise_time": rise,
        "target_rise_time": _crossing(since, aimed, 0.9) - _crossing(since, aimed, 0.1),
        "overshoot": 100.0 * max(0.0, float(np.max(share)) - 1.0),
        "steady_error": float(target[-1]) - end,
        "delay": _crossing(since, share, 0.5) - _crossing(since, aimed, 0.5),
    }
    for band in BANDS:
        outside = np.flatnonzero(np.abs(share - 1.0) > band)
        last = int(outside[-1]) + 1 if len(outside) else 0
        found[f"settling_{band * 100:.0f}"] = float(since[min(last, len(since) - 1)])
    return found


def _crossing(since: Samples, share: Samples, level: float) -> float:
    """Return when it is there for the first time, between two samples."""
    at = int(np.argmax(share >= level))
    if at == 0:
        return float(since[0])
    part = (level - share[at - 1]) / (share[at] - share[at - 1])
    return float(since[at - 1] + part * (since[at] - since[at - 1]))


def _mean(name: str, unit: str, values: list[float]) -> Measure:
    sizes = np.abs(values) if name == "steady_error" else np.array(values)
    spread = float(np.std(sizes, ddof=1)) if len(values) > 1 else None
    return Measure(name, float(np.mean(sizes)), unit, spread)


def _curves(times: Samples, target: Samples, position: Samples) -> list[Curve]:
    begin = int(_bounds(target)[0][0])
    zero = float(position[begin])
    shown = slice(max(0, begin - 20), None)
    x = (times[shown] - times[begin]).tolist()
    return [
        Curve("target", x, np.degrees(target[shown] - zero).tolist(), "s", "°"),
        Curve("position", x, np.degrees(position[shown] - zero).tolist(), "s", "°"),
    ]
