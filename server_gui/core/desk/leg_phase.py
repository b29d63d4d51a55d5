"""Where each leg is in its stride, from the gait events."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from server_gui.core.processing.component import Derived
from server_gui.core.processing.gait_events import EventKind, GaitEvent, Leg

# Phases of a stride and where each ends, in % from heel strike: Perry & Burnfield, Gait Analysis, 2nd ed.
PHASES: Final[tuple[tuple[str, float], ...]] = (
    ("loading response", 12.0),
    ("mid-stance", 31.0),
    ("terminal stance", 50.0),
    ("pre-swing", 62.0),
    ("initial swing", 75.0),
    ("mid-swing", 87.0),
    ("terminal swing", 100.0),
)
LONGEST_PERCENT: Final = 150.0  # of the mean stride, that one may last


@dataclass(frozen=True, slots=True)
class LegPhase:
    """One leg now: `percent` of its stride since heel strike, 0–100."""

    percent: float
    phase: str


def leg_phase(derived: Derived, leg: Leg, now_ns: int) -> LegPhase | None:
    """Return where a leg is at `now_ns` on the robot's clock; None without a walk or a whole stride.

    None too for a leg that is far beyond its stride's end: it stands, or its next strike was not seen.
    """
    stride_s = derived.gait.legs[leg].stride_s
    strike = _newest_strike(derived.events, leg)
    if not derived.gait.walking or stride_s is None or strike is None:
        return None
    percent = max((now_ns - strike.stamp_ns) / 1e9 / stride_s * 100.0, 0.0)
    if percent > LONGEST_PERCENT:
        return None
    percent = min(percent, 100.0)
    return LegPhase(percent, phase_at(percent))


def phase_at(percent: float) -> str:
    """Return the phase's name at a percentage of the stride."""
    return next((name for name, end in PHASES if percent < end), PHASES[-1][0])


def _newest_strike(events: Iterable[GaitEvent], leg: Leg) -> GaitEvent | None:
    found = None
    for event in events:
        if event.leg is leg and event.kind is EventKind.HEEL_STRIKE:
            found = event
    return found


def apart(one: float, other: float) -> float:
    """Return how far two places in a stride are apart (%): it is round."""
    between = abs(one - other) % 100.0
    return min(between, 100.0 - between)
