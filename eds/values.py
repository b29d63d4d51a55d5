"""Values of objects as EDS files write them, and as the importer takes them (CiA 306-1 §4.3)."""

import math
import re
from collections.abc import Callable

from eds.datatypes import DataType
from eds.numbers import parse_integer, parse_relative


def in_type(number: int, data_type: DataType) -> int | None:
    """Return the number as its type has it: files write -1 as 0xFFFFFFFF.

    `None` where the type cannot hold it.
    """
    bits = data_type.bits or 64
    low, high = (-(1 << bits - 1), 1 << bits - 1) if data_type.kind == "signed" else (0, 1 << bits)
    if low <= number < high:
        return number
    is_negative = data_type.kind == "signed" and high <= number < 1 << bits
    return number - (1 << bits) if is_negative else None


def canonical(text: str, data_type: DataType) -> tuple[str | None, str]:
    """Return the value as the importer takes it, `None` where there is none.

    And what is wrong with it, or "".
    """
    if not text:
        return None, ""
    value = _FORMS[data_type.kind](text)
    if value is None:
        return None, f"{text!r} is no clear {data_type.name}; left out"
    if data_type.kind not in ("boolean", "signed", "unsigned") or parse_relative(text) is not None:
        return value, ""
    number = in_type(int(value), data_type)
    return (None, f"{text!r} is outside {data_type.name}; left out") if number is None else (str(number), "")


def _integer(text: str) -> str | None:
    relative = parse_relative(text)
    if relative is not None:
        return f"$NODEID+0x{relative:X}"
    number = parse_integer(text)
    return None if number is None else str(number)


def _boolean(text: str) -> str | None:
    return {"true": "1", "false": "0"}.get(text.lower()) or _integer(text)


def _bytes(text: str) -> str | None:
    digits = re.sub(r"\s|0[xX]", "", text)
    return digits if re.fullmatch(r"(?:[0-9A-Fa-f]{2})*", digits) and digits else None


def _real(text: str) -> str | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return None if math.isnan(number) else repr(number)


_FORMS: dict[str, Callable[[str], str | None]] = {
    "boolean": _boolean,
    "signed": _integer,
    "unsigned": _integer,
    "real": _real,
    "text": lambda text: text,
    "bytes": _bytes,
}
