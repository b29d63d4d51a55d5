"""Alignment of two robots, or a robot and a recording, on one axis of time."""

from enum import Enum
from typing import Final

from gateway.units import with_minus
from server_gui.core.desk.flags import FlagKind
from server_gui.core.desk.station import Station

HOLD_NS: Final = 100_000_000  # what is measured anew differs a little each time: only more than this moves
SAME_S: Final = 0.005  # what is less is not shown with two decimals


class Align(Enum):
    """Instant at which both are aligned."""

    NOW = "now"
    START = "first row"
    STOP = "last stop"
    FAULT = "last fault"
    WRITE = "last write"
    MARK = "last mark"


_KINDS: Final = {
    Align.STOP: FlagKind.STOP,
    Align.FAULT: FlagKind.FAULT,
    Align.WRITE: FlagKind.WRITE,
    Align.MARK: FlagKind.MARK,
}


def shift_ns(here: Station, beside: Station, by: Align, before_ns: int = 0) -> int | None:
    """Return the shift of the clock of `beside` to that of `here`; None if one lacks the instant.

    `before_ns` is what it was: what hardly differs from that is that.
    """
    one, other = instant_ns(here, by), instant_ns(beside, by)
    if one is None or other is None:
        return None
    found = one - other
    return before_ns if abs(found - before_ns) < HOLD_NS and by is Align.NOW and before_ns else found


def instant_ns(station: Station, by: Align) -> int | None:
    """Return the instant that is meant, on the robot's clock."""
    rings = station.rings
    if rings.newest_ns is None:
        return None
    if by is Align.NOW:
        return rings.newest_ns + round((station.robot.age_s() or 0.0) * 1e9)
    if by is Align.START:
        times = rings.times(1e9)
        return rings.stamp_ns(float(times[0])) if len(times) else None
    found = [flag.at_ns for flag in station.flags if flag.kind is _KINDS[by]]
    return found[-1] if found else None


def offset_text(here: Station, beside: Station, shift: int | None, nudge_s: float) -> str:
    """Return the shift of `beside`, by the age of its newest row on this robot's axis."""
    if shift is None:
        return "cannot be aligned so: one of the two has none"
    ours, theirs = here.rings.newest_ns, beside.rings.newest_ns
    if ours is None or theirs is None:
        return "no rows yet"
    behind_s = (theirs + shift - ours) / 1e9 + nudge_s
    moved = f", moved by {nudge_s:+.2f} s" if nudge_s else ""
    way = "later" if behind_s > 0.0 else "earlier"
    when = f"{abs(behind_s):.2f} s {way}" if abs(behind_s) >= SAME_S else "of the same instant"
    return with_minus(f"its newest row is {when}{moved}")
