"""Display of values: angles in degrees on request, and the robot's clock as UTC."""

import argparse
from datetime import UTC, datetime, timedelta
from typing import Final

from msgspec.structs import replace

from gateway.units import UNITS, Unit
from gateway.wire.component import ChannelInfo
from gateway.wire.robot import Clock, Description

_ANGLES: Final = {si: UNITS[si][0] for si in ("rad", "rad/s")}
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


def add_degrees(made: argparse.ArgumentParser) -> None:
    """Add the option `--deg`, which `unit_of` heeds."""
    made.add_argument(
        "--deg", action="store_true", help="show angles in degrees, not in rad; JSON stays in SI"
    )


def unit_of(si: str, *, degrees: bool) -> Unit:
    """Return the unit in which values of this SI unit are shown."""
    return _ANGLES.get(si, Unit(si, si)) if degrees else Unit(si, si)


class Channels:
    """The robot's channels as they are shown."""

    def __init__(self, description: Description, *, degrees: bool) -> None:
        self._units = {each.name: unit_of(each.unit, degrees=degrees) for each in description.channels}
        self._known = {
            each.name: replace(each, unit=self._units[each.name].symbol) for each in description.channels
        }

    def info(self, name: str) -> ChannelInfo | None:
        """Return the channel's description, with the unit in which it is shown."""
        return self._known.get(name)

    def value(self, name: str, value: float | None) -> float | None:
        """Return an SI value in that unit."""
        unit = self._units.get(name)
        return value if value is None or unit is None else value * unit.scale

    def title(self, name: str) -> str:
        """Return the channel's name with that unit."""
        info = self.info(name)
        return f"{name} [{info.unit}]" if info is not None and info.unit else name


def utc(stamp_ns: int, clock: Clock | None) -> str | None:
    """Return a time of the robot's monotonic clock as ISO 8601, such as 2026-11-21T15:30:00.123456Z.

    None where the robot said nothing of its clocks, or something that is no time of any calendar.
    """
    if clock is None:
        return None
    at_ns = stamp_ns - clock.monotonic_ns + clock.utc_ns
    try:
        at = _EPOCH + timedelta(microseconds=at_ns // 1000)
    except OverflowError:
        return None
    return at.replace(tzinfo=None).isoformat(timespec="microseconds") + "Z"
