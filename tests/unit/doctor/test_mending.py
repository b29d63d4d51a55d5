"""What the doctor mends, what it leaves alone and why, and what is written down of it."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import msgspec
import pytest

from gateway.client import ClientError, LinkLost, NotConnected, RemoteError, Robot
from gateway.config.reading import load
from gateway.doctor.file_edit import NotMended
from gateway.doctor.fixing import RECORD, Mender
from gateway.doctor.verdicts import Advice, Edit, Finding, Fix, Run, Together, Write
from gateway.wire.dictionary import ObjectValue, ObjectValues
from gateway.wire.parameter import ParameterInfo, TrialInfo, Written
from gateway.wire.robot import Description, Hello
from tests.unit.doctor.robots import TEXT

GEAR = Edit("joint", "left_knee", "gear_ratio", 100.0, 50.0)
FOUND = Finding("gear", "[joint.left_knee]", "it is wrong", ("50 is not 100",), (GEAR,))


class FakeRobot(Robot):
    """Its drives, what they hold, and what the gateway refuses; writes in a parameter's unit."""

    def __init__(self, refusal: ClientError | None = None, **changes: object) -> None:
        self.held: dict[str, int | None] = {
            "left_knee.0x6065:0": 0xFFFF_FFFF,
            "left_knee.0x6041:0": 0x0250,  # switch on disabled
            "right_knee.0x6041:0": 0x0250,
        }
        self.held |= cast("dict[str, int | None]", changes.pop("held", {}))
        self.refused: dict[str, str] = {}
        self.trials: list[TrialInfo] = []
        self.scale = 1.0
        self.keeps: int | None = None  # what the device makes of whatever is written
        vars(self).update(changes)
        self.written: dict[str, float] = {}
        self._refusal = refusal

    @property
    def hello(self) -> Hello:
        return Hello(1, "x", "operator", "boot", refused=self.refused)

    def describe(self) -> Description:
        info = ParameterInfo(
            *("left_knee.window", "rad", None, None, None), True, None, "left_knee", "0x6065:0", "rw", True
        )
        return cast(
            "Description",
            SimpleNamespace(parameters=[msgspec.structs.replace(info, scale=self.scale)], trials=self.trials),
        )

    def read_objects(self, component: str, *objects: str) -> ObjectValues:
        values = {one: ObjectValue(self.held[f"{component}.{one}"], "", 1) for one in objects}
        return ObjectValues(component, values)

    def write(self, changes: Mapping[str, float]) -> Written:
        if self._refusal is not None:
            raise self._refusal
        self.written |= changes
        for value in changes.values():
            self.held["left_knee.0x6065:0"] = self.keeps or round(value / self.scale)
        return Written(7, {}, dict(changes))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_what_is_swapped_is_exchanged_as_one(file: Path) -> None:
    both = Together(
        (Edit("joint", "left_knee", "node_id", 5, 2), Edit("joint", "right_knee", "node_id", 2, 5))
    )
    Mender(load(file), None).mend(FOUND, both)
    assert [load(file).joint[name].node_id for name in ("left_knee", "right_knee")] == [5, 2]
    gone = Together(
        (Edit("joint", "left_knee", "node_id", 2, 5), Edit("joint", "right_hip", "node_id", 2, 5))
    )
    before = file.read_text(encoding="utf-8")
    with pytest.raises(NotMended, match="right_hip"):
        Mender(load(file), None).mend(FOUND, gone)
    assert file.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("index", [0x6060, 0x6860, 0x1006, 0x607A, 0x6040])
def test_what_moves_a_drive_or_paces_the_bus_is_never_written(index: int, file: Path) -> None:
    assert not Mender(load(file), FakeRobot()).can(Write("left_knee", index, 0, 8))


def records(file: Path) -> list[dict[str, object]]:
    path = file.parent / "records" / RECORD
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def test_what_is_mended_is_written_down_before_and_after(file: Path) -> None:
    Mender(load(file), None).mend(FOUND, GEAR)
    assert load(file).joint["left_knee"].gear_ratio == 100.0
    assert load(file).joint["right_knee"].gear_ratio == 50.0
    begun, done = records(file)
    assert (begun["rule"], begun["fix"], begun["begun"]) == ("gear", GEAR.words, True)
    assert "changed" in str(done["done"])


def test_what_cannot_be_written_down_is_not_done(file: Path) -> None:
    (file.parent / "records").write_text("in the way", encoding="utf-8")
    with pytest.raises(NotMended, match="nothing was changed"):
        Mender(load(file), None).mend(FOUND, GEAR)
    assert file.read_text(encoding="utf-8") == TEXT


WINDOW = Write("left_knee", 0x6065, 0, 22755, 0xFFFF_FFFF)


def test_an_object_is_written_through_the_gateway(file: Path) -> None:
    robot = FakeRobot()
    assert "gwrms store left_knee" in Mender(load(file), robot).mend(FOUND, WINDOW)
    assert robot.written == {"left_knee.window": 22755}


def test_an_object_that_is_a_parameter_with_a_unit_is_written_in_that_unit(file: Path) -> None:
    robot = FakeRobot(scale=math.tau / 409600)
    Mender(load(file), robot).mend(FOUND, WINDOW)
    assert robot.written == {"left_knee.window": pytest.approx(0.349, abs=1e-3)}
    assert robot.held["left_knee.0x6065:0"] == 22755


