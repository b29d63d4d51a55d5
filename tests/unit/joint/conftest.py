"""A drive described by an EDS of the test's own, played by a fake node."""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

import eds
from drivers.bus.bus import CanBus
from drivers.bus.channels import Chosen
from drivers.bus.settings import CanSettings
from drivers.joint.drive import JointDrive
from drivers.joint.settings import JointSettings

Objects = dict[tuple[int, int], bytes]

# index, data type, bytes, value
AXIS = (
    (0x603F, 6, 2, 0),
    (0x6040, 6, 2, 0),
    (0x6041, 6, 2, 0x0040),
    (0x6061, 2, 1, 8),
    (0x6064, 4, 4, 0),
    (0x606C, 4, 4, 0),
    (0x6077, 3, 2, 0),
    (0x605A, 3, 2, 2),
    (0x6076, 7, 4, 400),
)
SURROUNDINGS = (
    (0x6079, 7, 4, 48_000),
    (0x60FD, 7, 4, 0x8001_0008),
)
COMMON = (
    (0x1000, 7, 4, 0x00020192),
    (0x6007, 3, 2, 1),
)


def drive_objects(axes: int = 1) -> Objects:
    """Every object of a drive with its value."""
    objects = {(index, 0): value.to_bytes(size, "little") for index, _, size, value in COMMON}
    for axis in range(axes):
        objects |= {
            (index + axis * 0x800, 0): value.to_bytes(size, "little") for index, _, size, value in AXIS
        }
    return objects


def surroundings(axis: int = 0) -> Objects:
    """Supply voltage and digital inputs of an axis."""
    return {
        (index + axis * 0x800, 0): value.to_bytes(size, "little") for index, _, size, value in SURROUNDINGS
    }


def tpdo(number: int, cob_id: int, *mapped: int, transmission_type: int = 1) -> Objects:
    """Communication and mapping parameter of one TPDO; `mapped` as in 1A00h."""
    objects = {
        (0x1800 + number - 1, 1): cob_id.to_bytes(4, "little"),
        (0x1800 + number - 1, 2): bytes([transmission_type]),
        (0x1800 + number - 1, 5): (0).to_bytes(2, "little"),
        (0x1A00 + number - 1, 0): bytes([len(mapped)]),
    }
    for subindex, entry in enumerate(mapped, start=1):
        objects[0x1A00 + number - 1, subindex] = entry.to_bytes(4, "little")
    return objects


NO_OTHER: Mapping[int, int] = MappingProxyType({})


def drive_eds(
    objects: Objects, other: Mapping[int, int] = NO_OTHER, mappable: Collection[int] = ()
) -> str:
    """An EDS of exactly these objects; `other` are data types by index, those `mappable` may be in a PDO."""
    types = {index: data_type for index, data_type, _, _ in COMMON} | {
        index + axis * 0x800: data_type for index, data_type, _, _ in AXIS + SURROUNDINGS for axis in range(8)
    }
    types |= other
    sections = []
    for index, subindex in sorted(objects):
        name = f"{index:04X}" if index in types else f"{index:04X}sub{subindex}"
        data_type = types.get(index, {1: 5, 2: 6, 4: 7}[len(objects[index, subindex])])
        sections.append(
            f"[{name}]\nParameterName={name}\nDataType={data_type}\nAccessType=rw\n"
            f"PDOMapping={int(index in mappable)}\n"
        )
    return "\n".join(sections)


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


@pytest.fixture
def bus(channel: str) -> CanBus:
    return CanBus("main", CanSettings(interface="virtual", channel=channel))


@pytest.fixture
def joint(bus: CanBus, tmp_path: Path) -> Callable[..., JointDrive]:
    """Make a joint for a drive with `objects`, node id 2."""

    def make(
        objects: Objects,
        name: str = "left_knee",
        chosen: Chosen | None = None,
        types: Mapping[int, int] = NO_OTHER,
        mappable: Collection[int] = (),
        **more: Any,
    ) -> JointDrive:
        path = tmp_path / "drive.eds"
        path.write_text(drive_eds(objects, types, mappable))
        table: dict[str, Any] = {"counts_per_revolution": 1000, "gear_ratio": 1, "sdo_timeout_s": 0.2, **more}
        settings = JointSettings(bus="main", node_id=2, eds="drive.eds", **table)
        return JointDrive(name, settings, bus, eds.load(path, 2), chosen)

    return make
