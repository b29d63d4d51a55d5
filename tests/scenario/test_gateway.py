"""The gateway before a whole simulated robot: in one process over a virtual bus and pseudo-terminals."""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import can
import pytest

from gateway.config import load
from hil_sim.exoskeleton import JOINTS
from hil_sim.robot import SimulatedRobot
from tests.support.waiting import until
from tests.unit.gateway.harness import Client, serving

LINGER = ("linger_s = 5", "linger_s = 0.1")
EVERY = {*JOINTS, "gait", "left_insole", "right_insole", "trunk"}


def edit(file: Path, *changes: tuple[str, str]) -> Path:
    """Change a robot's file; every change must apply."""
    text = file.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[SimulatedRobot]:
    with SimulatedRobot(tmp_path, virtual_channel=f"scenario {tmp_path.name}") as robot:
        yield robot


@pytest.fixture
def client(robot: SimulatedRobot) -> Iterator[Client]:
    with serving(load(edit(robot.config, LINGER))) as address, Client(address) as client:
        yield client


@pytest.fixture
def visitor(one_gateway: tuple[str, int]) -> Iterator[Client]:
    """Of a gateway that all tests share who leave the robot as it was."""
    with Client(one_gateway) as client:
        yield client


def states(client: Client) -> dict[str, str]:
    quality = client.call("component.snapshot", channels=["*"])["quality"]
    return {name: one["state"] for name, one in quality.items()}


def all_ok(client: Client) -> bool:
    return set(states(client).values()) == {"ok"}


def whole(client: Client, *channels: str) -> dict[str, float]:
    """Values of these channels, none of them stale, as some are for a while where the computer is busy."""
    found: list[dict[str, float]] = []

    def look() -> bool:
        values = client.call("component.snapshot", channels=list(channels))["values"]
        found.append(values)
        return None not in values.values()

    until(look, "nothing is stale")
    return found[-1]


def _words(client: Client) -> list[str]:
    """Every joint's state in words; "?" where it is unknown."""
    enums = {one["name"]: one["enum"] for one in client.call("robot.describe")["channels"] if "enum" in one}
    values = client.call("component.snapshot", channels=["*.state"])["values"]
    return ["?" if value is None else enums[name][str(int(value))] for name, value in values.items()]


def test_a_stop_halts_every_drive_against_the_controller_and_holds(
    client: Client, robot: SimulatedRobot
) -> None:
    until(lambda: set(_words(client)) == {"operation enabled"}, "the robot walks")
    answer = client.call("robot.stop", reason="scenario")
    assert answer["held"] is True
    assert set(answer["drives"]) == set(JOINTS)
    assert "unreachable" not in answer["drives"].values()
    until(lambda: "operation enabled" not in _words(client), "no drive is enabled")
    since_ns = client.call("clock.read")["monotonic_ns"]

    def stands_a_while() -> bool:
        moved = {joint: drive.joint.velocity for joint, drive in robot.exoskeleton.drives.items()}
        assert (
            "operation enabled" not in _words(client)
            or client.call("robot.describe")["stop"]["stopped_again"]
        )
        elapsed: int = client.call("clock.read")["monotonic_ns"] - since_ns
        return elapsed > 1_500_000_000 and all(abs(velocity) < 0.05 for velocity in moved.values())

    until(stands_a_while, "it stands still and stays so")


def test_a_controller_that_starts_again_under_a_held_stop_is_stopped_again(
    client: Client, robot: SimulatedRobot, tmp_path: Path
) -> None:
    until(lambda: set(_words(client)) == {"operation enabled"}, "the robot walks")
    client.call("robot.stop", reason="scenario")
    until(lambda: "operation enabled" not in _words(client), "no drive is enabled")
    with can.Bus(interface="virtual", channel=f"scenario {tmp_path.name}") as third:
        # Somebody writes 1 to the controller's start object 2000h: it brings every drive up again.
        start = can.Message(
            arbitration_id=0x610, data=bytes.fromhex("2f00200001000000"), is_extended_id=False
        )

        def stopped_again() -> bool:
            third.send(start)
            return any(client.call("robot.describe")["stop"]["stopped_again"].values())

        until(stopped_again, "a drive was enabled and stopped again")
    until(lambda: "operation enabled" not in _words(client), "no drive stays enabled")


