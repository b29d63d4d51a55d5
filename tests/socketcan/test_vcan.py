"""A real SocketCAN interface: reading, filters, the link that goes down and comes back."""

import fcntl
import math
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

import eds
from drivers.bus.bus import BusUser, CanBus
from drivers.bus.frames import EXTENDED
from drivers.bus.netlink import read_link
from drivers.bus.settings import CanSettings
from drivers.joint.drive import JointDrive
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.settings import JointSettings
from drivers.samples import State
from tests.unit.bus.fake_node import FakeNode
from tests.unit.bus.waiting import WAIT_S, until
from tests.unit.joint.conftest import drive_eds, drive_objects, tpdo
from tests.unit.joint.test_drive import quality, read

NAME = "vcan0"
_SIOCGIFFLAGS, _SIOCSIFFLAGS, _IFF_UP = 0x8913, 0x8914, 1

pytestmark = pytest.mark.skipif(
    read_link(NAME) is None, reason=f"there is no {NAME} here; see tests/socketcan/uml"
)


def set_up(up: bool) -> None:
    """`ip link set vcan0 up` or `down`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        request = struct.pack("16sH14x", NAME.encode(), 0)
        (flags,) = struct.unpack_from("H", fcntl.ioctl(control, _SIOCGIFFLAGS, request), 16)
        flags = flags | _IFF_UP if up else flags & ~_IFF_UP
        fcntl.ioctl(control, _SIOCSIFFLAGS, struct.pack("16sH14x", NAME.encode(), flags))


@pytest.fixture(autouse=True)
def link_is_up() -> Iterator[None]:
    set_up(True)
    yield
    set_up(True)


@pytest.fixture
def bus() -> CanBus:
    return CanBus("main", CanSettings(interface="socketcan", channel=NAME, bitrate=1_000_000))


@pytest.fixture
def peer() -> Iterator[can.BusABC]:
    with can.Bus(channel=NAME, interface="socketcan") as peer:
        yield peer


class User(BusUser):
    ready = False


def test_frames_come_with_the_kernels_time_on_the_monotonic_clock(bus: CanBus, peer: can.BusABC) -> None:
    got: list[tuple[int, bytes]] = []
    user = User()
    bus.subscribe(0x181, lambda stamp_ns, data: got.append((stamp_ns, data)))
    bus.subscribe(0x12345 | EXTENDED, lambda stamp_ns, data: got.append((stamp_ns, data)))
    bus.hold(user)
    until(lambda: bus.opened)
    before_ns = time.monotonic_ns()
    peer.send(can.Message(arbitration_id=0x181, data=b"\x01\x02", is_extended_id=False))
    peer.send(can.Message(arbitration_id=0x12345, data=b"\x03", is_extended_id=True))
    until(lambda: len(got) == 2)
    assert [data for _, data in got] == [b"\x01\x02", b"\x03"]
    assert before_ns - 1_000_000 <= got[0][0] <= got[1][0] <= time.monotonic_ns()
    bus.release(user)


def test_the_kernel_keeps_what_nobody_asked_for(bus: CanBus, peer: can.BusABC) -> None:
    user = User()
    got: list[bytes] = []
    bus.subscribe(0x182, lambda _, data: got.append(data))
    bus.hold(user)
    until(lambda: bus.opened)
    peer.send(can.Message(arbitration_id=0x181, data=b"", is_extended_id=False))
    until(lambda: 0x181 in bus.unclaimed)
    user.ready = True
    time.sleep(0.3)
    frames = bus.frames
    for can_id in (0x181, 0x183, 0x182):
        peer.send(can.Message(arbitration_id=can_id, data=b"\x07", is_extended_id=False))
    until(lambda: got)
    assert bus.frames == frames + 1
    bus.release(user)


def test_a_joint_lives_on_it_and_survives_the_link(bus: CanBus, tmp_path: Path) -> None:
    objects = drive_objects() | tpdo(1, 0x182, 0x60410010, 0x60640020)
    path = tmp_path / "drive.eds"
    path.write_text(drive_eds(objects))
    settings = JointSettings(bus="main", node_id=2, eds="", counts_per_revolution=1000, gear_ratio=1)
    knee = JointDrive("left_knee", settings, bus, eds.load(path, 2))
    knee.start()
    with FakeNode(NAME, 2, objects, interface="socketcan") as fake:
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<Hi", 0x0027, 250))
        until(lambda: read(knee, "position") == pytest.approx(math.pi / 2))
        assert knee.quick_stop().result(WAIT_S) in StopOutcome
    set_up(False)
    until(lambda: "vcan0 is down; run: sudo ip link set vcan0 up" in quality(knee)[1])
    assert quality(knee)[0] is State.LOST
    assert read(knee, "position") is None
    set_up(True)
    with FakeNode(NAME, 2, objects, interface="socketcan") as fake:
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<Hi", 0x0027, 250))
        until(lambda: quality(knee)[0] is State.OK)
        knee.stop()


def test_the_link_is_read_by_netlink() -> None:
    link = read_link(NAME)
    assert link is not None
    assert link.up
    assert link.kind == "vcan"
    assert link.bitrate is None
