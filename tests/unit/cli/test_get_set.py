"""`gwrms get` and `gwrms set` of parameters that only an EDS names."""

import json

import pytest

from tests.unit.cli.served import VELOCITY, Served, lines


def test_describe_counts_what_is_read_only_and_get_shows_it(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    assert robot.run("describe") == 0
    printed = capsys.readouterr().out
    assert "more, read-only (gwrms get 'left_knee.*')" in printed
    assert "left_knee.profile_velocity" in printed
    assert "left_knee.controlword" not in printed
    assert robot.run("get", "left_knee.0x1017:0", "left_knee.max_torque") == 0
    shown = lines(capsys)
    assert ["left_knee.producer_heartbeat_time", "100", "–", "…", "–", "read-only:", "communication"] in shown


def test_a_text_is_read_as_it_stands_and_never_written(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.bench.left.node.objects[0x1008, 0] = b"GWRMS joint drive"
    assert robot.run("get", "left_knee.0x1008:0") == 0
    assert "GWRMS joint drive" in capsys.readouterr().out
    assert robot.run("get", "left_knee.0x1008:0", "--json") == 0
    assert '"value":null,' in (printed := capsys.readouterr().out)
    assert '"text":"GWRMS joint drive"' in printed
    assert robot.run("set", "left_knee.0x1008:0=5") == 1
    assert "read-only" in capsys.readouterr().err


def test_a_parameter_is_set_by_its_address_and_whole_numbers_stay_whole(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    assert robot.run("set", "left_knee.0x6081:0=70001", "--json") == 0
    assert '"left_knee.profile_velocity":70001}' in capsys.readouterr().out
    assert robot.left(VELOCITY) == 70001


def right(robot: Served, key: tuple[int, int]) -> int:
    return int.from_bytes(robot.bench.right.node.objects[key], "little")


def test_a_value_is_mirrored_in_one_write(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("set", "--mirror", "left_knee.profile_velocity=70001", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["after"] == {"left_knee.profile_velocity": 70001, "right_knee.profile_velocity": 70001}
    assert (robot.left(VELOCITY), right(robot, VELOCITY)) == (70001, 70001)


def test_what_one_joint_holds_goes_to_all(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    robot.bench.right.node.objects[VELOCITY] = (1000).to_bytes(4, "little")
    assert robot.run("set", "--all-joints", "left_knee.0x6081:0") == 0
    assert right(robot, VELOCITY) == robot.left(VELOCITY) == 65190
    assert ["right_knee.profile_velocity", "1000", "→", "65190", "counts/s", "read", "back"] in lines(capsys)


def test_a_joint_without_it_stops_all_until_it_is_left_out(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    """Only the left knee's torque is released by the robot's file."""
    assert robot.run("set", "--mirror", "left_knee.max_torque=30") == 1
    said = capsys.readouterr().err
    assert "nothing was written" in said
    assert "right_knee" in said
    assert robot.bench.left.node.written() == []
    assert robot.run("set", "--mirror", "left_knee.max_torque=30", "--leave-out", "right_knee") == 0
    assert "right_knee is left out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("typed", "why"),
    [
        (["left_knee.profile_velocity"], "has no value"),
        (["--leave-out", "right_knee", "left_knee.profile_velocity=5"], "goes with --mirror"),
        (["--mirror", "--all-joints", "left_knee.profile_velocity=5"], "not allowed with"),
    ],
)
def test_what_makes_no_sense_is_said(
    robot: Served, capsys: pytest.CaptureFixture[str], typed: list[str], why: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        robot.run("set", *typed)
    assert ended.value.code == 2
    assert why in capsys.readouterr().err


def test_a_parameter_of_no_joint_is_not_mirrored(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("set", "--mirror", "gait.step_length=0.42") == 1
    assert "is of no joint" in capsys.readouterr().err
