"""A CiA 410 inclinometer, played by a node that speaks from the profile: its slopes become tilt."""

import math
import struct
import time
from pathlib import Path
from typing import Any

import pytest

import eds
from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings, Role
from drivers.component import Component, ComponentKind
from drivers.errors import SettingsError
from drivers.imu.canopen.cia410 import InclinometerSettings
from drivers.imu.inclinometer import Inclinometer
from drivers.samples import ComponentState
from tests.support.waiting import until
from tests.unit.bus.fake_node import FakeNode, Object

NODE = 20
SLOPES_16, SLOPES_32 = (0x60100010, 0x60200010), (0x61100020, 0x61200020)
EXAMPLE = bytes.fromhex("E8 03 18 FC")  # at resolution 10: +10.00° and −10.00°
DISABLED = 0x8000_0000


def tpdo(number: int, cob_id: int, *mapped: int, timer_ms: int = 10) -> dict[Object, bytes]:
    parameter, mapping = 0x1800 + number - 1, 0x1A00 + number - 1
    objects = {
        (parameter, 1): struct.pack("<I", cob_id),
        (parameter, 2): b"\xfe",
        (parameter, 5): struct.pack("<H", timer_ms),
        (mapping, 0): bytes([len(mapped)]),
    }
    return objects | {(mapping, sub): struct.pack("<I", entry) for sub, entry in enumerate(mapped, 1)}


def device(resolution: int = 10, longitudinal: int = 1000, lateral: int = -1000) -> dict[Object, bytes]:
    """An inclinometer of 16 bits without TPDOs."""
    return {
        (0x1000, 0): struct.pack("<I", 0x0002019A),
        (0x6000, 0): struct.pack("<H", resolution),
        (0x6010, 0): struct.pack("<h", longitudinal),
        (0x6011, 0): b"\0",
        (0x6020, 0): struct.pack("<h", lateral),
        (0x6021, 0): b"\0",
    }


def inclinometer(channel: str, role: Role = Role.OBSERVER, **settings: Any) -> Inclinometer:
    bus = CanBus("main", CanSettings(interface="virtual", channel=channel), role)
    table = {"bus": "main", "node_id": NODE, "sdo_timeout_s": 0.3, **settings}
    description = eds.load(eds.locate("inclinometer.eds", None), NODE)
    return Inclinometer("trunk", InclinometerSettings(**table), bus, description)


def tilt(trunk: Inclinometer) -> tuple[float | None, float | None]:
    now_ns = time.monotonic_ns()
    return trunk.latest.read(0, now_ns)[0], trunk.latest.read(1, now_ns)[0]


def problem(trunk: Inclinometer) -> str:
    return trunk.quality(time.monotonic_ns()).problem or ""


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


def test_it_is_a_component_whose_slopes_are_tilt(channel: str) -> None:
    with FakeNode(channel, NODE, device() | tpdo(1, 0x180 + NODE, *SLOPES_16)) as fake:
        trunk = inclinometer(channel)
        component: Component = trunk
        assert component.kind is ComponentKind.IMU
        assert [one.name for one in component.channels] == ["trunk.tilt_forward", "trunk.tilt_side"]
        trunk.start()
        trunk.start()
        until(lambda: trunk.node.ready)
        fake.send(0x180 + NODE, EXAMPLE)
        until(lambda: tilt(trunk)[0] is not None)
        assert tilt(trunk) == pytest.approx((math.radians(10.0), math.radians(-10.0)))
        assert (trunk.quality(time.monotonic_ns()).state, problem(trunk)) == (ComponentState.OK, "")
        trunk.stop()
        assert tilt(trunk) == (None, None)


@pytest.mark.parametrize(("resolution", "counts"), [(1, 20_000), (10, 2000), (100, 200), (1000, 20)])
def test_the_resolution_is_read_from_the_device(channel: str, resolution: int, counts: int) -> None:
    with FakeNode(channel, NODE, device(resolution, counts, -counts)):
        trunk = inclinometer(channel, poll_hz=50)
        trunk.start()
        until(lambda: tilt(trunk)[0] is not None)
        assert tilt(trunk) == pytest.approx((math.radians(20.0), math.radians(-20.0)))
        trunk.stop()


def test_slopes_of_32_bits_are_preferred_where_both_are_mapped(channel: str) -> None:
    objects = device(resolution=1) | tpdo(1, 0x194, *SLOPES_16) | tpdo(2, 0x294, *SLOPES_32)
    with FakeNode(channel, NODE, objects) as fake:
        trunk = inclinometer(channel)
        trunk.start()
        until(lambda: trunk.node.ready)
        fake.send(0x194, struct.pack("<hh", 1, 1))
        fake.send(0x294, struct.pack("<ii", 40_000, -5_000))
        until(lambda: tilt(trunk)[0] is not None)
        assert tilt(trunk) == pytest.approx((math.radians(40.0), math.radians(-5.0)))
        trunk.stop()


def test_slopes_in_two_tpdos_wait_for_each_other(channel: str) -> None:
    objects = device() | tpdo(1, 0x194, SLOPES_16[0]) | tpdo(2, 0x294, 0x00050008, SLOPES_16[1])
    with FakeNode(channel, NODE, objects) as fake:
        trunk = inclinometer(channel)
        trunk.start()
        until(lambda: trunk.node.ready)
        fake.send(0x194, EXAMPLE[:2])
        fake.send(0x294, b"\xff" + EXAMPLE[2:])
        until(lambda: tilt(trunk)[0] is not None)
        assert tilt(trunk) == pytest.approx((math.radians(10.0), math.radians(-10.0)))
        assert trunk.quality(time.monotonic_ns()).counters["frames"] == 2
        trunk.stop()


