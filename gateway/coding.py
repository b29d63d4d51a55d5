"""A parameter's number as its device holds it: bytes, type and scale, exactly.

value = device's number · scale. Scaling is decimal, so that 0.42 m at 0.001 m a count is 420 counts and
0.42 m again. A whole number stays one, so that all 64 bits of an integer survive; what would lose digits is
refused.
"""

import math
import struct
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal
from enum import StrEnum
from typing import Protocol

from drivers.bus.values import decode, size_of
from eds.datatypes import DATA_TYPE_BY_NAME, DATA_TYPES, DataType

Number = int | float

NUMBERS = ("boolean", "signed", "unsigned", "real")  # the kinds of data types that are numbers
LONGEST_TEXT = 4096  # characters of what is no number; more of it is counted
_UNICODE_STRING = 0x0B
EXACT_COUNTS = 2**52  # below, a count and its value with a decimal point lead to each other
_REAL_FORMATS = {32: "<f", 64: "<d"}


class CodingError(ValueError):
    """Bytes that mean no number, or a number that the type cannot hold exactly."""


def scaled(number: Number, scale: float) -> Number:
    """Return `number` · `scale`; whole numbers stay whole."""
    if isinstance(number, int) and scale.is_integer():
        return number * int(scale)
    return float(Decimal(repr(number)) * Decimal(repr(scale)))


def text(value: Number) -> str:
    """Return a value with every digit that a person needs to tell it from another one."""
    return str(value) if isinstance(value, int) else f"{value:.10g}"


def words(data: bytes, data_type: int) -> str:
    """Return a value that is no number: a text as it is, other bytes in hexadecimal.

    A long one ends in its length.
    """
    if DATA_TYPES[data_type].kind == "text":
        encoding = "utf-16-le" if data_type == _UNICODE_STRING else "utf-8"
        said = data.decode(encoding, errors="replace").rstrip("\0")
        said = "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in said)
    else:
        said = data[:LONGEST_TEXT].hex(" ")
    return said if len(said) <= LONGEST_TEXT else f"{said[:LONGEST_TEXT]} … ({len(data)} bytes)"


@dataclass(frozen=True, slots=True)
class Coding:
    """Encoding of one object's value: its CiA 301 data type (by code) and its scale."""

    data_type: int
    scale: float = 1.0

    @property
    def type(self) -> DataType:
        return DATA_TYPES[self.data_type]

    def decode(self, data: bytes) -> Number:
        """Return the value that the bytes mean.

        Raises:
            CodingError: they mean no number, or none that can be told exactly at this scale.

        """
        number = decode(data, self.data_type)
        if number is None or not math.isfinite(number) or (self.type.kind == "boolean" and number > 1):
            raise CodingError(f"{data.hex(' ')} is no {self.type.name}")
        if self.type.kind == "real":
            return self._finite(number * self.scale)
        value = scaled(number, self.scale)
        if isinstance(value, float) and abs(number) >= EXACT_COUNTS:
            raise CodingError(f"{number} cannot be told exactly at a scale of {self.scale:g}; use scale = 1")
        return value

    def encode(self, value: Number) -> bytes:
        """Return the bytes nearest to the value.

        Raises:
            CodingError: it does not fit, or has lost digits on its way here.

        """
        if self.type.kind == "real":
            return self._real(value / self.scale)
        counts = int((Decimal(repr(value)) / Decimal(repr(self.scale))).to_integral_value(ROUND_HALF_EVEN))
        if isinstance(value, float) and abs(counts) >= EXACT_COUNTS:
            raise CodingError(f"{value!r} may have lost digits; write so large a number as a whole one")
        if self.type.kind == "boolean" and counts not in (0, 1):
            raise CodingError(f"{text(value)} is neither 0 nor 1, which a BOOLEAN is")
        try:
            size = size_of(self.data_type) or 0
            return counts.to_bytes(size, "little", signed=self.type.kind == "signed")
        except OverflowError as error:
            raise CodingError(
                f"{text(value)} is {counts} for the device, which does not fit {self.type.name}"
            ) from error

    def nearest(self, limit: Number) -> Number:
        """Return a limit as its device can hold it: the REAL32 that is nearest to 0.6 lies above it."""
        if self.type.kind != "real":
            return limit
        try:
            return self.decode(self.encode(limit))
        except CodingError:
            return limit  # beyond all that it can hold

    def _real(self, number: float) -> bytes:
        try:
            return struct.pack(_REAL_FORMATS[self.type.bits or 0], self._finite(number))
        except OverflowError as error:
            raise CodingError(f"{number:g} does not fit {self.type.name}") from error

    def _finite(self, number: float) -> float:
        if not math.isfinite(number):
            raise CodingError(f"{number:g} is no finite {self.type.name}")
        return number


def coding_of(type_name: str, scale: float) -> Coding | None:
    """Return the coding of a parameter as a robot describes it; `None` where it does not tell its type."""
    code = DATA_TYPE_BY_NAME.get(type_name)
    return None if code is None else Coding(code, scale)


class Limit(StrEnum):
    """A limit of a value, by its key in the robot's file."""

    MIN = "min"
    MAX = "max"
    MAX_STEP = "max_step"


class Limited(Protocol):
    """A parameter, as a robot describes it or as it holds it itself."""

    @property
    def min(self) -> Number | None: ...

    @property
    def max(self) -> Number | None: ...

    @property
    def max_step(self) -> float | None: ...


def broken_limit(
    parameter: Limited, coding: Coding | None, value: Number, before: Number | None = None
) -> Limit | None:
    """Return the first limit that a value exceeds, as the device would hold it; `None` for no limit.

    `before` is what it would take the place of. A step of exactly the largest, in binary, is none too far.
    """

    def held(limit: Number) -> Number:
        return limit if coding is None else coding.nearest(limit)

    least, most, step = parameter.min, parameter.max, parameter.max_step
    if least is not None and value < held(least):
        return Limit.MIN
    if most is not None and value > held(most):
        return Limit.MAX
    if step is not None and before is not None and abs(value - before) > step * (1 + 1e-9):
        return Limit.MAX_STEP
    return None
