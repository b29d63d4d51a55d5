"""What is recorded of a robot when a session begins: its set-up, and what its devices say that they are."""

import dataclasses
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from gateway.client import Address
from gateway.wire.component import AngleInfo, ComponentInfo
from gateway.wire.parameter import ParameterValue, ParameterValues
from server_gui.core.fleet import session_facts
from server_gui.core.fleet.robot_recording import RobotRecording
from server_gui.core.follow.events import Described, Event, Identified, Looked
from server_gui.core.follow.feed import Feed
from server_gui.core.follow.network import Network
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from tests.fake_robot import FakeRobot
from tests.support.desk import described, looked
from tests.support.waiting import until
from tests.unit.fleet.recording import FOLLOWING, Kept

DEVICE: dict[str, str | int] = {"eds": "joint_drive.eds", "eds_digest": "ab" * 32}
FIRMWARE = {"left_knee": {"0X100A:0": "1.2", "0X1018:4": "77"}}


def knee(**fields: Any) -> Described:
    part = ComponentInfo("left_knee", "joint", "ok", None, DEVICE, angle=AngleInfo(-1e-5, 0.02))
    sole = ComponentInfo("left_insole", "insole", "ok", calibration="left.toml ab")
    trunk = ComponentInfo("trunk", "imu", "ok", calibration="")
    facts = described().description
    return Described(replace(facts, components=[part, sole, trunk], file="cd" * 32, **fields))


def test_the_set_up_tells_eds_calibration_limits_and_the_robots_file() -> None:
    found = session_facts.setup(knee().description)
    assert found["EDS/left_knee"] == "joint_drive.eds abababababab"
    assert (found["zero/left_knee"], found["scale/left_knee"]) == (0.02, -1e-5)
    assert (found["calibration/left_insole"], found["calibration/trunk"]) == ("left.toml ab", "no file")
    assert "calibration/left_knee" not in found
    assert found["limits/left_knee.max_torque"] == "8 … 80 N·m, steps of 40"
    assert found["robot.toml/digest"] == "cd" * 6
    assert found["enabled/left_knee.state"] == "4"
    assert not {key.partition("/")[0] for key in found} & set(session_facts.IDENTITY.values())


def test_what_devices_are_is_kept_with_the_session_that_begins(tmp_path: Path) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool, Recorder(spool) as recorder:
        keeping = RobotRecording("exo-01", recorder)
        for event in (knee(), Identified(FIRMWARE)):
            keeping.take(event)
        # another link of the same session: what was so at its start stays
        for event in (knee(), Identified({"left_knee": {"0X100A:0": "9.9"}})):
            keeping.take(event)
        keeping.pause()
        keeping.take(Identified({"left_knee": {"0X100A:0": "5.5"}}))
        keeping.go_on("")
        keeping.take(Identified({"left_knee": {"0X100A:0": "1.3"}}))
    rows = Kept.of(tmp_path / "spool").table("sessions", "exo-01")
    newest = {row["session"]: msgspec.json.decode(row["setup"]) for row in rows}
    first, second = newest.values()
    assert (first["firmware/left_knee"], first["serial number/left_knee"]) == ("1.2", "77")
    assert second["firmware/left_knee"] == "1.3"
    assert second["EDS/left_knee"] == first["EDS/left_knee"]


def told(**values: float | None) -> Looked:
    """The parameters as the robot holds them; of those that are None it has not told yet."""
    seen = looked()
    values_ = {name: ParameterValue(value, "", None, None, 0) for name, value in values.items()}
    return dataclasses.replace(seen, parameters=ParameterValues(values_))


def test_what_a_busy_robot_tells_later_is_of_the_session_too(tmp_path: Path) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool, Recorder(spool) as recorder:
        keeping = RobotRecording("exo-01", recorder)
        for event in (knee(), Identified({}), told(a=None, b=2.0), Identified(FIRMWARE)):
            keeping.take(event)
        keeping.take(told(a=1.0, b=3.0))
        keeping.take(told(a=9.0, b=9.0))
    newest = Kept.of(tmp_path / "spool").table("sessions", "exo-01")[-1]
    assert msgspec.json.decode(newest["parameters"]) == {"a": 1.0, "b": 2.0}
    assert msgspec.json.decode(newest["setup"])["firmware/left_knee"] == "1.2"


def test_a_value_of_zero_is_known_and_no_later_one_takes_its_place(tmp_path: Path) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool, Recorder(spool) as recorder:
        keeping = RobotRecording("exo-01", recorder)
        for event in (knee(), told(a=0.0, b=None, c=0), told(a=5.0, b=0.0, c=5), told(a=6.0, b=6.0, c=6)):
            keeping.take(event)
    newest = Kept.of(tmp_path / "spool").table("sessions", "exo-01")[-1]
    assert msgspec.json.decode(newest["parameters"]) == {"a": 0.0, "b": 0.0, "c": 0}


def asked(robot: FakeRobot) -> None:
    """Let it have an object dictionary behind the left knee, and none behind another."""

    def listed(params: dict[str, Any]) -> Any:
        objects = [thing(place) for place in ("0x1008:0", "0x100A:0", "0x1018:1")]
        return {"component": params["component"], "objects": objects}

    def read(params: dict[str, Any]) -> Any:
        held = {"0x100A:0": "1.2", "0x1018:1": "0x319"}
        values = {
            place: {"value": None, "words": held[place], "stamp_ns": 1, "problem": None}
            for place in params["objects"]
        }
        values["0x1018:1"] |= {"words": "", "problem": "it does not answer"}
        return {"component": params["component"], "values": values}

    robot.overrides |= {"object.list": listed, "object.read": read}


def thing(place: str) -> dict[str, Any]:
    missing = dict.fromkeys(("min", "max", "default", "parameter", "read_only"))
    return {"object": place, "name": "", "type": "UNSIGNED32", "access": "ro"} | missing


def identities(heard: list[Event]) -> list[Identified]:
    return [event for event in heard if isinstance(event, Identified)]


def test_each_device_is_asked_for_what_its_eds_knows_until_it_has_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("server_gui.core.follow.feed.IDENTIFY_AGAIN_S", (0.05,) * 1000)
    heard: list[Event] = []
    with FakeRobot() as robot, Network() as network:
        asked(robot)
        described_ = robot.describe()
        for part in described_["components"]:
            if part["name"] == "left_knee":
                part["device"] = DEVICE
        robot.overrides["robot.describe"] = lambda _params: described_
        host, _, port = robot.address.partition(":")
        following = msgspec.structs.replace(FOLLOWING, identities=True, journal_s=None)
        feed = Feed(Address(host, int(port)), [heard.append], following)
        running = network.run(feed.run())
        first = until(lambda: next(iter(identities(heard)), None))
        assert first.devices == {"left_knee": {"0X100A:0": "1.2"}}, "what does not answer is not recorded"
        assert robot.called("object.read")[0] == {
            "component": "left_knee",
            "objects": ["0x100A:0", "0x1018:1"],
        }
        robot.overrides["object.read"] = lambda params: {
            "component": params["component"],
            "values": {
                place: {"value": None, "words": "1", "stamp_ns": 1, "problem": None}
                for place in params["objects"]
            },
        }
        until(lambda: len(identities(heard)[-1].devices["left_knee"]) == 2, "what was busy is asked again")
        running.cancel()
