"""The robot with its doors open: a plain canopen client, serial readers, one folder."""

import tomllib
from collections.abc import Iterator
from pathlib import Path

import can
import canopen
import pytest
import serial

import eds
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import Scenario
from hil_sim.kept_file import disagreements
from hil_sim.robot import SimulatedRobot


@pytest.fixture
def network(tmp_path: Path) -> Iterator[canopen.Network]:
    with SimulatedRobot(tmp_path, Scenario.STAND, virtual_channel=str(tmp_path)):
        network = canopen.Network(can.Bus(interface="virtual", channel=str(tmp_path)))
        network.connect()
        yield network
        network.disconnect()


def node(network: canopen.Network, name: str, node_id: int) -> canopen.RemoteNode:
    path = str(eds.locate(name, None))
    remote = canopen.RemoteNode(node_id, path)
    network.add_node(remote)
    remote.sdo.RESPONSE_TIMEOUT = 10.0
    assert remote.nmt.wait_for_heartbeat(20.0) in ("PRE-OPERATIONAL", "OPERATIONAL")
    return remote


def test_a_plain_canopen_client_reads_and_writes_by_sdo(network: canopen.Network) -> None:
    drive = node(network, "joint_drive.eds", 2)
    assert drive.sdo[0x1008].raw == "GWRMS joint drive"
    assert drive.sdo[0x1018][2].raw == 0x4A440001
    drive.sdo[0x6072].raw = 1500
    assert drive.sdo[0x6072].raw == 1500
    with pytest.raises(canopen.SdoAbortedError, match="0x06090031"):
        drive.sdo.download(0x6072, 0, b"\xff\xff")
    drive.sdo.download(0x6081, 0, b"\x00\x80\x00\x00", force_segment=True)
    assert drive.sdo[0x6081].raw == 0x8000
    with pytest.raises(canopen.SdoAbortedError, match="0x06020000"):
        drive.sdo.upload(0x3000, 0)


def test_a_plain_canopen_client_decodes_the_pdos_from_the_devices_mapping(network: canopen.Network) -> None:
    drive = node(network, "joint_drive.eds", 2)
    drive.tpdo.read()  # type: ignore[no-untyped-call]
    assert [variable.name for variable in drive.tpdo[1]] == ["Statusword", "Position actual value (counts)"]
    stamp = drive.tpdo[1].wait_for_reception(20.0)
    assert stamp is not None
    position = drive.tpdo[1][1].raw
    assert position == pytest.approx(drive.sdo[0x6064].raw, abs=5000)


def test_the_gait_controllers_parameters_are_reached_by_sdo(network: canopen.Network) -> None:
    gait = node(network, "gait_controller.eds", 16)
    gait.sdo[0x2001].raw = 450
    assert gait.sdo[0x2001].raw == 450
    with pytest.raises(canopen.SdoAbortedError, match="0x06090032"):
        gait.sdo.download(0x2001, 0, (199).to_bytes(2, "little"))


def test_sensors_send_on_their_links(tmp_path: Path) -> None:
    with SimulatedRobot(tmp_path, virtual_channel=str(tmp_path)):
        with serial.Serial(str(tmp_path / "left_insole"), 230400, timeout=20) as port:
            port.read_until(b"\0")
            assert len(port.read_until(b"\0")) in range(46, 60)
        with serial.Serial(str(tmp_path / "trunk"), 115200, timeout=20) as port:
            data = port.read(88)
            assert {bytes([0x55, kind]) for kind in (0x51, 0x52, 0x53, 0x59)} <= {
                data[i : i + 2] for i in range(87)
            }
    assert not any((tmp_path / name).is_symlink() for name in ("left_insole", "right_insole", "trunk"))


def test_robot_toml_names_the_bus_the_sensors_and_the_parameters(tmp_path: Path) -> None:
    with SimulatedRobot(tmp_path) as robot:
        config = tomllib.loads(robot.config.read_text(encoding="utf-8"))
        assert config["can"]["main"]["port"] == robot.port
    assert set(config["joint"]) == {
        f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle")
    }
    assert config["insole"]["right_insole"]["port"] == str(tmp_path / "right_insole")
    assert {"gait.step_length", "left_hip.max_torque", "right_ankle.profile_velocity"} <= set(
        config["parameter"]
    )
    assert len(config["parameter"]) == 22


def test_a_second_robot_in_a_folder_is_refused_and_the_next_keeps_port_and_file(tmp_path: Path) -> None:
    with SimulatedRobot(tmp_path) as robot:
        port = robot.port
        with pytest.raises(SimulatorError, match="another simulator is running"):
            SimulatedRobot(tmp_path).open()
    robot.config.write_text("# mine\n", encoding="utf-8")
    with SimulatedRobot(tmp_path) as again:
        assert again.port == port
        assert not again.config_is_ours
    assert robot.config.read_text(encoding="utf-8") == "# mine\n"


def test_a_kept_file_that_says_another_sensor_is_told(tmp_path: Path) -> None:
    with SimulatedRobot(tmp_path) as robot:
        config = robot.config.read_text(encoding="utf-8")
    assert disagreements(robot.config, config) == []
    other = config.replace('format = "witmotion"', 'format = "xsens"')
    assert disagreements(robot.config, other) == [
        "the file says witmotion for [imu.trunk] format, you simulate xsens"
    ]
    robot.config.write_text("# mine", encoding="utf-8")
    with SimulatedRobot(tmp_path) as again:
        assert "the file has no [imu.trunk], and you simulate one" in again.disagreements


def test_fast_as_it_goes_is_faster_than_real_time(tmp_path: Path) -> None:
    robot = SimulatedRobot(tmp_path, virtual_channel=str(tmp_path), speed=None)
    robot.open()
    robot.run(seconds=2.0)
    assert robot.exoskeleton.clock.now_s == 2.0
    robot.close()
    robot.close()