@pytest.mark.parametrize(
    ("tpdos", "why"),
    [
        (tpdo(1, 0x194 | DISABLED, *SLOPES_16), "no enabled TPDO carries them"),
        (tpdo(1, 0x194, *SLOPES_16, timer_ms=0), "comes only when they change"),
    ],
)
def test_slopes_that_no_tpdo_keeps_fresh_are_polled_and_that_is_said(
    channel: str, tpdos: dict[Object, bytes], why: str
) -> None:
    with FakeNode(channel, NODE, device() | tpdos) as fake:
        trunk = inclinometer(channel, poll_hz=100)
        trunk.start()
        until(lambda: tilt(trunk)[0] is not None)
        assert tilt(trunk) == pytest.approx((math.radians(10.0), math.radians(-10.0)))
        fake.objects[0x6010, 0] = struct.pack("<h", 2000)
        until(lambda: tilt(trunk)[0] == pytest.approx(math.radians(20.0)))
        assert why in problem(trunk)
        assert "asked by SDO at 100 Hz" in problem(trunk)
        assert trunk.quality(time.monotonic_ns()).state is ComponentState.OK
        trunk.stop()


def test_a_device_of_32_bits_is_polled_at_32_bits(channel: str) -> None:
    wide = {(0x6110, 0): struct.pack("<i", -70_000), (0x6120, 0): struct.pack("<i", 0)}
    with FakeNode(channel, NODE, device(resolution=1) | wide):
        trunk = inclinometer(channel, poll_hz=50)
        trunk.start()
        until(lambda: tilt(trunk)[0] is not None)
        assert tilt(trunk) == pytest.approx((math.radians(-70.0), 0.0))
        trunk.stop()


def test_directions_axes_and_mounting_are_the_integrators(channel: str) -> None:
    with FakeNode(channel, NODE, device(longitudinal=500, lateral=-2000)):
        trunk = inclinometer(channel, directions=(1, -1), axes=("y", "-x", "z"), poll_hz=50)
        trunk.start()
        until(lambda: tilt(trunk)[0] is not None)
        # The sensor's y points forward and 20° down, its x to the right and 5° down.
        assert tilt(trunk) == pytest.approx((math.radians(20.0), math.radians(-5.0)))
        trunk.stop()


def test_zero_now_counts_from_the_present_posture(channel: str) -> None:
    with FakeNode(channel, NODE, device()):
        trunk = inclinometer(channel, poll_hz=100)
        trunk.start()
        until(lambda: tilt(trunk)[0] is not None)
        trunk.zero_now()
        until(lambda: tilt(trunk) == pytest.approx((0.0, 0.0), abs=1e-9))
        trunk.stop()


def test_what_the_device_does_to_its_slopes_and_a_short_range_are_said(channel: str) -> None:
    objects = device(resolution=1) | {(0x6011, 0): b"\x01", (0x6021, 0): b"\x02"}
    with FakeNode(channel, NODE, objects):
        trunk = inclinometer(channel)
        trunk.start()
        until(lambda: trunk.node.ready)
        for words in ("inverts its longitudinal slope", "offset of its own to its lateral", "end at 32.8°"):
            assert words in problem(trunk)
        trunk.stop()


def test_a_node_that_reboots_or_falls_silent_leaves_no_old_tilt(channel: str) -> None:
    with FakeNode(channel, NODE, device() | tpdo(1, 0x194, *SLOPES_16)) as fake:
        trunk = inclinometer(channel)
        trunk.start()
        until(lambda: trunk.node.ready)
        fake.send(0x194, EXAMPLE)
        until(lambda: tilt(trunk)[0] is not None)
        fake.boot_up()
        until(lambda: tilt(trunk) == (None, None))
        until(lambda: trunk.node.ready)
        fake.heartbeat()
        fake.send(0x194, EXAMPLE[:3])
        until(lambda: trunk.quality(time.monotonic_ns()).counters["short_frames"])
        assert "TPDO1 (0x194), which brings them, stays silent" in problem(trunk)
        assert trunk.quality(time.monotonic_ns()).state is ComponentState.LOST
        trunk.stop()


def test_a_device_that_is_no_inclinometer_says_so(channel: str) -> None:
    with FakeNode(channel, NODE, {(0x1000, 0): struct.pack("<I", 0x00020192)}):
        trunk = inclinometer(channel)
        trunk.start()
        until(lambda: "0x6000" in problem(trunk))
        assert trunk.quality(time.monotonic_ns()).state is ComponentState.LOST
        trunk.stop()


def test_a_file_with_one_axis_is_refused(channel: str, tmp_path: Path) -> None:
    path = tmp_path / "single.eds"
    path.write_text("[6000]\nParameterName=r\nDataType=6\nAccessType=rw\n")
    settings = InclinometerSettings(bus="main", node_id=NODE, eds="single.eds")
    with pytest.raises(SettingsError, match="two-axis"):
        Inclinometer(
            "trunk",
            settings,
            CanBus("main", CanSettings(interface="virtual", channel=channel)),
            eds.load(path, NODE),
        )
