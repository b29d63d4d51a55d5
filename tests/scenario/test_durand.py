"""Drives of an independent CANopen stack (durand), each on its own bus object, as joints.

What durand does differently from CiA 301 is worked around here: it has no event timer, and its state machine
and statusword are the test's.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import can
import durand  # type: ignore[import-untyped]
import pytest
from durand.scheduler import VirtualScheduler  # type: ignore[import-untyped]

import eds
from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings, Role
from drivers.errors import DeviceAbort
from drivers.joint.cia402 import DriveState
from drivers.joint.drive import JointDrive
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.settings import JointSettings
from drivers.samples import ComponentState
from tests.support.waiting import WAIT_S, until
from tests.unit.joint.test_drive import quality, read

DT = durand.DatatypeEnum
ENABLED, QUICK_STOPPED = 0x0027, 0x0007


class Drive:
    """A durand node with the objects of a CiA 402 drive."""

    def __init__(self, channel: str, node_id: int, closing: ExitStack) -> None:
        self.bus = closing.enter_context(can.Bus(channel=channel, interface="virtual"))
        self.network = durand.CANBusNetwork(self.bus)
        closing.callback(self.network.stop)
        self.node = durand.MinimalNode(self.network, node_id)
        self.objects = self.node.object_dictionary
        for index, data_type, value in (
            (0x6040, DT.UNSIGNED16, 0),
            (0x6041, DT.UNSIGNED16, ENABLED),
            (0x6064, DT.INTEGER32, 0),
            (0x606C, DT.INTEGER32, 0),
            (0x605A, DT.INTEGER16, 6),
        ):
            self.objects[index] = durand.Variable(data_type, "rw", value, name=f"object {index:04X}")
        self.objects[0x6065] = durand.Variable(
            DT.UNSIGNED32, "rw", 1000, minimum=0, maximum=5000, name="window"
        )
        self.objects.update_callbacks[0x6040, 0].add(self._command)

    def _command(self, controlword: int) -> None:
        if controlword & 0x86 == 0x02:  # quick stop
            self.objects.write(0x6041, 0, QUICK_STOPPED)

    def map(self, number: int, *indices: int, transmission_type: int = 255) -> None:
        self.node.tpdo[number - 1].mapping = [(index, 0) for index in indices]
        self.node.tpdo[number - 1].transmission_type = transmission_type

    def move(self, counts: int) -> None:
        self.objects.write(0x6064, 0, counts)


@pytest.fixture
def closing() -> Iterator[ExitStack]:
    before = durand.get_scheduler()
    durand.set_scheduler(VirtualScheduler())
    with ExitStack() as stack:
        yield stack
    durand.set_scheduler(before)


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


@pytest.fixture
def drive(channel: str, closing: ExitStack) -> Drive:
    return Drive(channel, 2, closing)


Make = Callable[..., JointDrive]


@pytest.fixture
def joint(channel: str, tmp_path: Path, closing: ExitStack) -> Make:
    """A joint that knows the drive by the EDS that durand itself writes."""
    buses: dict[Role, CanBus] = {}

    def make(drive: Drive, role: Role = Role.OBSERVER, **more: Any) -> JointDrive:
        settings = CanSettings(interface="virtual", channel=channel, sync_period_s=0.01)
        bus = buses.setdefault(role, CanBus("main", settings, role))
        path = tmp_path / f"durand_{drive.node.node_id}.eds"
        path.write_text(drive.node.eds.content)
        table: dict[str, Any] = {"counts_per_revolution": 1000, "gear_ratio": 1, **more}
        found = JointSettings(bus="main", node_id=drive.node.node_id, eds=path.name, **table)
        made = JointDrive(f"joint_{drive.node.node_id}", found, bus, eds.load(path, drive.node.node_id))
        closing.callback(made.stop)
        return made

    return make


def test_an_observed_drive_shows_what_it_sends(drive: Drive, joint: Make) -> None:
    drive.map(2, 0x6041, 0x6064)
    drive.node.nmt.handle_msg(0, b"\x01\x02")
    knee = joint(drive)
    knee.start()
    until(lambda: knee.node.ready)
    drive.move(250)
    until(lambda: read(knee, "position") == pytest.approx(math.pi / 2))
    assert read(knee, "state") == DriveState.OPERATION_ENABLED


def test_a_bench_master_starts_the_drive_and_moves_it_by_sync(
    drive: Drive, joint: Make, channel: str
) -> None:
    drive.map(1, 0x6064, transmission_type=1)
    drive.move(500)
    knee = joint(drive, Role.MASTER)
    knee.start()
    until(lambda: quality(knee)[0] is ComponentState.OK and knee.frames > 3)
    assert read(knee, "position") == pytest.approx(math.pi)


def test_a_drive_that_was_never_started_is_polled(drive: Drive, joint: Make) -> None:
    drive.move(-250)
    knee = joint(drive, poll_hz=50)
    knee.start()
    until(lambda: read(knee, "position") is not None)
    assert read(knee, "position") == pytest.approx(-math.pi / 2)
    assert any(why in quality(knee)[1] for why in ("no TPDO is enabled", "none of its", "enabled and empty"))


def test_a_free_tpdo_is_mapped_where_that_is_allowed(drive: Drive, joint: Make) -> None:
    drive.node.tpdo[1].enable = False
    drive.node.nmt.handle_msg(0, b"\x01\x02")
    knee = joint(drive, configure_pdos=True)
    knee.start()
    until(lambda: knee.node.ready)
    assert "TPDO2 (0x282) was given statusword and position" in quality(knee)[1]
    drive.move(125)
    drive.node.tpdo[1].transmit()
    until(lambda: read(knee, "position") == pytest.approx(math.pi / 4))


def test_a_quick_stop_is_confirmed_by_the_drive(drive: Drive, joint: Make) -> None:
    knee = joint(drive)
    knee.start()
    until(lambda: knee.node.ready)
    assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
    assert drive.objects.read(0x6040, 0) == 0x0002


def test_values_are_read_written_and_refused_as_the_stack_says(drive: Drive, joint: Make) -> None:
    drive.objects.write(0x1008, 0, b"a name of more than four letters")
    knee = joint(drive)
    knee.start()
    until(lambda: knee.node.ready)
    assert knee.node.upload(0x1008, 0).result(WAIT_S) == b"a name of more than four letters"
    assert knee.node.upload(0x1021, 0).result(WAIT_S) == drive.node.eds.content.encode()
    knee.node.download(0x6065, 0, (4000).to_bytes(4, "little")).result(WAIT_S)
    assert drive.objects.read(0x6065, 0) == 4000
    with pytest.raises(DeviceAbort, match=r"writing 9000 .*0x6065:00: refused, the value is too high"):
        knee.node.download(0x6065, 0, (9000).to_bytes(4, "little")).result(WAIT_S)


def test_two_drives_on_buses_of_their_own_are_two_joints(
    drive: Drive, joint: Make, channel: str, closing: ExitStack
) -> None:
    other = Drive(channel, 3, closing)
    for one in (drive, other):
        one.map(1, 0x6064)
        one.node.nmt.handle_msg(0, bytes([1, one.node.node_id]))
    left, right = joint(drive), joint(other)
    left.start()
    right.start()
    until(lambda: left.node.ready and right.node.ready)
    drive.move(250)
    other.move(-250)
    until(lambda: read(left, "position") == pytest.approx(math.pi / 2))
    until(lambda: read(right, "position") == pytest.approx(-math.pi / 2))


def test_an_emcy_and_a_reboot_of_the_stack_are_seen(drive: Drive, joint: Make) -> None:
    knee = joint(drive)
    knee.start()
    until(lambda: knee.node.ready)
    drive.node.emcy.set(0x4210, 0x08)
    until(lambda: knee.node.life.active_emcy)
    assert knee.node.life.active_emcy is not None
    assert "0x4210 device temperature too high (register: temperature)" in knee.node.life.active_emcy.text()
    drive.node.nmt.reset()
    until(lambda: knee.node.life.boots == 1 and knee.node.ready)
    assert knee.node.life.active_emcy is None
