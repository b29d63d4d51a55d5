"""Gait cycles made by hand: metrics that vary from stride to stride, and whatever a test does to them."""

from collections.abc import Callable, Mapping

import numpy as np

from server_gui.core.evidence.comparison import Spell
from server_gui.core.evidence.cycles import Cycle
from server_gui.core.processing.gait_events import Leg

SECOND = 1_000_000_000
STRIDE_S = 1.2
USUAL: Mapping[str, float] = {
    "left_knee.error_rms": 0.005,
    "left_knee.torque_rms": 20.0,
    "left_knee.temperature": 30.0,
    "cadence": 100.0,
}
AT_S = 60.0  # of the edit


def cycles(
    change: Callable[[float, dict[str, float]], None] = lambda at_s, values: None,
    *,
    until_s: float = 120.0,
    stride_s: Callable[[float], float] = lambda at_s: STRIDE_S,
    activity: Callable[[float], str | None] = lambda at_s: "",
    seed: int = 1,
) -> list[Cycle]:
    """Return strides of the left leg that differ by two percent; `change` is made at each one's time (s)."""
    source, found, at_s = np.random.default_rng(seed), [], 0.0
    while at_s < until_s:
        values = {
            name: value * (1.0 + (0.0002 if "temperature" in name else 0.02) * source.normal())
            for name, value in USUAL.items()
        }
        change(at_s, values)
        lasts_s = stride_s(at_s) * (1.0 + 0.01 * source.normal())
        began_ns, ended_ns = round(at_s * SECOND), round((at_s + lasts_s) * SECOND)
        found.append(Cycle(Leg.LEFT, began_ns, ended_ns, activity(at_s), values))
        at_s += lasts_s
    return found


def spell(until_s: float = 120.0) -> Spell:
    """Return an edit in force from `AT_S` on."""
    return Spell([(0, round(AT_S * SECOND))], [(round((AT_S + 1.0) * SECOND), round(until_s * SECOND))])
