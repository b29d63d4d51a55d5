"""Inputs made of a corpus, always the same ones: what is tried where nothing guides the search."""

import random
import re
from collections.abc import Callable, Iterator, Sequence

MOST_EDITS = 4
LONGEST = 4096
INTERESTING = (0, 1, 0x7F, 0x80, 0xFE, 0xFF)
WIDTHS = (8, 16, 31, 32, 63, 64)  # of whole numbers, in bits
BOUNDS = (b"-1", *(b"%d" % (2**bits + more) for bits in WIDTHS for more in (-1, 0)))
_NUMBER = re.compile(rb"-?\d+")

Edit = Callable[[random.Random, bytes], bytes]


def mutations(corpus: Sequence[bytes], tokens: Sequence[bytes], seed: int) -> Iterator[bytes]:
    """For ever; equal arguments give equal inputs."""
    choice = random.Random(seed)
    known = list(corpus) or [b""]

    def insert_token(_choice: random.Random, data: bytes) -> bytes:
        at = choice.randint(0, len(data))
        return data[:at] + choice.choice(tokens) + data[at:]

    def cross(_choice: random.Random, data: bytes) -> bytes:
        other = choice.choice(known)
        return data[: choice.randint(0, len(data))] + other[choice.randint(0, len(other)) :]

    edits: tuple[Edit, ...] = (
        _flip,
        _set,
        _cut,
        _repeat,
        _insert,
        at_bound,
        insert_token,
        insert_token,
        cross,
    )
    while True:
        data = choice.choice(known)
        for _ in range(choice.randint(1, MOST_EDITS)):
            data = choice.choice(edits)(choice, data)
        yield data[:LONGEST]


def at_bound(choice: random.Random, data: bytes) -> bytes:
    """One of the numbers that stand in it as digits becomes the last that a width holds, or the next one."""
    numbers = list(_NUMBER.finditer(data))
    if not numbers:
        return data
    one = choice.choice(numbers)
    return data[: one.start()] + choice.choice(BOUNDS) + data[one.end() :]


def _flip(choice: random.Random, data: bytes) -> bytes:
    if not data:
        return data
    at = choice.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << choice.randrange(8)]) + data[at + 1 :]


def _set(choice: random.Random, data: bytes) -> bytes:
    if not data:
        return data
    at = choice.randrange(len(data))
    return data[:at] + bytes([choice.choice(INTERESTING)]) + data[at + 1 :]


def _cut(choice: random.Random, data: bytes) -> bytes:
    at = choice.randint(0, len(data))
    return data[:at] + data[at + choice.randint(1, 16) :]


def _repeat(choice: random.Random, data: bytes) -> bytes:
    at = choice.randint(0, len(data))
    return data[:at] + data[at : at + choice.randint(1, 64)] * choice.choice((2, 2, 3, 40)) + data[at:]


def _insert(choice: random.Random, data: bytes) -> bytes:
    at = choice.randint(0, len(data))
    return data[:at] + choice.randbytes(choice.randint(1, 8)) + data[at:]
