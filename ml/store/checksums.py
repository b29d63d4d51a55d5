"""A number a row, and their sum over many: the same in whatever files, order or columns of null they are.

The sum (modulo 2^64) of mixed values times an odd constant of their column, mixed again with all of its row:
a flipped bit, a value in another column or row, a row too few or twice make another sum. No secret is in it:
it tells damage, not forgery.
"""

import functools
import hashlib
from collections.abc import Mapping
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa

Sums = npt.NDArray[np.uint64]

_HALF: Final = np.uint64(32)
_FIRST: Final = (np.uint64(30), np.uint64(0xBF58476D1CE4E5B9))  # splitmix64 (Steele et al. 2014)
_SECOND: Final = (np.uint64(27), np.uint64(0x94D049BB133111EB))
_LAST: Final = np.uint64(31)
_encoder = msgspec.msgpack.Encoder()


def of_numbers(rows: pa.RecordBatch, same: Mapping[str, str]) -> Sums:
    """Return a number a row of numbers, times and texts; `same` are columns that are alike in all of them."""
    found = np.full(rows.num_rows, _of_texts(same), np.uint64)
    for name, column in zip(rows.schema.names, rows.columns, strict=True):
        if column.null_count == len(column):
            continue
        factor, term = _constants(name)
        mixed = _bits(column)
        mixed = (mixed >> _HALF) ^ mixed
        mixed *= factor
        mixed += term
        if column.null_count:
            mixed[column.is_null().to_numpy(zero_copy_only=False)] = 0
        found += mixed
    return _mixed(found)


def of_rows(rows: pa.Table) -> Sums:
    """Return a number a row of whatever columns."""
    return np.array([_of_fields(fields) for fields in rows.to_pylist()], np.uint64)


def told(total: int) -> str:
    """Return the sum of such numbers, as it is written."""
    return f"{total % (1 << 64):016x}"


def _of_fields(fields: Mapping[str, object]) -> int:
    return _digest(_encoder.encode(sorted((key, each) for key, each in fields.items() if each is not None)))


def _of_texts(fields: Mapping[str, str]) -> np.uint64:
    return np.uint64(sum(_digest(f"{name}={value}".encode()) for name, value in fields.items()) % (1 << 64))


def _bits(column: pa.Array) -> Sums:
    """Return the 64 bits of a number or time, of a text those of its digest."""
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        coded = column.dictionary_encode()
        known = np.array([_digest(each.encode()) for each in coded.dictionary.to_pylist()], np.uint64)
        places: npt.NDArray[np.int64] = coded.indices.fill_null(0).to_numpy(zero_copy_only=False)
        return known[places]
    # Straight from Arrow's memory: where something is null, what lies there is whatever it is.
    buffer = column.buffers()[1]
    return np.frombuffer(buffer, np.uint64, len(column), column.offset * 8)


def _mixed(each: Sums) -> Sums:
    for shift, factor in (_FIRST, _SECOND):
        each ^= each >> shift
        each *= factor
    each ^= each >> _LAST
    return each


@functools.lru_cache(10_000)
def _constants(name: str) -> tuple[np.uint64, np.uint64]:
    """Return a column's factor, which is odd, and what each of its values that is there adds."""
    factor, term = (_digest(f"{part} {name}".encode()) for part in ("factor", "term"))
    return np.uint64(factor | 1), np.uint64(term)


def _digest(data: bytes) -> int:
    return int.from_bytes(hashlib.blake2b(data, digest_size=8).digest(), "little")
