"""Notifications as a robot's stream brings them, for tests of recording."""

import time

import msgspec

from gateway.client import Batch
from gateway.wire.messages import Description

CHANNELS = ("left_knee.position", "left_knee.velocity", "trunk.tilt_forward")


def batch(
    seq: int,
    rows: int = 1,
    *,
    dropped: int = 0,
    missed: int = 0,
    link: int = 1,
    channels: tuple[str, ...] = CHANNELS,
    missing: tuple[str, ...] = (),
) -> Batch:
    """Notification `seq`; row r of channel c holds seq + r / 1000 + c, or None where it is `missing`."""
    columns: dict[str, list[float | None]] = {
        name: [None if name in missing else value(seq, row, c) for row in range(rows)]
        for c, name in enumerate(channels)
    }
    stamps_ns = [stamp_ns(seq, row) for row in range(rows)]
    return Batch(stamps_ns, columns, seq, dropped, missed, link, time.monotonic_ns())


def value(seq: int, row: int, column: int) -> float:
    return seq + row / 1000 + column


def stamp_ns(seq: int, row: int) -> int:
    return 5_000_000_000 + seq * 10_000_000 + row * 1_000_000


def description(name: str) -> Description:
    return described(name, dict(zip(CHANNELS, ("rad", "rad/s", "rad"), strict=True)))


def described(name: str, units: dict[str, str]) -> Description:
    """A robot with these channels, and their units."""
    found = {
        "robot": name,
        "boot_id": "boot-1",
        "role": "observer",
        "components": [],
        "channels": [
            {
                "name": key,
                "unit": unit,
                "component": key.partition(".")[0],
                "quantity": key.partition(".")[2],
            }
            for key, unit in units.items()
        ],
        "parameters": [],
        "modules": {},
        "clock": {"monotonic_ns": 1, "utc_ns": 2, "boot_id": "boot-1"},
        "stop": {"held": False, "reason": None, "since_ns": None, "stopped_again": {}, "drives": {}},
        "guard": {},
    }
    return msgspec.convert(found, Description)
