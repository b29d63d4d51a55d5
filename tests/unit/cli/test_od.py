"""`gwrms od`: objects by address or name, what they hold, and writing as `gwrms set` does."""

import json
import threading

import pytest

from drivers.errors import Unavailable
from gateway.cli.od import main
from tests.unit.bus.fake_node import FakeNode
from tests.unit.cli.served import VELOCITY, Served, lines


def test_objects_are_listed_with_what_they_hold(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("od", "left_knee", "0x6081", "--read") == 0
    head, row = lines(capsys)[:2]
    assert head == ["OBJECT", "NAME", "TYPE", "ACCESS", "RANGE", "HOLDS"]
    assert row[0] == "0x6081:0"
    assert "65190" in row
    assert row[-1] == "left_knee.profile_velocity"


def test_what_is_no_parameter_is_only_looked_at(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("od", "left_knee", "0x6041", "--set", "5") == 1
    assert "is no parameter, ro in the EDS" in capsys.readouterr().err
    assert robot.run("od", "left_knee", "0x1017", "--set", "5") == 1
    assert "which belongs to who leads it" in capsys.readouterr().err


def test_a_parameter_is_written_as_set_does(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("od", "left_knee", "0x6081:0", "--set", "70001", "--json") == 0
    assert json.loads(capsys.readouterr().out)["after"] == {"left_knee.profile_velocity": 70001}
    assert robot.left(VELOCITY) == 70001


def test_one_object_is_written_at_a_time(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("od", "left_knee", "0x60*", "--set", "1") == 1
    assert "name one, as 0x6072:0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("left_kne", "0x6041"), "has no object dictionary; those that have: left_knee"),
        (("left_knee", "nonsense"), "left_knee has no object that fits 'nonsense'"),
        (("99", "0x6041"), "the robot has no node 99"),
    ],
)
def test_what_is_not_there_is_said(
    robot: Served, words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert robot.run("od", *words) == 1
    assert said in capsys.readouterr().err


def test_json_holds_objects_and_values(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("od", "left_knee", "0x6081:0", "--read", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["component"] == "left_knee"
    assert told["values"]["0x6081:0"]["value"] == 65190


def test_a_watch_says_what_has_changed(
    robot: Served, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("gateway.cli.od_watch.PERIOD_S", 0.01)
    held = iter((65190, 65190, 65190, 70001))

    def turn(index: int) -> None:
        if index == VELOCITY[0]:
            robot.bench.left.node.objects[VELOCITY] = next(held).to_bytes(4, "little")

    robot.bench.left.node.before_upload = turn
    assert robot.run("od", "left_knee", "0x6081", "--watch", "--count", "2", "--json") == 0
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [one["value"]["value"] for one in told] == [65190, 70001]


def test_what_is_too_much_to_watch_is_said(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("od", "left_knee", "--watch") == 1
    assert "too many to watch, 64 at most" in capsys.readouterr().err


DRIVE = {
    (0x6041, 0): b"\x37\x02",
    (0x6064, 0): (-5).to_bytes(4, "little", signed=True),
    (0x1008, 0): b"Joint drive",
}


def test_a_node_is_read_from_its_bus_where_no_gateway_runs(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    channel = request.node.name
    with FakeNode(channel, 5, DRIVE) as node:
        words = ("--interface", f"virtual:{channel}", "--eds", "joint_drive.eds", "--json")
        assert main(["5", "0x6041-0x6061", *words]) == 0
        told = json.loads(capsys.readouterr().out)
        assert told["component"] == "node 5"
        assert told["values"]["0x6041:0"]["words"] == "0x0237 (operation enabled)"
        assert told["values"]["0x6061:0"]["problem"], "it refuses that, and is asked on"
        requests = {data[0] for can_id, data in node.seen if can_id == 0x605}
        assert requests == {0x40}, "nothing but reading"


def test_a_node_that_somebody_else_asks_is_left_alone(request: pytest.FixtureRequest) -> None:
    channel = request.node.name
    ended = threading.Event()
    with FakeNode(channel, 5, DRIVE) as node, FakeNode(channel, 9) as other:

        def ask() -> None:
            while not ended.wait(0.02):
                other.send(0x605, bytes.fromhex("40 41 60 00 00 00 00 00"))

        thread = threading.Thread(target=ask)
        thread.start()
        try:
            with pytest.raises(Unavailable, match="somebody else asks node 5"):
                main(["5", "--interface", f"virtual:{channel}", "--eds", "joint_drive.eds"])
        finally:
            ended.set()
            thread.join()
    assert all(data[1:3] == b"\x41\x60" for can_id, data in node.seen if can_id == 0x605)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("5", "--interface", "can0"), "needs --eds FILE"),
        (("left_knee", "--interface", "can0", "--eds", "a.eds"), "DEVICE is a node id"),
        (("200", "--interface", "can0", "--eds", "a.eds"), "DEVICE is a node id"),
        (("5", "--eds", "a.eds"), "are for --interface"),
        (("5", "0x6041", "--watch", "--set", "1"), "--watch is neither"),
        (("5", "0x6041", "--count", "1"), "--count is for --watch"),
        (("5", "0x6072:0", "--interface", "can0", "--eds", "a.eds", "--set", "1"), "only reads"),
    ],
)
def test_what_makes_no_sense_is_said_before_the_bus_is_opened(
    words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(list(words))
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("typed", ["abc", "nan", ""])
def test_what_is_no_number_is_named_as_it_was_typed(typed: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["left_knee", "0x6072:0", "--set", typed])
    assert ended.value.code == 2
    assert f"{typed!r} is no number" in capsys.readouterr().err
