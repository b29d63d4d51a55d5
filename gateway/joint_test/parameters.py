"""Every number that can be set in a drive: read before a test and after it, and given back where it changed.

What is a command or a setpoint is no parameter. What the drive refuses to tell is not there.
"""

from collections.abc import Callable, Iterator, Mapping

from drivers.bus.sdo.channel import SdoChannel
from drivers.errors import DeviceAbort, DriverError
from drivers.joint.setpoint import SETPOINTS
from eds import Description
from eds.datatypes import DATA_TYPES, DataType

Parameters = Mapping[str, int | str]  # by "0x6072:0"
Change = tuple[int | str, int | str | None]  # before, after

_TEXTS = (0x1008, 0x1009, 0x100A)  # name, hardware, firmware
_IDENTITY = 0x1018
_OWN, _PROFILE = range(0x2000, 0x5000), range(0x6000, 0xA000)  # makers keep commands from 5000h on
_AXIS = range(0x800)
_COMMANDS = frozenset({0x6040, 0x60FE, *(index for index, *_ in SETPOINTS.values())})


def read(sdo: SdoChannel, description: Description, offset: int, wanted: Callable[[], bool]) -> Parameters:
    """All of an axis (`offset` above the first one's), as long as that is `wanted`; raises `DriverError`."""
    found: dict[str, int | str] = {}
    for index, subindex, kind in _readable(description, offset):
        if not wanted():
            raise DriverError("its parameters are not read any further: a stop was asked for")
        try:
            data = sdo.upload(index, subindex)
        except DeviceAbort:
            continue  # its EDS knows it, this device does not
        found[name_of(index, subindex)] = _value(data, kind)
    return found


def changed(before: Parameters, after: Parameters) -> dict[str, Change]:
    """Return the differences, by name."""
    return {name: (was, after.get(name)) for name, was in before.items() if was != after.get(name)}


def put_back(sdo: SdoChannel, description: Description, before: Parameters, names: Iterator[str]) -> None:
    """Write these as they were; raises `DriverError`. Whoever calls it reads all again."""
    kinds = {name_of(one.index, one.subindex): one for one in description.variables() if one.writable}
    for name in names:
        value, variable = before[name], kinds.get(name)
        bits = None if variable is None else _integer(variable.data_type)
        if variable is None or bits is None or bits.bits is None or not isinstance(value, int):
            continue
        data = (value & (1 << bits.bits) - 1).to_bytes(bits.bits // 8, "little")
        sdo.download(variable.index, variable.subindex, data)


def _readable(description: Description, offset: int) -> Iterator[tuple[int, int, DataType | None]]:
    """Yield index, sub-index and type; no type: a text."""
    yield from ((index, 0, None) for index in _TEXTS if description.has(index))
    for one in description.variables():
        kind = _integer(one.data_type)
        if kind is None:
            continue
        identity = one.index == _IDENTITY and one.subindex > 0
        if identity or (one.readable and one.writable and _is_parameter(one.index, offset)):
            yield one.index, one.subindex, kind


def _is_parameter(index: int, offset: int) -> bool:
    of_axis = index in _PROFILE and index - offset - _PROFILE.start in _AXIS
    return index in _OWN or (of_axis and index - offset not in _COMMANDS)


def _integer(data_type: int | None) -> DataType | None:
    kind = DATA_TYPES.get(data_type or 0)
    return kind if kind is not None and kind.kind in ("signed", "unsigned") and kind.bits else None


def _value(data: bytes, kind: DataType | None) -> int | str:
    if kind is None or kind.bits is None:
        return data.rstrip(b"\0").decode("ascii", errors="replace")
    return int.from_bytes(data[: (kind.bits + 7) // 8], "little", signed=kind.kind == "signed")


def name_of(index: int, subindex: int) -> str:
    """Return the name of an object, as in `Parameters`."""
    return f"0x{index:04X}:{subindex}"
