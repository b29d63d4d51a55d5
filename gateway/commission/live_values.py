"""Live values of the drives while a joint is moved by hand: power, counts, and their meaning so far."""

import math
from collections.abc import Callable, Mapping, Sequence

from drivers.joint.cia402 import ENERGISED, DriveState
from gateway.commission.axes import Axis, counts, nearest, state
from gateway.commission.bench import Bench
from gateway.commission.dialogue import DeviceReading

POWERED, NOT_KNOWN = "UNDER POWER", "power not known"


def watched(
    bench: Bench,
    axes: Sequence[Axis],
    before: Mapping[Axis, int | None] | None = None,
    angle: Callable[[int], float] | None = None,
) -> tuple[DeviceReading, ...]:
    """Return each axis's power and counts, or how far it has counted since `before`. Raises `DriverError`."""
    return tuple(one for axis in axes for one in _axis(bench, axis, before, angle))


def _axis(
    bench: Bench,
    axis: Axis,
    before: Mapping[Axis, int | None] | None,
    angle: Callable[[int], float] | None,
) -> Sequence[DeviceReading]:
    here = counts(bench, axis)
    name = str(axis)
    found = []
    if angle is not None:
        found.append(DeviceReading(name, None if here is None else round(math.degrees(angle(here)), 1), "°"))
    if before is None:
        found.append(DeviceReading(name, here, "counts"))
    else:
        was = before.get(axis)
        moved = None if here is None or was is None else nearest(here, was) - was
        found.append(DeviceReading(name, moved, "counts moved"))
    return [*found, DeviceReading(name, _power(bench, axis))]


def _power(bench: Bench, axis: Axis) -> str:
    """In words; what nobody knows is not called off."""
    found = state(bench, axis)
    if found is None:
        return NOT_KNOWN
    if found is DriveState.SWITCH_ON_DISABLED:
        return "no power"
    return f"{POWERED if found in ENERGISED else 'no power'} ({found.words})"