LOST = LinkLost("the link dropped")
REFUSED: dict[str, tuple[FakeRobot, str]] = {
    "the gateway says no": (FakeRobot(RemoteError(1, "pat has the lease")), "refused: pat has the lease"),
    "its gateway is gone": (FakeRobot(NotConnected("there is no link")), "nothing was written: there is no"),
    "its gateway dies meanwhile": (FakeRobot(LOST), "nobody knows whether left_knee.0x6065:0 was written"),
    "another drive is enabled": (
        FakeRobot(held={"right_knee.0x6041:0": 0x0237}),
        "right_knee is operation enabled",
    ),
    "a drive stops": (FakeRobot(held={"left_knee.0x6041:0": 0x0217}), "left_knee is quick stop active"),
    "a drive is silent": (FakeRobot(held={"right_knee.0x6041:0": None}), "right_knee is not known"),
    "somebody wrote it meanwhile": (FakeRobot(held={"left_knee.0x6065:0": 900}), "holds 900 by now"),
    "somebody tries values": (FakeRobot(trials=[TrialInfo(1, "pat", {}, {}, 9.0)]), "a trial is under way"),
    "it keeps another value": (FakeRobot(keeps=7), "holds 7 by now, and not 22755: look at it"),
}


@pytest.mark.parametrize("why", REFUSED)
def test_an_object_is_not_written_where(why: str, file: Path) -> None:
    robot, words = REFUSED[why]
    with pytest.raises(NotMended, match=words):
        Mender(load(file), robot).mend(FOUND, WINDOW)
    assert bool(robot.written) is (robot.keeps is not None)
    assert words.split()[0] in str(records(file)[-1]["refused"])


def test_what_the_file_does_not_allow_is_told_with_the_line_that_would(file: Path) -> None:
    lines = r'\[parameter."left_knee.object_6007"\] and below it object = "0x6007:0"'
    with pytest.raises(NotMended, match=lines):
        Mender(load(file), FakeRobot()).mend(FOUND, Write("left_knee", 0x6007, 0, 3, 0))


@pytest.mark.parametrize("index", [0x6065, 0x6073, 0x6873])
def test_a_limit_is_made_narrower_and_never_wider(index: int, file: Path) -> None:
    mender = Mender(load(file), FakeRobot())
    assert mender.can(Write("left_knee", index, 0, 1000, 0xFFFF))
    assert not mender.can(Write("left_knee", index, 0, 1000, 0))
    assert not mender.can(Write("left_knee", index, 0, 1000))


def test_who_may_not_write_is_not_asked(file: Path) -> None:
    robot = FakeRobot(refused={"parameter.write": "it is for operators"})
    assert Mender(load(file), robot).objection(FOUND, WINDOW, ()) == "it is for operators"
    assert "start it" in (Mender(load(file), None).objection(FOUND, WINDOW, ()) or "")
    assert Mender(load(file), robot).objection(FOUND, GEAR, ()) is None


def test_a_copy_of_the_file_is_not_mended(file: Path) -> None:
    mender = Mender(load(file), FakeRobot(), here=False)
    assert "is a copy" in (mender.objection(FOUND, GEAR, ()) or "")
    assert mender.objection(FOUND, WINDOW, ()) is None
    mender.mend(FOUND, WINDOW)
    assert not (file.parent / "records").exists(), "the robot's own journal has it"


ABOUT_KNEE, ABOUT_BUS = "[joint.left_knee]", "[can.main]"
CAUSED = [
    ("eds_product", ABOUT_KNEE, WINDOW, True),
    ("eds_product", ABOUT_KNEE, GEAR, True),
    ("double_node_id", ABOUT_KNEE, GEAR, True),
    ("sides", "left_knee and right_knee", GEAR, True),
    ("second_sdo_client", ABOUT_KNEE, WINDOW, True),
    ("second_sdo_client", ABOUT_KNEE, GEAR, False),
    ("terminator", ABOUT_BUS, WINDOW, True),
    ("terminator", ABOUT_BUS, GEAR, False),
    ("eds_product", "[joint.right_knee]", WINDOW, False),
    ("zero", ABOUT_KNEE, GEAR, False),
]


@pytest.mark.parametrize(("rule", "about", "fix", "waits"), CAUSED)
def test_what_another_finding_may_have_caused_waits_for_that(
    rule: str, about: str, fix: Fix, waits: bool, file: Path
) -> None:
    cause = Finding(rule, about, "it is the cause", (), ())
    why = Mender(load(file), FakeRobot()).objection(FOUND, fix, [cause])
    assert bool(why) is waits
    assert why is None or "it is the cause" in why


def test_a_cause_does_not_wait_for_what_it_caused(file: Path) -> None:
    eds = Finding("eds_product", ABOUT_KNEE, "another's", (), ())
    sides = Finding("sides", "left_knee and right_knee", "swapped", (), ())
    mender = Mender(load(file), None)
    assert mender.objection(eds, GEAR, [sides, FOUND]) is None
    assert mender.objection(sides, GEAR, [eds, FOUND]) is not None


def test_what_was_judged_by_a_line_that_has_changed_is_not_mended_too(file: Path) -> None:
    mender = Mender(load(file), FakeRobot())
    mender.mend(FOUND, GEAR)
    assert "ask again" in (
        mender.objection(FOUND, Edit("joint", "left_knee", "zero_offset", 0.1, 0.0), ()) or ""
    )
    assert mender.objection(FOUND, Edit("joint", "right_knee", "zero_offset", 0.1, 0.0), ()) is None


def test_without_a_gateway_no_object_is_written(file: Path) -> None:
    with pytest.raises(NotMended, match="through a gateway only"):
        Mender(load(file), None).mend(FOUND, Write("left_knee", 0x6065, 0, 22755))


@pytest.mark.parametrize("fix", [Run("sudo rm"), Advice("look at it")])
def test_commands_and_advice_are_for_people(fix: Fix, file: Path) -> None:
    assert not Mender(load(file), None).can(fix)
