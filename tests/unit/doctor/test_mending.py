"""A line of the robot's file is changed where it stands and nowhere else; objects go through the gateway."""

import json
import tomllib
from pathlib import Path

import pytest

from gateway.client import ClientError, Robot
from gateway.config.reading import load
from gateway.doctor.mending import RECORD, Mender, NotMended, edited
from gateway.doctor.verdicts import Advice, Edit, Finding, Fix, Run, Together, Write
from gateway.wire.parameter import Written

TEXT = """\
# a robot
[robot]
name = "x"          # its name
[gateway]
records = "records"
[can.main]
interface = "virtual"
channel = "x"
[joint.left_knee]   # the left one
bus = "main"
node_id = 2
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 50.0   # from the drawing # of 2024
[joint.right_knee]
bus = "main"
node_id = 5
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 50.0
"""
GEAR = Edit("joint", "left_knee", "gear_ratio", 100.0, 50.0)
FOUND = Finding("gear", "[joint.left_knee]", "it is wrong", ("50 is not 100",), (GEAR,))


class FakeRobot(Robot):
    """Takes what is written, or refuses it."""

    def __init__(self, refusal: str | None = None) -> None:
        self.written: dict[str, float] = {}
        self._refusal = refusal

    def write(self, changes: object) -> Written:
        if self._refusal is not None:
            raise ClientError(self._refusal)
        assert isinstance(changes, dict)
        self.written |= changes
        return Written(7, {}, changes)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_one_line_changes_and_its_comment_stays() -> None:
    assert edited(TEXT, GEAR) == TEXT.replace("gear_ratio = 50.0   #", "gear_ratio = 100.0   #")


def test_a_key_that_is_not_there_is_added_behind_its_header() -> None:
    new = edited(TEXT, Edit("joint", "right_knee", "direction", -1, None))
    assert new == TEXT.replace("[joint.right_knee]\n", "[joint.right_knee]\ndirection = -1\n")


@pytest.mark.parametrize(
    "text",
    [
        TEXT.replace("gear_ratio = 50.0   #", "'gear_ratio' = 50.0   #"),
        TEXT.replace("[joint.left_knee]   # the left one", '[joint."left\\u005fknee"]'),
        '[joint]\nleft_knee = {gear_ratio = 50.0}\n[can.x]\na = "[joint.left_knee]"\n',
    ],
)
def test_a_file_that_is_written_otherwise_is_left_alone_and_the_line_is_told(text: str) -> None:
    assert tomllib.loads(text)
    with pytest.raises(NotMended, match="gear_ratio = 100"):
        edited(text, GEAR)


def test_a_table_that_is_not_there_any_more_is_not_made() -> None:
    with pytest.raises(NotMended, match=r"no \[joint.left_knee\]"):
        edited("[robot]\n", GEAR)


def test_a_list_is_written_as_toml() -> None:
    text = '[imu.trunk]\naxes = ["x", "-y", "-z"]   # how it lies\nport = "p"\n'
    new = edited(text, Edit("imu", "trunk", "axes", ["x", "y", "z"], None))
    assert new == '[imu.trunk]\naxes = ["x", "y", "z"]   # how it lies\nport = "p"\n'


def test_what_is_swapped_is_exchanged_as_one(file: Path) -> None:
    both = Together(
        (Edit("joint", "left_knee", "node_id", 5, 2), Edit("joint", "right_knee", "node_id", 2, 5))
    )
    Mender(load(file), None).mend(FOUND, both)
    assert [load(file).joint[name].node_id for name in ("left_knee", "right_knee")] == [5, 2]
    gone = Together((both.edits[0], Edit("joint", "right_hip", "node_id", 2, 5)))
    before = file.read_text(encoding="utf-8")
    with pytest.raises(NotMended, match="right_hip"):
        Mender(load(file), None).mend(FOUND, gone)
    assert file.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("index", [0x6060, 0x6860, 0x1006, 0x607A, 0x6040])
def test_what_moves_a_drive_or_paces_the_bus_is_never_written(index: int, file: Path) -> None:
    assert not Mender(load(file), FakeRobot()).can(Write("left_knee", index, 0, 8))


def test_what_was_mended_is_written_down(file: Path) -> None:
    Mender(load(file), None).mend(FOUND, GEAR)
    assert load(file).joint["left_knee"].gear_ratio == 100.0
    assert load(file).joint["right_knee"].gear_ratio == 50.0
    row = json.loads((file.parent / "records" / RECORD).read_text(encoding="utf-8"))
    assert (row["rule"], row["fix"]) == ("gear", GEAR.words)


def test_an_object_is_written_through_the_gateway(file: Path) -> None:
    robot = FakeRobot()
    write = Write("left_knee", 0x6065, 0, 22755, 0xFFFF_FFFF)
    assert "gwrms store left_knee" in Mender(load(file), robot).mend(FOUND, write)
    assert robot.written == {"left_knee.0x6065:0": 22755}


def test_what_the_gateway_refuses_is_told_and_not_written_down(file: Path) -> None:
    mender = Mender(load(file), FakeRobot("it is not released"))
    with pytest.raises(NotMended, match="it is not released"):
        mender.mend(FOUND, Write("left_knee", 0x6065, 0, 22755))
    assert not (file.parent / "records" / RECORD).exists()


def test_without_a_gateway_no_object_is_written(file: Path) -> None:
    with pytest.raises(NotMended, match="through a gateway only"):
        Mender(load(file), None).mend(FOUND, Write("left_knee", 0x6065, 0, 22755))


@pytest.mark.parametrize("fix", [Run("sudo rm"), Advice("look at it")])
def test_commands_and_advice_are_for_people(fix: Fix, file: Path) -> None:
    assert not Mender(load(file), None).can(fix)
