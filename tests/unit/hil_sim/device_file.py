"""Writes EDS files of devices that no vendor makes: just the objects that a test is about."""

from pathlib import Path
from typing import Any

BOOLEAN, INTEGER8, INTEGER16, INTEGER32, UNSIGNED8, UNSIGNED16, UNSIGNED32 = range(1, 8)
REAL32, VISIBLE_STRING, OCTET_STRING, UNICODE_STRING, TIME_OF_DAY = range(8, 13)
DOMAIN, INTEGER24, REAL64, INTEGER64, UNSIGNED24, UNSIGNED64 = 0x0F, 0x10, 0x11, 0x15, 0x16, 0x1B

_HEAD = """\
[FileInfo]
FileName=device.eds
[DeviceInfo]
VendorName=Nobody
ProductName=Test device
NrOfRXPDO=2
NrOfTXPDO=4
[DummyUsage]
Dummy0001=0
Dummy0002=1
Dummy0003=1
Dummy0004=1
Dummy0005=1
Dummy0006=1
Dummy0007=1
"""

_LIMITS = {"low": "LowLimit", "high": "HighLimit", "value": "ParameterValue"}


class DeviceFile:
    """Objects one after the other, then `write`."""

    def __init__(self) -> None:
        self._sections: list[str] = []
        self._records: set[int] = set()

    def add(
        self,
        index: int,
        subindex: int | None,
        data_type: int,
        default: Any = "",
        access: str = "rw",
        mapping: bool = False,
        **more: Any,
    ) -> "DeviceFile":
        """One object; `subindex` `None` for a variable. `more` is `low`, `high` and `value` (of a DCF)."""
        name = f"{index:04X}" if subindex is None else f"{index:04X}sub{subindex:X}"
        if subindex is not None and index not in self._records:
            self._records.add(index)
            self._sections.append(f"[{index:04X}]\nParameterName=Record {index:04X}\nObjectType=9\n")
        lines = [f"[{name}]", f"ParameterName=Object {name}", "ObjectType=7", f"DataType={data_type}"]
        lines += [f"AccessType={access}", f"DefaultValue={default}", f"PDOMapping={int(mapping)}"]
        lines += [f"{_LIMITS[key]}={value}" for key, value in more.items()]
        self._sections.append("\n".join(lines) + "\n")
        return self

    def pdo(self, number: int, received: bool, cob_id: str, kind: int, *mapped: int) -> "DeviceFile":
        """A PDO with eight places in its mapping, an event timer and a SYNC start value."""
        communication, mapping = (0x1400, 0x1600) if received else (0x1800, 0x1A00)
        for subindex, data_type, value in (
            (0, UNSIGNED8, 6),
            (1, UNSIGNED32, cob_id),
            (2, UNSIGNED8, kind),
            (3, UNSIGNED16, 0),
            (5, UNSIGNED16, 0),
            (6, UNSIGNED8, 0),
        ):
            self.add(communication + number, subindex, data_type, value, "rw" if subindex else "const")
        self.add(mapping + number, 0, UNSIGNED8, len(mapped))
        for place in range(1, 9):
            value = mapped[place - 1] if place <= len(mapped) else 0
            self.add(mapping + number, place, UNSIGNED32, value)
        return self

    def write(self, folder: Path, name: str = "device.eds") -> Path:
        path = folder / name
        path.write_text(_HEAD + "\n".join(self._sections), encoding="utf-8")
        return path


def communication() -> DeviceFile:
    """A device with every communication object that the simulated node knows, and no other."""
    file = DeviceFile()
    file.add(0x1000, None, UNSIGNED32, 0, "ro").add(0x1001, None, UNSIGNED8, 0, "ro", mapping=True)
    file.add(0x1003, 0, UNSIGNED8, 0)
    for number in range(1, 4):
        file.add(0x1003, number, UNSIGNED32, 0, "ro")
    file.add(0x1005, None, UNSIGNED32, 0x80).add(0x1006, None, UNSIGNED32, 0)
    file.add(0x100C, None, UNSIGNED16, 0).add(0x100D, None, UNSIGNED8, 0)
    for index in (0x1010, 0x1011):
        file.add(index, 0, UNSIGNED8, 4, "const")
        for number in range(1, 5):
            file.add(index, number, UNSIGNED32, 1)
    file.add(0x1014, None, UNSIGNED32, "$NODEID+0x80").add(0x1015, None, UNSIGNED16, 0)
    file.add(0x1016, 0, UNSIGNED8, 3, "const")
    for number in range(1, 4):
        file.add(0x1016, number, UNSIGNED32, 0)
    file.add(0x1017, None, UNSIGNED16, 0)
    file.add(0x1018, 0, UNSIGNED8, 4, "const")
    for number, value in ((1, 0x123), (2, 0x456), (3, 0x10001), (4, 99)):
        file.add(0x1018, number, UNSIGNED32, value, "ro")
    file.add(0x1019, None, UNSIGNED8, 0)
    file.add(0x1029, 0, UNSIGNED8, 1, "const").add(0x1029, 1, UNSIGNED8, 0)
    for index, shift in ((0x1200, 0), (0x1201, 0x80000080)):
        file.add(index, 0, UNSIGNED8, 2, "const")
        access = "rw" if shift else "ro"
        file.add(index, 1, UNSIGNED32, f"$NODEID+0x{0x600 + shift:X}", access)
        file.add(index, 2, UNSIGNED32, f"$NODEID+0x{0x580 + shift:X}", access)
    return file
