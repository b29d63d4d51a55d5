"""Who is looked at as a silent robot hears nothing from us, or only questions; a wrong bus is told."""

from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from gateway.config.reading import load
from gateway.config.robot import RobotConfig
from gateway.doctor.gathering import without_gateway
from gateway.doctor.gathering.computer import computer
from gateway.doctor.gathering.gather import How, gather
from gateway.doctor.observations import Observations, Samples
from gateway.doctor.table import judged
from gateway.doctor.verdicts import Finding, Unknown
from tests.unit.bus.fake_node import FakeNode

ROBOT = """\
[robot]
name = "x"
[gateway]
role = "master"
[can.main]
interface = "virtual"
channel = "{channel}"
sync_period_s = 0.01
[joint.left_knee]
bus = "main"
node_id = 5
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
configure_pdos = true
"""
DRIVE = {
    (0x1017, 0): b"\x00\x00",
    (0x1018, 1): bytes(4),
    (0x1018, 2): (0x4A44_0001).to_bytes(4, "little"),
    (0x6065, 0): b"\xff\xff\xff\xff",
    (0x6041, 0): b"\x40\x02",
}


@pytest.fixture(autouse=True)
def _no_settling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(without_gateway, "SETTLE_S", 0.3)


@pytest.fixture
def drive(request: pytest.FixtureRequest) -> Iterator[FakeNode]:
    with FakeNode(str(request.node.nodeid), 5, dict(DRIVE)) as node:
        yield node


@pytest.fixture
def config(drive: FakeNode, tmp_path: Path) -> RobotConfig:
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT.format(channel=drive.channel), encoding="utf-8")
    return load(file)


def found(seen: Observations) -> set[str]:
    return {one.rule for one in judged(seen) if isinstance(one, Finding)}


def test_a_silent_robot_hears_not_one_frame_of_ours(config: RobotConfig, drive: FakeNode) -> None:
    seen = gather(config, How(seconds=0.3))
    assert drive.seen == []
    assert seen.objects == {}


def test_with_active_devices_are_asked_and_nothing_is_written(config: RobotConfig, drive: FakeNode) -> None:
    seen = gather(config, How(seconds=0.3, active=True))
    assert seen.objects["left_knee"][0x6065, 0] == 0xFFFF_FFFF
    assert seen.objects["left_knee"][0x6091, 1] is None
    assert {"heartbeat", "following_window"} <= found(seen)
    assert drive.writes == []
    assert {can_id for can_id, _ in drive.seen} == {0x605}  # no NMT, SYNC, heartbeat or RPDO of ours


def test_a_device_that_somebody_else_asks_is_left_alone(config: RobotConfig, drive: FakeNode) -> None:
    with FakeNode(drive.channel, 99) as other:
        beginning = other.bus.send_periodic(_question(), 0.02)
        seen = gather(config, How(seconds=0.5, active=False))
        beginning.stop()
        assert (
            without_gateway.objects(config, seen.nodes(), seen.descriptions, {"main": frozenset({5})}, _wait)
            == {}
        )
    assert {"second_sdo_client", "heartbeat"} <= found(seen)


def _question() -> can.Message:
    return can.Message(arbitration_id=0x605, data=bytes.fromhex("4041600000000000"), is_extended_id=False)


def _wait(_seconds: float) -> None:
    """Nothing is waited for."""


def test_a_bus_that_cannot_be_opened_is_not_called_well(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    text = ROBOT.replace('interface = "virtual"', 'interface = "socketcan"').format(channel="nocan0")
    file.write_text(text, encoding="utf-8")
    seen = gather(load(file), How(seconds=0.1))
    verdicts = [one for one in judged(seen) if one.about == "[can.main]"]
    assert {one.rule for one in verdicts} >= {"bit_rate", "terminator", "bus_load", "sync"}
    (missing,) = [one for one in verdicts if isinstance(one, Finding)]
    assert missing.evidence[0].startswith("there is no interface nocan0; ")
    silent_ones = [
        one for one in verdicts if isinstance(one, Unknown) and one.rule in ("bit_rate", "terminator")
    ]
    assert not any("power" in one.why for one in silent_ones)


def test_a_port_that_is_not_there_is_not_called_well(config: RobotConfig, tmp_path: Path) -> None:
    text = config.path.read_text(encoding="utf-8")
    config.path.write_text(f'{text}[insole.left]\nport = "{tmp_path}/gone"\n', encoding="utf-8")
    here = computer(load(config.path))
    assert here.missing_ports == {f"{tmp_path}/gone"}
    seen = Observations(load(config.path), {}, {}, {}, Samples(), here)
    (unknown,) = [one for one in judged(seen) if one.rule == "latency_timer"]
    assert unknown == Unknown("latency_timer", "[insole.left]", f"{tmp_path}/gone does not exist")


def test_what_a_robot_has_not_is_not_called_well(config: RobotConfig) -> None:
    judged_of = judged(Observations(config, {}, {}, {}, Samples(), computer(config)))
    assert {one.rule for one in judged_of} >= {"latency_timer", "imu", "insole_scale"}
