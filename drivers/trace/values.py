"""Values of objects in words: by the data type that the EDS says, and what the standard's numbers mean."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.bus.values import decode
from drivers.error_codes import error_text
from drivers.joint.cia402 import MODES, drive_state
from drivers.joint.quantities import AXIS_OFFSET
from eds import Description
from eds.datatypes import DATA_TYPES

_AXES = range(0x6000, 0xA000)
_LONGEST = 64  # letters or bytes that are shown of a long value


@dataclass(frozen=True, slots=True)
class Value:
    """One object and what it held; without an EDS, `name` is `None` and the value its bytes."""

    index: int
    subindex: int
    name: str | None
    value: int | float | str | None
    words: str

    @property
    def address(self) -> str:
        return f"{self.index:04X}h:{self.subindex:02X}"

    def __str__(self) -> str:
        return f"{self.label} = {self.words}"

    @property
    def label(self) -> str:
        return self.address if self.name is None else f"{self.address} {self.name}"


def label(description: Description | None, index: int, subindex: int) -> str:
    """Return an object by address and name."""
    variable = None if description is None else description.variable(index, subindex)
    return Value(index, subindex, None if variable is None else variable.qualname, None, "").label


def value_of(description: Description | None, index: int, subindex: int, data: bytes) -> Value:
    """Return bytes of an object as its EDS has them."""
    variable = None if description is None else description.variable(index, subindex)
    name = None if variable is None else variable.qualname
    known = None if variable is None else DATA_TYPES.get(variable.data_type or 0)
    if known is not None and known.kind == "text":
        text = data.decode("utf-16-le" if known.name == "UNICODE_STRING" else "latin-1", "replace")
        text = text.rstrip("\0 ")
        return Value(index, subindex, name, text, f'"{text[:_LONGEST]}"')
    number = None if variable is None else decode(data, variable.data_type or 0)
    if number is None or known is None:
        return Value(index, subindex, name, data.hex(), _hex(data))
    return Value(index, subindex, name, number, _in_words(index, subindex, number))


def _hex(data: bytes) -> str:
    more = f" … {len(data)} bytes" if len(data) > _LONGEST // 4 else ""
    return (data[: _LONGEST // 4].hex(" ").upper() + more) or "nothing"


def _state(number: int) -> str:
    state = drive_state(number)
    return "no state of CiA 402" if state is None else state.words


_WORDS: dict[int, Callable[[int], str]] = {
    0x603F: lambda number: error_text(number, None),
    0x6041: lambda number: f"0x{number:04X} ({_state(number)})",
    0x6040: lambda number: f"0x{number:04X}",
    0x6060: lambda number: f"{number} ({MODES.get(number, 'a mode of the maker')})" if number else "0",
    0x6061: lambda number: f"{number} ({MODES.get(number, 'a mode of the maker')})" if number else "0",
    0x60FD: lambda number: f"0x{number:08X}",
    0x6502: lambda number: f"0x{number:08X}",
}
# Identifiers and bits, not amounts (CiA 301 §7.5.2): objects, and the sub-indices of which that is so.
_HEXADECIMAL: tuple[tuple[range, range], ...] = (
    (range(0x1000, 0x1006), range(256)),
    (range(0x1010, 0x1013), range(1, 256)),
    (range(0x1012, 0x1015), range(1)),
    (range(0x1016, 0x1017), range(1, 256)),
    (range(0x1018, 0x1019), range(1, 4)),
    (range(0x1200, 0x1300), range(1, 3)),
    (range(0x1400, 0x1600), range(1, 2)),
    (range(0x1600, 0x1800), range(1, 256)),
    (range(0x1800, 0x1A00), range(1, 2)),
    (range(0x1A00, 0x1C00), range(1, 256)),
)


def _in_words(index: int, subindex: int, number: float) -> str:
    if not isinstance(number, int):
        return f"{number:g}"
    of_axis = (index - 0x6000) % AXIS_OFFSET + 0x6000 if index in _AXES else index
    words = _WORDS.get(of_axis)
    if words is not None:
        return words(number)
    is_bits = any(index in indices and subindex in members for indices, members in _HEXADECIMAL)
    return f"0x{number:X}" if is_bits else str(number)
