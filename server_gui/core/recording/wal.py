"""Commits in a write-ahead log behind damage, which SQLite would skip silently.

A log is read up to the first frame whose checksum is wrong, as if nothing had followed. Where frames of the
same log follow, they were written, and all but the last commit of them had been synchronised. The last one
had been where the log's index says so, of which SQLite writes the header only then: it is there after a kill,
and after a power cut perhaps an older one or none. Layout and checksums:
https://sqlite.org/fileformat2.html#the_write_ahead_log, https://sqlite.org/walformat.html#the_wal_index_header.
"""

import functools
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import numpy as np
import numpy.typing as npt

HEADER: Final = struct.Struct(">8I")  # magic, version, page size, checkpoint, two salts, two checksums
FRAME: Final = struct.Struct(">6I")  # page, size of the database after a commit, two salts, two checksums
INDEX: Final = struct.Struct("=16xI12x8s2I")  # frames, the log's salts, two checksums; it is there twice
_SALTS: Final = struct.Struct(">2I")
_MAGIC: Final = {0x377F0682: "<u4", 0x377F0683: ">u4"}  # how its checksums take words
_SUM_BYTES: Final = 8
_SUMMED: Final = 8  # bytes of a frame's header that its checksum is of
_Words = npt.NDArray[np.uint32]

Pair = tuple[int, int]


class _Frame(NamedTuple):
    is_commit: bool
    salts: Pair
    sum: Pair
    data: bytes  # of which the sum is, after that of the frame before


def lost_commits(log: Path, page_bytes: int) -> int:
    """Count the commits of this log that SQLite will not read, for damage in or before them.

    Without the newest, where nothing says that it was synchronised: it was under way when the power went.
    0 where there is no log, or all of it is whole. `page_bytes` is for a log whose header is damaged.
    """
    try:
        with log.open("rb") as opened:
            lost = _lost(opened, page_bytes)
    except FileNotFoundError:
        return 0
    if lost and not _was_synchronised(log, lost[-1]):
        lost.pop()
    return len(lost)


class _Place(NamedTuple):
    """Place of a commit's end in a log: the frame, counted from 1."""

    frame: int
    salts: Pair


def _lost(log: BinaryIO, page_bytes: int) -> list[_Place]:
    raw = log.read(HEADER.size)
    if len(raw) < HEADER.size:
        return []
    magic, _, told_bytes, _, *rest = HEADER.unpack(raw)
    salts, known = (rest[0], rest[1]), (rest[2], rest[3])
    order = _MAGIC.get(magic, "")
    is_whole = bool(order) and _sum((0, 0), raw[:-_SUM_BYTES], order) == known
    lost = []
    for number, frame in enumerate(_frames(log, told_bytes if is_whole else page_bytes), 1):
        is_whole = is_whole and frame.salts == salts and _sum(known, frame.data, order) == frame.sum
        known = frame.sum
        if not is_whole and frame.is_commit and _alike(frame.salts, salts):
            lost.append(_Place(number, frame.salts))
    return lost


def _was_synchronised(log: Path, commit: _Place) -> bool:
    """Return whether the log's index, as it was left, knows this commit."""
    try:
        headers = log.with_name(f"{log.name.removesuffix('-wal')}-shm").read_bytes()[: 2 * INDEX.size]
    except FileNotFoundError:
        return False
    found = [headers[: INDEX.size], headers[INDEX.size :]]
    return any(len(each) == INDEX.size and _knows(each, commit) for each in found)


def _knows(header: bytes, commit: _Place) -> bool:
    frames, salts, *known = INDEX.unpack(header)
    words = "<u4" if sys.byteorder == "little" else ">u4"
    is_whole = _sum((0, 0), header[:-_SUM_BYTES], words) == tuple(known)
    return is_whole and frames >= commit.frame and _alike(_SALTS.unpack(salts), commit.salts)


def _alike(one: Pair, other: Pair) -> bool:
    """Return whether they are of one log, as far as damage shows: in an earlier log both differ."""
    return one[0] == other[0] or one[1] == other[1]


def _frames(log: BinaryIO, page_bytes: int) -> Iterator[_Frame]:
    size = FRAME.size + page_bytes
    while len(raw := log.read(size)) == size:
        _, commit, *rest = FRAME.unpack_from(raw)
        yield _Frame(commit > 0, (rest[0], rest[1]), (rest[2], rest[3]), raw[:_SUMMED] + raw[FRAME.size :])


def _sum(before: Pair, data: bytes, order: str) -> Pair:
    """SQLite's checksum, which goes on from `before`: for words x, y in turn a += x + b, then b += y + a."""
    words = np.frombuffer(data, order).astype(np.uint32).reshape(-1, 2)
    weights, (aa, ab, bb) = _weights(len(words))
    a, b = (int((words * mine).sum(dtype=np.uint32)) for mine in weights)
    return (a + aa * before[0] + ab * before[1]) % (1 << 32), (b + ab * before[0] + bb * before[1]) % (
        1 << 32
    )


@functools.lru_cache(4)
def _weights(count: int) -> tuple[tuple[_Words, _Words], tuple[int, int, int]]:
    """Return the weight of each word in a and b, and of the earlier sums: powers of ((1, 1), (1, 2))."""
    for_a, for_b = [], []
    aa, ab, bb = 1, 0, 1
    for _ in range(count):
        for_a.append((aa + ab, ab))
        for_b.append((ab + bb, bb))
        aa, ab, bb = (each % (1 << 32) for each in (aa + ab, aa + 2 * ab, ab + 2 * bb))
    weights_a, weights_b = (np.array(each[::-1]).astype(np.uint32) for each in (for_a, for_b))
    return (weights_a, weights_b), (aa, ab, bb)
