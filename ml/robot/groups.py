"""Groups of sensors: what a robot has both sides of, or not at all; channels by the gateway's names.

Joints count by their positions: rates follow from them. Insoles count by their forces: a centre of pressure
is unknown while a foot is in the air.
"""

from collections.abc import Mapping, Set
from types import MappingProxyType
from typing import Final


def _both(names: str) -> tuple[str, str]:
    return f"left_{names}", f"right_{names}"


GROUPS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "hips": _both("hip.position"),
        "knees": _both("knee.position"),
        "ankles": _both("ankle.position"),
        "feet": _both("insole.force"),
        "trunk": (
            *(f"trunk.acceleration_{axis}" for axis in "xyz"),
            *(f"trunk.angular_velocity_{axis}" for axis in "xyz"),
            "trunk.tilt_forward",
            "trunk.tilt_side",
        ),
    }
)
UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "position": "rad",
        "force": "N",
        **{f"acceleration_{axis}": "m/s²" for axis in "xyz"},
        **{f"angular_velocity_{axis}": "rad/s" for axis in "xyz"},
        "tilt_forward": "rad",
        "tilt_side": "rad",
    }
)


def present(channels: Set[str]) -> tuple[str, ...]:
    """Return the groups of which a robot with these channels has every channel."""
    return tuple(name for name, needed in GROUPS.items() if channels >= set(needed))


def unit(channel: str) -> str:
    """In which unit a channel of these groups is learned from and judged."""
    return UNITS[channel.partition(".")[2]]
