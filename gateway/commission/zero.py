"""A joint's zero is found again: held as before, read while nothing moves it, shown, and asked for."""

import math
import re
from dataclasses import dataclass

from drivers.joint.settings import JointSettings
from gateway.commission import scale as scales
from gateway.commission.axes import Axis, counts, nearest, powered
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Say, Talk, agree, press
from gateway.commission.dialogue import number as ask_number
from gateway.commission.joints import words
from gateway.commission.scale import Scale

LOOKS = 10
STILL = math.radians(0.2)  # that a joint may move while it is read
PLAUSIBLE = 10.0  # °: by more a zero does not change by itself


class NotRepeated(Exception):
    """The zero stays as it was; why."""


@dataclass(frozen=True, slots=True)
class Zero:
    """The new one (rad), and how it was found."""

    offset: float
    how: str


def posture(comment: str) -> float | None:
    """Return the first angle (°) by which a zero was found, as its comment says."""
    found = re.search(r"(-?\d+(?:\.\d+)?)°", comment)
    return None if found is None else float(found[1])


def repeated(
    bench: Bench, joint: str, settings: JointSettings, degrees: float | None, most: float
) -> Talk[Zero | None]:
    """Return the zero by the joint held at `degrees`; `None` if the user declines.

    Raises:
        NotRepeated: it moves, has no position, may have power, or the zero is more than `most` (°) off.
        DriverError: its drive does not answer.

    """
    axis, scale = Axis(settings.node_id, settings.axis), _scale(settings)
    if degrees is None:
        degrees = yield from ask_number(f"At which angle is the {words(joint)} to be held?", "°", -180, 360)
    yield from press(
        f"Hold the {words(joint)} still at {degrees:g}° (flexion positive), without power, as when its "
        "zero was found."
    )
    position = _held_still(bench, axis, scale)
    new = scales.with_zero(scale, math.radians(degrees), nearest(position, scales.counts_at_zero(scale)))
    change = math.degrees(new.zero_offset - scale.zero_offset)
    yield Say(
        f"{words(joint)}: zero_offset was {scale.zero_offset:.5f} rad and is {new.zero_offset:.5f} rad by "
        f"this: {change:+.2f}°."
    )
    if abs(change) > most:
        raise NotRepeated(
            f"it would change by {change:+.1f}°, more than {most:g}°: is it held at {degrees:g}°, was its "
            "drive homed or its encoder changed? --max-change DEGREES takes it all the same"
        )
    if not scales.near(new):
        raise NotRepeated("the drive's own zero is more than a turn away: home it (gwrms commission)")
    if not (yield from agree("Write it?")):
        return None
    how = f"rad; {degrees:g}° by hand, repeated ({change:+.2f}°)"
    return Zero(round(new.zero_offset, 5), how)


def _scale(settings: JointSettings) -> Scale:
    return Scale(
        settings.counts_per_revolution, settings.gear_ratio, settings.direction, settings.zero_offset
    )


def _held_still(bench: Bench, axis: Axis, scale: Scale) -> int:
    """Return its counts, of some looks in a row, without power before and after. Raises `NotRepeated`."""
    _unpowered(bench, axis)
    seen = [counts(bench, axis) for _ in range(LOOKS)]
    _unpowered(bench, axis)
    found = [nearest(one, seen[0]) for one in seen if one is not None and seen[0] is not None]
    if len(found) < LOOKS:
        raise NotRepeated("its drive tells no position")
    counts_per_radian = scale.counts_per_revolution * scale.gear_ratio / math.tau
    moved = (max(found) - min(found)) / counts_per_radian
    if moved > STILL:
        raise NotRepeated(f"it moved by {math.degrees(moved):.2f}° while it was read: hold it still")
    return round(sum(found) / len(found))


def _unpowered(bench: Bench, axis: Axis) -> None:
    if powered(bench, [axis]):
        raise NotRepeated(f"{axis} may be under power: switch it off before you hold the joint")