class TestMissing:
    """Hardware that is not there: it is named, the rest is served, and it is found when it comes."""

    def test_a_bus_a_port_and_an_eds_that_are_not_there(self, robot: SimulatedRobot, tmp_path: Path) -> None:
        (tmp_path / "broken.eds").write_text("[FileInfo\n", encoding="utf-8")
        port = str(tmp_path / "trunk")
        file = edit(
            robot.config,
            LINGER,
            (port, f"{port}-unplugged"),
            ('eds = "joint_drive.eds"', 'eds = "broken.eds"'),
            (
                "[joint.left_knee]\n",
                '[can.other]\ninterface = "socketcan"\nchannel = "nocan7"\n\n[joint.left_knee]\n',
            ),
        )
        knee = file.read_text(encoding="utf-8").index("[joint.left_knee]")
        text = file.read_text(encoding="utf-8")
        file.write_text(
            text[:knee] + text[knee:].replace('bus = "main"', 'bus = "other"', 1), encoding="utf-8"
        )
        with serving(load(file)) as address, Client(address) as client:
            missing = {"left_hip", "left_knee", "trunk"}
            rest = dict.fromkeys(EVERY - missing, "ok")
            until(lambda: states(client).items() >= rest.items(), "the rest is served")
            described = {one["name"]: one for one in client.call("robot.describe")["components"]}
            assert {name for name, one in described.items() if one["state"] == "lost"} == missing
            assert "broken.eds" in described["left_hip"]["problem"]
            assert "nocan7" in described["left_knee"]["problem"]
            assert "trunk-unplugged" in described["trunk"]["problem"]
            assert client.call("component.snapshot")["values"]["left_knee.position"] is None
            whole(client, "right_knee.position")
            (tmp_path / "trunk-unplugged").symlink_to((tmp_path / "trunk").resolve())
            until(lambda: states(client)["trunk"] == "ok", "the IMU is plugged in")
            assert client.call("robot.stop", reason="x")["drives"]["left_hip"] == "unreachable"

    def test_a_robot_that_is_switched_off_is_null_and_comes_back(self, tmp_path: Path) -> None:
        with ExitStack() as stack:
            power = stack.enter_context(ExitStack())
            robot = power.enter_context(SimulatedRobot(tmp_path))
            address = stack.enter_context(serving(load(edit(robot.config, LINGER))))
            client = stack.enter_context(Client(address))
            until(lambda: all_ok(client), "every component is there")
            power.close()
            until(lambda: set(states(client).values()) == {"lost"}, "everything is lost")
            snapshot = client.call("component.snapshot")
            assert set(snapshot["values"].values()) == {None}
            assert all(one["problem"] for one in snapshot["quality"].values())
            read: dict[str, Any] = client.call("parameter.read", names=["gait.step_length"])
            assert read["values"]["gait.step_length"]["value"] is None
            assert "gait is not there" in read["values"]["gait.step_length"]["problem"]
            stack.enter_context(SimulatedRobot(tmp_path))
            until(lambda: all_ok(client), "it is back")
            assert client.call("parameter.read")["values"]["gait.step_length"]["value"] == 0.4


# Last: their robot walks as long as a test of this file is to come.


def test_a_walking_robot_is_seen_live(visitor: Client) -> None:
    until(lambda: all_ok(visitor), "every component is there")
    positions = [f"{joint}.position" for joint in JOINTS]
    first = whole(visitor, *positions)

    def walks() -> bool:
        now = whole(visitor, *positions, "trunk.tilt_forward")
        return all(abs(now[name] - first[name]) > 0.02 for name in positions)

    until(walks, "all joints move")
    forces: set[tuple[bool, bool]] = set()

    def both_feet() -> bool:
        values = whole(visitor, "*.force")
        forces.add((values["left_insole.force"] > 200.0, values["right_insole.force"] > 200.0))
        return {(True, False), (False, True)} <= forces

    until(both_feet, "the feet alternate")


