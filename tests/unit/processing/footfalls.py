"""Made-up feet with events at known times: forces, pitch rates, hips and knees at 100 Hz."""

import math
import random
from collections.abc import Callable, Sequence

from server_gui.core.processing.gait_events import EventKind, GaitEvent, Leg

DT_NS = 10_000_000
STRIDE_S, STANCE = 1.2, 0.62


def stamps(seconds: float, begin_s: float = 0.0) -> list[int]:
    return [round((begin_s + step / 100) * 1e9) for step in range(round(seconds * 100))]


def force(time_s: float, late_s: float = 0.0, peak: float = 800.0) -> float:
    """Strides from `late_s` on, each of a stance that rises and falls within a twentieth of it."""
    phase = (time_s - late_s) / STRIDE_S % 1.0 / STANCE
    return peak * min(phase / 0.05, (1.0 - phase) / 0.05, 1.0) if phase < 1.0 else 0.0


def pitch_rate(time_s: float) -> float:
    """Slap after the strike, quiet, push-off up to toe off, swing (rad/s, toes down positive)."""
    phase = time_s / STRIDE_S % 1.0
    if phase < 0.06:
        return 4.0 * math.sin(math.pi * phase / 0.06)
    if phase < STANCE - 0.2:
        return 0.02
    if phase < STANCE + 0.03:
        return 9.0 * math.sin(math.pi * (phase - STANCE + 0.2) / 0.23)
    return -6.0 * math.sin(math.pi * (phase - STANCE - 0.03) / (0.97 - STANCE))


def strikes(seconds: float, late_s: float = 0.0) -> list[float]:
    """When the feet of `force` come down (s)."""
    return [late_s + n * STRIDE_S for n in range(1 if late_s <= 0 else 0, round(seconds / STRIDE_S) + 2)]


def offs(seconds: float, late_s: float = 0.0) -> list[float]:
    return [late_s + (n + STANCE) * STRIDE_S for n in range(round(seconds / STRIDE_S) + 2)]


def true_times(kind: EventKind, seconds: float) -> list[float]:
    """Those that lie well inside (ns)."""
    times = strikes(seconds) if kind is EventKind.HEEL_STRIKE else offs(seconds)
    return [time_s * 1e9 for time_s in times if 0.3 < time_s < seconds - 0.3]


def found_times(events: Sequence[GaitEvent], kind: EventKind, seconds: float) -> list[float]:
    return [
        float(event.stamp_ns)
        for event in events
        if event.kind is kind and 0.25e9 < event.stamp_ns < (seconds - 0.25) * 1e9
    ]


def fed(
    feed: Callable[[int, float | None], GaitEvent | None], values: Sequence[tuple[int, float | None]]
) -> list[GaitEvent]:
    found = (feed(stamp_ns, value) for stamp_ns, value in values)
    return [event for event in found if event is not None]


def noisy(values: Sequence[tuple[int, float]], spread: float, lost: float) -> list[tuple[int, float | None]]:
    source = random.Random(7)
    return [
        (stamp_ns, None if source.random() < lost else max(0.0, value + source.gauss(0.0, spread)))
        for stamp_ns, value in values
    ]


def event(leg: Leg, kind: EventKind, time_s: float, after_gap: bool = False) -> GaitEvent:
    stamp_ns = round(time_s * 1e9)
    return GaitEvent(leg, kind, stamp_ns, stamp_ns, after_gap)
