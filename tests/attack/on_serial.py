"""Bytes that a hostile or broken sensor sends: of no format, and nearly of one."""

import random
from collections.abc import Iterator

from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.sole import Pressures
from hil_sim.sensors.suite import INSOLES, SERIAL_IMUS
from hil_sim.sensors.trunk_imu import Motion

PIECE = 512  # bytes
PERIOD_S = 0.0015  # a piece each: faster than any of these lines
FORMATS = (*INSOLES, *SERIAL_IMUS)

_STILL = Motion((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (0.0, 0.0, 0.0), 30.0)


def healthy(format_name: str, *, right: bool) -> tuple[int, Iterator[bytes]]:
    """The baud rate of a sensor, and its frames for ever."""
    if format_name in INSOLES:
        insole, cells = INSOLES[format_name]
        return insole.baudrate, _frames(insole, Pressures(right, (20_000.0,) * len(cells), saturated=False))
    return SERIAL_IMUS[format_name].baudrate, _frames(SERIAL_IMUS[format_name], _STILL)


def _frames(language: SerialFormat[Pressures] | SerialFormat[Motion], measured: object) -> Iterator[bytes]:
    yield language.banner
    number = 0
    while True:
        number += 1
        yield language.encode(measured, Tick(number, number * 10_000_000))  # type: ignore[arg-type]


def hostile(format_name: str) -> Iterator[bytes]:
    """Pieces for ever: noise, one byte again and again, no end of a frame, damaged frames, frames cut off."""
    chance = random.Random(format_name)
    _, frames = healthy(format_name, right=False)
    next(frames)
    while True:
        frame = next(frames)
        yield chance.choice(
            (
                chance.randbytes(PIECE),
                bytes([chance.randrange(256)]) * PIECE,
                frame[:1] * PIECE,
                b"9" * PIECE,
                b"$;,-+.eE*"[: 1 + chance.randrange(9)] * 64,
                _damaged(chance, frame) * 4,
                frame[: 1 + chance.randrange(len(frame))] * 8,
                bytes([*frame[:2], *chance.randbytes(2), 255, 255]) * 32,  # as long as it can say
            )
        )[:PIECE]


def _damaged(chance: random.Random, frame: bytes) -> bytes:
    damaged = bytearray(frame)
    for _ in range(1 + chance.randrange(3)):
        damaged[chance.randrange(len(damaged))] = chance.randrange(256)
    return bytes(damaged)
