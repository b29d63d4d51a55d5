"""What a product counts otherwise than CiA 402 is read as CiA 402 has it."""

from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

import eds
from drivers.bus.sdo.channel import SdoChannel
from drivers.errors import DeviceAbort
from drivers.joint.quantities import quantities
from drivers.joint.reading import read_drive
from tests.unit.joint.conftest import Objects, drive_eds, drive_objects

MAXON, TRINAMIC = 0xFB, 0x286
POSITION_GAIN = {(0x30A1, 1): bytes(4)}  # the mark of an EPOS4


class _Sdo:
    """Answers with what a device holds."""

    label = "knee"

    def __init__(self, objects: Objects) -> None:
        self._objects = objects

    def upload(self, index: int, subindex: int) -> bytes:
        if (index, subindex) not in self._objects:
            raise DeviceAbort("no such object", 0x0602_0000)
        return self._objects[index, subindex]


def describe(folder: Path, objects: Objects, vendor_id: int) -> eds.Description:
    path = folder / "drive.eds"
    path.write_text(drive_eds(objects))
    return replace(eds.load(path, 5), vendor_id=vendor_id)


@pytest.mark.parametrize(("vendor_id", "rated_mnm"), [(MAXON, 457.38), (TRINAMIC, 457_380.0)])
def test_a_rated_torque_in_micronewtonmetres_is_not_taken_for_a_thousand_times_as_much(
    tmp_path: Path, vendor_id: int, rated_mnm: float
) -> None:
    objects = {**drive_objects(), **POSITION_GAIN, (0x6076, 0): (457_380).to_bytes(4, "little")}
    sdo = cast("SdoChannel", _Sdo(objects))
    reading = read_drive(sdo, describe(tmp_path, objects, vendor_id), 0)
    assert reading.scaling["rated_torque_mnm"] == pytest.approx(rated_mnm)


def test_a_joint_has_the_temperature_of_its_product_and_the_voltage_of_the_standard() -> None:
    found = {one.name: one for one in quantities(eds.load(eds.locate("elmo_gold.dcf", None), 5), 0)}
    assert (found["temperature"].index, found["temperature"].scale) == (0x22A3, 1.0)
    assert found["temperature"].kind == "unsigned"
    assert found["voltage"].index == 0x6079
