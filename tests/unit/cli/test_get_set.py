"""`gwrms get` and `gwrms set` of parameters that only an EDS names."""

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
