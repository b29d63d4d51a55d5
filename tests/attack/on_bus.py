"""Frames that a hostile, broken or merely foreign device puts on the robot's bus.

Each is an endless iterator; the drives' process sends it as fast as the bus can carry (`_bus.py`). Remote
frames are not among them: socketcand, which carries this bus, has none. Where an attack is one of a device
that should be ours, it is the last one (`LIAR`): the others are to be stopped all the same.
"""

import random
import struct
from collections.abc import Callable, Iterator, Mapping

from tests.bench._drives import DRIVES

Frame = tuple[int, bytes]

LIAR = DRIVES
BAD_ANSWERS = "sdo-answers"
STRANGE_STATES = tuple(state for state in range(1, 256) if state & 0x7F not in (0, 4, 5, 127))


def foreign(chance: random.Random) -> Iterator[Frame]:
    """Identifiers that nobody of ours has, 11 and 29 bits."""
    while True:
        can_id = chance.choice((chance.randrange(0x290, 0x580), chance.randrange(0x800, 0x2000_0000)))
        yield can_id, chance.randbytes(8)


def lengths(chance: random.Random) -> Iterator[Frame]:
    """The last drive's PDO, each time as long as it should not be."""
    while True:
        yield 0x180 + LIAR, chance.randbytes(chance.randrange(8))


def emergencies(chance: random.Random) -> Iterator[Frame]:
    """EMCYs of every drive, with any code, some of them cut off."""
    while True:
        code = struct.pack("<HB", chance.randrange(1, 0x10000), chance.randrange(256)) + chance.randbytes(5)
        yield 0x080 + chance.randint(1, DRIVES), code[: chance.choice((8, 8, 8, 3))]


def life_noise(chance: random.Random) -> Iterator[Frame]:
    """States that there are not for every node, also as long as none is; boot-ups of the last drive."""
    while True:
        if chance.random() < 0.02:
            yield 0x700 + LIAR, b"\0"
        else:
            state = bytes([chance.choice(STRANGE_STATES)])
            yield 0x700 + chance.randint(1, DRIVES), chance.choice((state, state, b"", state * 8))


def stray_answers(chance: random.Random) -> Iterator[Frame]:
    """SDO answers that nobody has asked for, of the last drive."""
    while True:
        yield 0x580 + LIAR, chance.randbytes(chance.choice((8, 8, 8, 1, 0)))


def bad_answer(chance: random.Random, reply: bytes) -> bytes:
    """What a node answers instead of this: as it is said, and as it is not."""
    command, index, subindex = struct.unpack_from("<BHB", reply.ljust(4, b"\0"))
    return chance.choice(
        (
            reply[: chance.randrange(8)],
            bytes(8),
            b"\xff" * 8,
            struct.pack("<BHBI", command, index ^ 0x0101, subindex, 0),
            struct.pack("<BHBI", 0x41, index, subindex, 0xFFFF_FFFF),  # four gigabytes follow
            struct.pack("<BHBI", 0x80, index, subindex, chance.randrange(1 << 32)),
            struct.pack("<BHBI", chance.randrange(256), index, subindex, chance.randrange(1 << 32)),
        )
    )


HOSTILE: Mapping[str, Callable[[random.Random], Iterator[Frame]]] = {
    "bus-load": foreign,
    "pdo-lengths": lengths,
    "emcy-flood": emergencies,
    "life-noise": life_noise,
    BAD_ANSWERS: stray_answers,
}
# Those whose attacker is the last drive itself: it is not asked how soon it got a stop.
OF_A_DRIVE = frozenset({BAD_ANSWERS, "life-noise"})
