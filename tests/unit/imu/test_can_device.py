"""A WitMotion IMU on a CAN bus: heard by its identifier, and what is wrong in words."""

import math
import time
from collections.abc import Iterator

import can
import pytest

from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings
from drivers.component import Component, ComponentKind
from drivers.imu.can_device import CanImu
from drivers.imu.settings import CanImuSettings
from drivers.samples import ComponentState
from tests.support.waiting import until

LEANING_10_DEGREES = bytes.fromhex("55 53 00 00 1C 07 00 00")  # pitch 1820 / 32768 · 180°


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


@pytest.fixture
def device(channel: str) -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=channel) as device:
        yield device


def imu(channel: str, can_id: int = 0x50) -> CanImu:
    bus = CanBus("main", CanSettings(interface="virtual", channel=channel))
    return CanImu("trunk", CanImuSettings(bus="main", can_id=can_id), bus)


def say(device: can.BusABC, can_id: int, data: bytes) -> None:
    device.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=can_id > 0x7FF))


def tilt_forward(trunk: CanImu) -> float | None:
    return trunk.latest.read(0, time.monotonic_ns())[0]


@pytest.mark.parametrize("can_id", [0x50, 0x1234567])
def test_its_frames_become_tilt_and_stop_leaves_none(channel: str, device: can.BusABC, can_id: int) -> None:
    trunk = imu(channel, can_id)
    component: Component = trunk
    assert component.kind is ComponentKind.IMU
    trunk.start()
    trunk.start()
    until(lambda: trunk._bus.opened)
    say(device, can_id, LEANING_10_DEGREES)
    until(lambda: tilt_forward(trunk) is not None)
    assert tilt_forward(trunk) == pytest.approx(math.radians(10.0), abs=1e-4)
    quality = trunk.quality(time.monotonic_ns())
    assert (quality.state, quality.problem, quality.counters["frames"]) == (ComponentState.OK, None, 1)
    trunk.stop()
    trunk.stop()
    assert tilt_forward(trunk) is None
    assert trunk.quality(time.monotonic_ns()).state is ComponentState.LOST


def test_silence_names_the_identifier_and_what_to_check(channel: str, device: can.BusABC) -> None:
    trunk = imu(channel)
    trunk.start()
    until(lambda: trunk._bus.opened)
    say(device, 0x51, LEANING_10_DEGREES)
    problem = trunk.quality(time.monotonic_ns()).problem
    assert problem is not None
    assert problem.startswith("no frame 0x050 comes on bus main")
    trunk.stop()


def test_another_device_with_its_identifier_is_named(channel: str, device: can.BusABC) -> None:
    trunk = imu(channel)
    trunk.start()
    until(lambda: trunk._bus.opened)
    say(device, 0x50, bytes(8))
    until(lambda: trunk.quality(time.monotonic_ns()).counters["malformed"])
    assert "another device has this identifier" in (trunk.quality(time.monotonic_ns()).problem or "")
    trunk.stop()


def test_the_reason_why_the_bus_is_not_open_comes_first(channel: str) -> None:
    bus = CanBus(
        "main", CanSettings(interface="socketcand", channel="can0", more={"host": "127.0.0.1", "port": 1})
    )
    trunk = CanImu("trunk", CanImuSettings(bus="main", can_id=0x50), bus)
    trunk.start()
    until(lambda: "127.0.0.1:1" in (trunk.quality(time.monotonic_ns()).problem or ""))
    trunk.stop()
