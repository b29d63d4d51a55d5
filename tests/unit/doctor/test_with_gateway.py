"""A running robot's devices are asked by `object.read`: in bites, and for what their EDS has."""

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

import eds
from eds import Description
from gateway.client import Address, ClientError, Robot
from gateway.config.reading import load
from gateway.config.robot import JointTable
from gateway.doctor.gathering import gather, with_gateway
from gateway.doctor.gathering.gather import How, OtherRobot
from gateway.doctor.observations import Place
from gateway.doctor.report import findings, well
from gateway.doctor.table import judged
from gateway.wire.bus import Buses
from gateway.wire.dictionary import ObjectValue, ObjectValues
from gateway.wire.robot import Description as Described
from tests.unit.doctor.robots import TEXT

TABLE = JointTable(bus="main", node_id=5, eds="x.eds", counts_per_revolution=4096, gear_ratio=100.0)
AT_ONCE = 20
PLACE = Place("joint", "left_knee", TABLE)


@dataclass
class Device:
    """Answers as a gateway does: what one EDS lacks refuses the whole request."""

    description: Description
    bites: list[int] = field(default_factory=list)
    silent_from: int = 99  # requests

    def read_objects(self, component: str, *names: str) -> ObjectValues:
        self.bites.append(len(names))
        places = {name: (int(name[:6], 16), int(name[7:])) for name in names}
        if len(self.bites) > self.silent_from or not all(
            self.description.has(*one) for one in places.values()
        ):
            raise ClientError("refused")
        return ObjectValues(component, {name: self._value(*one) for name, one in places.items()})

    def _value(self, index: int, subindex: int) -> ObjectValue:
        if index == 0x6065:
            return ObjectValue(0xFFFF_FFFF, "", 1)
        if index == 0x6073:
            return ObjectValue(None, "", None, "SDO abort 0x06020000: no such object")
        if index == 0x1017:
            return ObjectValue(None, "", None, "no answer")
        return ObjectValue("ff", "FF", 1) if index == 0x605A else ObjectValue(subindex, "", 1)


def told(device: Device) -> dict[tuple[int, int], int | float | None]:
    return with_gateway.objects(cast("Robot", device), [PLACE], {"left_knee": device.description}).get(
        "left_knee", {}
    )


@pytest.fixture
def drive(monkeypatch: pytest.MonkeyPatch) -> Device:
    monkeypatch.setattr(with_gateway, "OBJECTS_READ", AT_ONCE)
    return Device(eds.load(eds.locate("joint_drive.eds", None), 5))


def test_a_device_is_asked_in_bites_and_told_in_its_own_counts(drive: Device) -> None:
    found = told(drive)
    assert len(drive.bites) > 1
    assert max(drive.bites) == AT_ONCE
    assert found[0x6065, 0] == 0xFFFF_FFFF
    assert found[0x6073, 0] is None, "the device does not have it"
    assert not {(0x1017, 0), (0x605A, 0)} & found.keys(), "nothing is known of these"


def test_who_falls_silent_has_told_what_came_before(drive: Device) -> None:
    drive.silent_from = 1
    assert 0 < len(told(drive)) <= AT_ONCE


def test_an_eds_without_an_identity_costs_the_doctor_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "bare.eds").write_text(
        "[1000]\nParameterName=Type\nDataType=0x0007\nAccessType=ro\n", encoding="utf-8"
    )
    assert set(told(Device(eds.load(tmp_path / "bare.eds", 5)))) == {(0x1000, 0)}


class Gateway:
    """Of a robot, by a file of before."""

    def __init__(self, robot: str, file: str) -> None:
        self._robot, self._file = robot, file

    def __enter__(self) -> "Gateway":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def describe(self) -> Described:
        return cast("Described", SimpleNamespace(robot=self._robot, file=self._file, parameters=[]))

    def buses(self) -> Buses:
        return Buses(1, [])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


DESK = How(seconds=0.01, gateway=Address("exo", 7420), here=False)


def test_the_gateway_of_another_robot_is_not_judged(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gather, "Robot", lambda *_: Gateway("y", load(file).digest))
    with pytest.raises(OtherRobot, match=r"exo:7420 is that of y, and .* is of x"):
        gather.gather(load(file), DESK)


def test_what_a_gateway_tells_by_another_file_is_not_judged(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gather, "Robot", lambda *_: Gateway("x", "0" * 64))
    verdicts = list(judged(gather.gather(load(file), DESK)))
    assert [(one.rule, one.about) for one in findings(verdicts)] == [("component", str(file))]
    assert not {"gear", "sign", "zero", "sides", "mode", "heartbeat"} & set(well(verdicts))


def test_comments_and_order_make_no_other_file(file: Path) -> None:
    before = load(file).digest
    file.write_text("# mine\n" + TEXT.replace("gear_ratio = 50.0   # from", "gear_ratio = 50.0 # by"))
    assert load(file).digest == before
    file.write_text(TEXT.replace("50.0   #", "51.0   #"))
    assert load(file).digest != before