def test_describe_tells_what_the_drives_do_by_themselves(visitor: Client) -> None:
    until(lambda: all_ok(visitor), "every component is there")
    described = visitor.call("robot.describe")
    drives = described["stop"]["drives"]
    assert set(drives) == set(JOINTS)
    assert all(isinstance(one["quick_stop_option"], int) for one in drives.values())
    assert all("ramp" in one["quick_stop"] for one in drives.values())
    channels = {one["name"]: one for one in described["channels"]}
    assert channels["left_knee.position"]["unit"] == "rad"
    assert "operation enabled" in channels["left_knee.state"]["enum"].values()
    step = next(one for one in described["parameters"] if one["name"] == "gait.step_length")
    assert (step["unit"], step["access"], step["problem"]) == ("m", "rw", None)


def test_describe_tells_where_the_cells_of_each_sole_are(visitor: Client) -> None:
    parts = {one["name"]: one for one in visitor.call("robot.describe")["components"]}
    left, right = (parts[f"{side}_insole"]["layout"] for side in ("left", "right"))
    assert left["name"] == "insole-16"
    assert len(left["cells"]) == 16
    assert all(area > 0 for _, _, area in left["cells"])
    assert [[x, -y, area] for x, y, area in left["cells"]] == right["cells"]
    assert "layout" not in parts["left_knee"]


def test_a_parameter_is_written_and_the_device_has_it(visitor: Client, one_robot: SimulatedRobot) -> None:
    until(lambda: all_ok(visitor), "every component is there")
    visitor.call("control.acquire", ttl_s=60)
    answer = visitor.call("parameter.write", changes={"gait.step_length": 0.45})
    assert answer["before"] == {"gait.step_length": 0.4}
    assert answer["after"] == {"gait.step_length": 0.45}
    assert one_robot.exoskeleton.controller.dictionary[0x2001, 0].value == 450
    read = visitor.call("parameter.read", names=["gait.*"])["values"]
    assert read["gait.step_length"]["value"] == 0.45
    assert visitor.refused("parameter.write", changes={"gait.step_length": 0.7}).kind == "out_of_limit"
    visitor.call("parameter.write", changes={"gait.step_length": 0.4})


def test_every_sample_of_a_stream_arrives_in_order(visitor: Client) -> None:
    until(lambda: all_ok(visitor), "every component is there")
    visitor.call("stream.start", modules=["component"], rate_hz=100, channels=["*.position"])
    data = [visitor.data() for _ in range(100)]
    assert [one["seq"] for one in data] == list(range(100))
    stamps = [stamp_ns for one in data for stamp_ns in one["stamp_ns"]]
    assert stamps == sorted(stamps)
    assert data[-1]["dropped"] == 0
    knee = [value for one in data for value in one["columns"]["left_knee.position"]]
    assert None not in knee
    assert len(set(knee)) > 20


def test_own_samples_of_every_source_come_by_themselves(visitor: Client) -> None:
    until(lambda: all_ok(visitor), "every component is there")
    visitor.call("stream.start", modules=["component"], rate_hz=0)
    seen: set[str] = set()

    def everybody() -> bool:
        columns = visitor.data()["columns"]
        assert len({name.partition(".")[0] for name in columns}) == 1
        seen.update(columns)
        return {name.partition(".")[0] for name in seen} == EVERY

    until(everybody, "every component has sent")


def test_the_robots_own_file_is_answered_by_hand(visitor: Client) -> None:
    """What the manual shows: one line, and half-closed."""
    visitor.send(b'{"jsonrpc":"2.0","id":1,"method":"component.snapshot"}\n')
    answer = visitor.answer(1)
    assert json.dumps(answer)
    assert any(value is not None for value in answer["values"].values())
