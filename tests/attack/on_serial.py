"""Bytes that a hostile or broken sensor sends: of no format, and nearly of one."""

import itertools
import math
import random
from collections.abc import Callable, Iterator

from hil_sim.gait.wearer import GRAVITY
from hil_sim.sensors.serial_sensor import M, SerialFormat, Tick
from hil_sim.sensors.sole import Pressures
from hil_sim.sensors.suite import INSOLES, SERIAL_IMUS
from hil_sim.sensors.trunk_imu import Motion

PIECE = 512  # bytes
TICK_NS = 10_000_000  # between two frames of a healthy one
PERIOD_S = 0.0015  # a piece each: faster than any of these lines
FORMATS = (*INSOLES, *SERIAL_IMUS)

_BEAT_S = 2.0  # of one step


def healthy(format_name: str, *, right: bool) -> tuple[int, Iterator[bytes]]:
    """The baud rate of a sensor, and its frames for ever."""
    if format_name in INSOLES:
        insole, cells = INSOLES[format_name]
        return insole.baudrate, _frames(insole, lambda number: _pressures(number, len(cells), right))
    return SERIAL_IMUS[format_name].baudrate, _frames(SERIAL_IMUS[format_name], _motion)


def _frames(language: SerialFormat[M], measured: Callable[[int], M]) -> Iterator[bytes]:
    yield language.banner
    for number in itertools.count(1):
        yield language.encode(measured(number), Tick(number, number * TICK_NS))


def _swing(number: int) -> float:
    return math.sin(math.tau * number * TICK_NS / 1e9 / _BEAT_S)


def _pressures(number: int, cells: int, right: bool) -> Pressures:
    load = max(0.0, 30_000.0 * _swing(number) * (-1 if right else 1))
    return Pressures(right, tuple(load * (1 + 0.01 * cell) for cell in range(cells)), saturated=False)


def _motion(number: int) -> Motion:
    """The trunk nods a little."""
    pitch = 0.05 * _swing(number)
    orientation = (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0)
    force = (-GRAVITY * math.sin(pitch), 0.0, GRAVITY * math.cos(pitch))
    rate = (0.0, 0.05 * math.tau / _BEAT_S * math.cos(math.asin(_swing(number))), 0.0)
    return Motion((0.0, pitch, 0.0), orientation, force, rate, 30.0)


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
