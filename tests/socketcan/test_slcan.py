"""A drive behind a serial CAN adapter: by the kernel's slcan, as `slcand` sets it up, and by python-can's."""

import fcntl
import math
import os
import struct
import subprocess
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import eds
from drivers.bus.bus import CanBus
from drivers.bus.interfaces.netlink import read_link
from drivers.bus.settings import CanSettings
from drivers.joint.drive import JointDrive
from drivers.joint.settings import JointSettings
from drivers.samples import ComponentState
from tests.socketcan.link import NAME, needs_vcan
from tests.socketcan.serial_adapter import SerialAdapter
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_eds, drive_objects, tpdo
from tests.unit.joint.test_drive import quality, read

_N_TTY, _N_SLCAN = 0, 17  # line disciplines of <linux/tty.h>
_SIOCGIFNAME = 0x8910

OBJECTS = drive_objects() | tpdo(1, 0x182, 0x60410010, 0x60640020)

pytestmark = [needs_vcan, pytest.mark.usefixtures("link_is_up")]


@pytest.fixture
def adapter() -> Iterator[SerialAdapter]:
    with SerialAdapter(NAME) as adapter:
        yield adapter


@contextmanager
def attached(port: str) -> Iterator[str]:
    """As `slcand PORT` and `ip link set … up`: the interface's name, for as long as the line is held."""
    line = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        _set_discipline(line, _N_SLCAN)
        name = fcntl.ioctl(line, _SIOCGIFNAME, bytes(32)).rstrip(b"\0").decode()
        rate = ("type", "can", "bitrate", "1000000")
        subprocess.run(["ip", "link", "set", name, "up", *rate], check=True, timeout=WAIT_S)
        yield name
    finally:
        _set_discipline(line, _N_TTY)
        os.close(line)


def _set_discipline(line: int, number: int) -> None:
    fcntl.ioctl(line, termios.TIOCSETD, struct.pack("i", number))


@contextmanager
def knee_on(settings: CanSettings, folder: Path) -> Iterator[JointDrive]:
    path = folder / "drive.eds"
    path.write_text(drive_eds(OBJECTS))
    joint = JointSettings(bus="main", node_id=2, eds="", counts_per_revolution=1000, gear_ratio=1)
    knee = JointDrive("left_knee", joint, CanBus("main", settings), eds.load(path, 2))
    knee.start()
    yield knee
    knee.stop()


def sees_a_quarter_turn(knee: JointDrive) -> None:
    """It is read by SDO and shows what its drive sends."""
    with FakeNode(NAME, 2, OBJECTS, interface="socketcan") as drive:
        until(lambda: knee.node.ready)
        drive.send(0x182, struct.pack("<Hi", 0x0027, 250))
        until(lambda: read(knee, "position") == pytest.approx(math.pi / 2))


def test_a_joint_behind_the_kernels_slcan_and_an_adapter_that_is_pulled_out(
    adapter: SerialAdapter, tmp_path: Path
) -> None:
    with attached(adapter.port) as name:
        assert adapter.bitrate == 1_000_000
        link = read_link(name)
        assert link is not None
        assert link.bitrate == 1_000_000
    with knee_on(CanSettings(interface="socketcan", channel=name, bitrate=1_000_000), tmp_path) as knee:
        with attached(adapter.port):
            sees_a_quarter_turn(knee)
        until(lambda: f"there is no interface {name}" in quality(knee)[1])
        assert quality(knee)[0] is ComponentState.LOST
        assert read(knee, "position") is None
        with attached(adapter.port):
            sees_a_quarter_turn(knee)


def test_a_joint_behind_python_cans_slcan(adapter: SerialAdapter, tmp_path: Path) -> None:
    settings = CanSettings(
        interface="slcan", channel=adapter.port, bitrate=1_000_000, more={"sleep_after_open": 0.0}
    )
    with knee_on(settings, tmp_path) as knee:
        sees_a_quarter_turn(knee)
        assert adapter.bitrate == 1_000_000
