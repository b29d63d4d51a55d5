"""The drivers on a real SocketCAN interface: times, filters, error frames, losses, and a link that goes."""

import math
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import can
import pytest

import eds
from drivers.bus.bus import BusUser, CanBus
from drivers.bus.frames import EXTENDED
from drivers.bus.interfaces import socketcan
from drivers.bus.interfaces.controller_state import BusState
from drivers.bus.interfaces.netlink import read_link
from drivers.bus.settings import CanSettings
from drivers.joint.drive import JointDrive
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.settings import JointSettings
from drivers.samples import ComponentState
from tests.socketcan.link import NAME, needs_vcan, set_up
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_eds, drive_objects, tpdo
from tests.unit.joint.test_drive import quality, read

HOUR_S = 3600.0
LATE_NS = 500_000_000
AWAY_NS = 60_000_000_000  # for so long a process may have had no processor between two looks at the clocks

pytestmark = [needs_vcan, pytest.mark.usefixtures("link_is_up")]
in_user_mode_linux = pytest.mark.skipif(
    "User Mode Linux" not in Path("/proc/cpuinfo").read_text(encoding="utf-8"),
    reason="this computer's clock is not ours to set",
)


@pytest.fixture
def bus() -> CanBus:
    return CanBus("main", CanSettings(interface="socketcan", channel=NAME, bitrate=1_000_000))


class User(BusUser):
    ready = False


@contextmanager
def held(bus: CanBus, user: User | None = None) -> Iterator[User]:
    """The bus, open."""
    user = user or User()
    bus.hold(user)
    until(lambda: bus.opened)
    yield user
    bus.release(user)


class Reader:
    """A handler that stands still, and with it the bus's thread, until it may `go_on`."""

    def __init__(self) -> None:
        self.stamps_ns: list[int] = []
        self.go_on = threading.Event()

    def __call__(self, stamp_ns: int, _data: bytes) -> None:
        self.stamps_ns.append(stamp_ns)
        self.go_on.wait(WAIT_S)


def message(can_id: int, data: bytes = b"", extended: bool = False) -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=extended)


def test_frames_come_with_their_identifiers_and_data(bus: CanBus, peer: can.BusABC) -> None:
    got: list[bytes] = []
    bus.subscribe(0x181, lambda _, data: got.append(data))
    bus.subscribe(0x12345 | EXTENDED, lambda _, data: got.append(data))
    with held(bus):
        peer.send(message(0x181, b"\x01\x02"))
        peer.send(message(0x12345, b"\x03", extended=True))
        until(lambda: len(got) == 2)
    assert got == [b"\x01\x02", b"\x03"]


def test_a_stamp_is_the_kernels_however_late_the_frame_is_read(bus: CanBus, peer: can.BusABC) -> None:
    reader = Reader()
    bus.subscribe(0x181, reader)
    with held(bus):
        peer.send(message(0x181))
        until(lambda: reader.stamps_ns)
        before_ns = time.monotonic_ns()
        peer.send(message(0x181))
        after_ns = time.monotonic_ns()
        until(lambda: time.monotonic_ns() > after_ns + LATE_NS)
        reader.go_on.set()
        until(lambda: len(reader.stamps_ns) == 2)
    assert before_ns - AWAY_NS < reader.stamps_ns[1] < after_ns + LATE_NS / 2


@in_user_mode_linux
@pytest.mark.parametrize("jump_s", [HOUR_S, -HOUR_S])
def test_stamps_go_on_when_the_wall_clock_jumps(bus: CanBus, peer: can.BusABC, jump_s: float) -> None:
    stamps_ns: list[int] = []
    bus.subscribe(0x181, lambda stamp_ns, _: stamps_ns.append(stamp_ns))
    with held(bus):
        peer.send(message(0x181))
        until(lambda: len(stamps_ns) == 1)
        time.clock_settime(time.CLOCK_REALTIME, time.time() + jump_s)
        before_ns = time.monotonic_ns()
        peer.send(message(0x181))
        until(lambda: len(stamps_ns) == 2)
        time.clock_settime(time.CLOCK_REALTIME, time.time() - jump_s)
    assert before_ns - AWAY_NS < stamps_ns[1] <= time.monotonic_ns()


def test_the_kernel_keeps_what_nobody_asked_for(bus: CanBus, peer: can.BusABC) -> None:
    got: list[bytes] = []
    bus.subscribe(0x182, lambda _, data: got.append(data))
    with held(bus) as user:
        peer.send(message(0x181))
        until(lambda: 0x181 in bus.unclaimed)
        user.ready = True
        until(lambda: "182" in kernel_filters())
        frames = bus.frames
        for can_id in (0x181, 0x183, 0x182):
            peer.send(message(can_id, b"\x07"))
        until(lambda: got)
        assert bus.frames == frames + 1


def kernel_filters() -> set[str]:
    """The 11-bit identifiers that the kernel passes to somebody by name."""
    lines = Path("/proc/net/can/rcvlist_sff").read_text(encoding="ascii").splitlines()
    return {line.split()[1] for line in lines if line.split()[:1] == [NAME]}


def test_error_frames_tell_the_controllers_state(bus: CanBus, peer: can.BusABC) -> None:
    controller, bus_off, restarted = 0x004, 0x040, 0x100  # <linux/can/error.h>
    announced = [
        (controller, b"\x00\x08", BusState.WARNING, "counts many errors"),
        (controller, b"\x00\x20", BusState.PASSIVE, "error passive"),
        (bus_off, b"", BusState.OFF, "bus off, no frame can pass"),
        (restarted, b"", BusState.ACTIVE, None),
    ]
    with held(bus):
        for error_class, data, state, words in announced:
            peer.send(can.Message(arbitration_id=error_class, data=data.ljust(8, b"\0"), is_error_frame=True))
            until(partial(is_in, bus, state))
            assert words in (bus.trouble or "") if words else bus.trouble is None


def is_in(bus: CanBus, state: BusState) -> bool:
    return bus.state is state


def test_what_the_kernel_had_no_room_for_is_counted(
    bus: CanBus, peer: can.BusABC, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(socketcan, "RECEIVE_BUFFER", 4096)
    reader, marks = Reader(), list[bytes]()
    bus.subscribe(0x181, reader)
    bus.subscribe(0x182, lambda _, data: marks.append(data))
    with held(bus):
        for _ in range(200):
            peer.send(message(0x181, bytes(8)))
        reader.go_on.set()
        sent = 200
        while not marks and sent < 300:  # the first one that comes tells of every frame before it
            peer.send(message(0x182))
            sent += 1
            comes(lambda: marks)
        assert bus.dropped > 0
        assert bus.frames + bus.dropped == sent


def comes(condition: Callable[[], object]) -> None:
    """Give it a second to come true."""
    end_s = time.monotonic() + 1.0
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.002)


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
    assert quality(knee)[0] is ComponentState.LOST
    assert read(knee, "position") is None
    set_up(True)
    with FakeNode(NAME, 2, objects, interface="socketcan") as fake:
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<Hi", 0x0027, 250))
        until(lambda: quality(knee)[0] is ComponentState.OK)
        knee.stop()


def test_the_link_is_read_by_netlink() -> None:
    link = read_link(NAME)
    assert link is not None
    assert link.up
    assert link.kind == "vcan"
    assert link.bitrate is None
