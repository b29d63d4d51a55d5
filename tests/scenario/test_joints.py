"""Joints and the gait controller of the simulated robot through the drivers alone."""

import time
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

import eds
from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.settings import CanSettings, DeviceSettings
from drivers.joint.drive import JointDrive
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.settings import JointSettings
from drivers.samples import ComponentState
from hil_sim.robot import SimulatedRobot
from tests.support.waiting import WAIT_S, until
from tests.unit.joint.test_drive import quality, read


def drivers_of(config: Path) -> tuple[list[JointDrive], CanDevice]:
    """Every CANopen component of a robot's file."""
    table = tomllib.loads(config.read_text(encoding="utf-8"))
    (bus,) = (CanBus(name, CanSettings.from_table(one)) for name, one in table["can"].items())
    joints = []
    for name, one in table["joint"].items():
        settings = msgspec.convert(one, JointSettings)
        joints.append(
            JointDrive(name, settings, bus, eds.load(eds.locate(settings.eds, config), settings.node_id))
        )
    found = msgspec.convert(table["device"]["gait"], DeviceSettings)
    gait = CanDevice("gait", found, bus, eds.load(eds.locate(found.eds, config), found.node_id))
    return joints, gait


@pytest.fixture(params=["virtual", "hub"])
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[SimulatedRobot]:
    channel = f"joints {tmp_path}" if request.param == "virtual" else None
    with SimulatedRobot(tmp_path, virtual_channel=channel) as robot:
        yield robot


def test_a_walking_robot_is_read_and_stopped_against_its_controller(robot: SimulatedRobot) -> None:
    joints, gait = drivers_of(robot.config)
    components: tuple[JointDrive | CanDevice, ...] = (*joints, gait)
    with ExitStack() as ends:
        for one in components:
            one.start()
            ends.callback(one.stop)
        _is_read_and_stopped(joints, gait)


def _is_read_and_stopped(joints: Sequence[JointDrive], gait: CanDevice) -> None:
    until(lambda: all(quality(joint)[0] is ComponentState.OK for joint in joints))
    first = {joint.name: read(joint, "position") for joint in joints}

    moved: set[str] = set()

    def all_moved() -> bool:
        for joint in joints:
            position, begin = read(joint, "position"), first[joint.name]
            if position is not None and begin is not None and abs(position - begin) > 0.05:
                moved.add(joint.name)
        return len(moved) == len(joints)

    until(all_moved)
    assert gait.quality(time.monotonic_ns()).state is ComponentState.OK
    assert joints[0].reading is not None
    assert joints[0].reading.options == {"quick_stop": 2, "abort_connection": 3}

    def stopped() -> bool:
        """A drive that gets no processor confirms too late, and is stopped again."""
        stops = [joint.quick_stop() for joint in joints]
        return {stop.result(WAIT_S) for stop in stops} == {StopOutcome.CONFIRMED}

    until(stopped)


def test_every_quantity_of_the_simulated_drive_has_a_value(robot: SimulatedRobot) -> None:
    joints, _ = drivers_of(robot.config)
    knee = joints[1]
    knee.start()

    def complete() -> bool:
        return all(read(knee, channel.quantity) is not None for channel in knee.channels)

    until(complete)
    knee.stop()


def test_a_parameter_of_the_gait_controller_is_written_and_read_back(robot: SimulatedRobot) -> None:
    _, gait = drivers_of(robot.config)
    gait.start()
    until(lambda: gait.node.ready)
    gait.node.download(0x2001, 0, (420).to_bytes(2, "little")).result(WAIT_S)
    assert gait.node.upload(0x2001, 0).result(WAIT_S) == (420).to_bytes(2, "little")
    gait.stop()
