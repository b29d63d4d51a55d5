"""The table that is printed to paste is one that a robot's file takes, and says what is left to fill in."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

import eds
from eds.shipped import SHIPPED, shipped
from eds.table import joint_table
from gateway.config.reading import examine
from gateway.tables.finding import Severity
from tests.unit.eds.test_cli import drive as drive

REST = '[robot]\nname = "exo"\n[can.main]\ninterface = "virtual"\nchannel = "x"\n'


def table(file: str, node_id: int | None = 5) -> str:
    return joint_table(eds.load(SHIPPED / file, node_id or 1), node_id)


def filled_in(text: str) -> str:
    """As somebody does who follows the comments."""
    return re.sub(r"^# (\S+ = \S+) +# fill in", r"\1 #", text, flags=re.MULTILINE)


@pytest.mark.parametrize("file", shipped())
@pytest.mark.parametrize("node_id", [None, 5])
def test_what_is_pasted_and_filled_in_is_taken(file: str, node_id: int | None, tmp_path: Path) -> None:
    robot = tmp_path / "robot.toml"
    robot.write_text(REST + filled_in(table(file, node_id)), encoding="utf-8")
    found = [one.words for one in examine(robot).findings if one.severity is Severity.MISTAKE]
    assert found == []


def test_what_the_file_tells_is_in_it_and_what_it_does_not_is_a_comment(drive: Path) -> None:
    known: dict[str, Any] = tomllib.loads(table("joint_drive.eds"))["joint"]["node_5"]
    assert known == {
        "bus": "main",
        "node_id": 5,
        "eds": "joint_drive.eds",
        "counts_per_revolution": 4096,
        "gear_ratio": 100,
    }
    text = joint_table(eds.load(drive, 1), None, "legs")
    unknown: dict[str, Any] = tomllib.loads(text)["joint"]["NAME"]
    assert unknown == {"bus": "legs", "eds": "drive.eds"}
    for key in ("node_id", "counts_per_revolution", "gear_ratio"):
        assert re.search(rf"^# {key} = .*# fill in: ", text, re.MULTILINE), text
    assert "put the file beside this one" in text


def test_what_the_device_said_counts_more_than_its_file() -> None:
    read = {(0x6091, 1): 160, (0x6091, 2): 2, (0x608F, 1): 1, (0x608F, 2): 1}
    text = joint_table(eds.load(SHIPPED / "joint_drive.eds", 5), 5, read=read)
    assert tomllib.loads(text)["joint"]["node_5"]["gear_ratio"] == 80
    assert "# counts_per_revolution = 4096" in text, "1:1 is what a drive holds that was never told"


def test_what_is_no_joint_is_a_device() -> None:
    known = tomllib.loads(table("gait_controller.eds", 16))
    assert known == {"device": {"node_16": {"bus": "main", "node_id": 16, "eds": "gait_controller.eds"}}}
