"""`gwrms eds` tells what a file says, and the shipped files are what they should be."""

import json
from pathlib import Path

import pytest

import eds
from eds.cli.eds import main
from eds.shipped import SHIPPED, shipped
from tests.unit.eds.test_load import HEAD, variable

DRIVE = (
    HEAD
    + variable("6041", DataType="0x0006", ParameterName="Statusword")
    + variable("6064", DataType="0x0004", ParameterName="Position", LowLimit="-5", HighLimit="5")
    + "[1800]\nParameterName=TPDO1\nObjectType=9\n"
    + variable("1800sub1", DefaultValue="$NODEID+0x180")
    + variable("1800sub2", DataType="0x0005", DefaultValue="1")
    + "[1A00]\nParameterName=Mapping\nObjectType=9\n"
    + variable("1A00sub0", DataType="0x0005", DefaultValue="2")
    + variable("1A00sub1", DefaultValue="0x60410010")
    + variable("1A00sub2", DefaultValue="0x60640020")
)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    path = tmp_path / "drive.eds"
    path.write_text(DRIVE)
    return path


def test_device_joint_pdos_objects_limits_and_findings_are_told(
    drive: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--node-id", "5", str(drive)]) == 0
    text = capsys.readouterr().out
    assert "Example: Drive" in text
    assert "a joint?    yes" in text
    assert "TPDO1  0x185       type 1: 6041:00 Statusword (16 bits), 6064:00 Position (32 bits)" in text
    assert "6064:00 INTEGER32      rw    Position  [-5 … 5]" in text
    assert "findings\n    none" in text
    assert "\n  for robot.toml\n\n[joint.node_5]" in text


def test_brief_leaves_out_the_objects(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--brief", str(drive)]) == 0
    assert "INTEGER32" not in capsys.readouterr().out


def test_json_is_one_object_a_file(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--json", str(drive), str(drive)]) == 0
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert first == second
    assert first["vendor_id"] == 0x1234
    assert first["table"].startswith("[joint.NAME]")
    assert first["pdos"][0]["mapped"] == [[0x6041, 0, 16], [0x6064, 0, 32]]
    assert {row["index"]: row["maximum"] for row in first["objects"]}[0x6064] == 5


def test_the_profile_that_fits_is_told_with_its_sources(
    drive: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--brief", "elmo_gold.dcf"]) == 0
    text = capsys.readouterr().out
    assert "profile     Elmo Gold\n    has       temperature 22A3h:1\n    source    Elmo's own" in text
    assert main(["--brief", str(drive)]) == 0
    assert "profile     none fits" in capsys.readouterr().out
    assert main(["--json", "--brief", "joint_drive.eds"]) == 0
    profile = json.loads(capsys.readouterr().out)["profile"]
    assert profile["gains"]["position_p"]["index"] == 0x2030


def test_a_file_that_cannot_be_used_is_told_and_hides_no_other(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wrong.eds").write_text("nothing")
    assert main(["--brief", str(tmp_path / "wrong.eds"), str(drive)]) == 1
    told = capsys.readouterr()
    assert "wrong.eds: there is no object section" in told.err
    assert "Example: Drive" in told.out


def test_what_a_joint_needs_and_the_file_lacks_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "valve.eds").write_text(HEAD)
    assert main([str(tmp_path / "valve.eds")]) == 0
    assert "no, 0x6041 (statusword) and 0x6064 (position actual value) missing" in capsys.readouterr().out


def test_findings_that_are_alike_are_told_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = "".join(variable(f"200{number}", ObjectType="VAR") for number in range(4))
    (tmp_path / "named.eds").write_text(HEAD + body)
    assert main([str(tmp_path / "named.eds")]) == 0
    assert "the name 'VAR' stands for the number 7 (and 3 more alike)" in capsys.readouterr().out


@pytest.mark.parametrize("node_id", ["0", "128", "x"])
def test_a_wrong_node_id_is_wrong_usage(drive: Path, node_id: str) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--node-id", node_id, str(drive)])
    assert caught.value.code == 2


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_file_loads_for_any_node_and_its_source_is_told(name: str) -> None:
    for node_id in (1, 77, 127):
        description = eds.load(eds.locate(name, None), node_id)
        assert len(description.object_dictionary) > 10
    assert f"`{name}`" in (SHIPPED / "SOURCES.md").read_text()


@pytest.mark.parametrize("name", ["joint_drive.eds", "elmo_gold.dcf", "trinamic_tmcm_1270.eds"])
def test_shipped_drives_can_be_joints(name: str) -> None:
    description = eds.load(eds.locate(name, None), 3)
    description.require([(0x6041, "statusword"), (0x6064, "position")], "a joint")
