"""An IMU on a pseudo-terminal: live, then stale, lost, back again, and what is wrong in words."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.component import Component, ComponentKind
from drivers.imu.device import Imu
from drivers.imu.settings import ImuSettings
from drivers.samples import ComponentState
from tests.support.waiting import until
from tests.unit.imu.encode import witmotion
from tests.unit.port.terminals import Terminal, send_until

LEANING_10_DEGREES = witmotion(0x53, 0, round(10 / 180 * 32768), 0, 0)
SECOND_NS = 1_000_000_000


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    terminal = Terminal(tmp_path / "trunk")
    terminal.plug_in()
    yield terminal
    terminal.unplug()


@pytest.fixture
def imu(terminal: Terminal) -> Iterator[Imu]:
    imu = Imu("trunk", ImuSettings(port=str(terminal.path), stale_after_s=0.5, lost_after_s=2.0))
    imu.start()
    yield imu
    imu.stop()


def go_live(imu: Imu, terminal: Terminal) -> int:
    """Send until a value is there; its stamp."""
    send_until(terminal, LEANING_10_DEGREES, lambda: imu.latest.updated_ns is not None, "a sample")
    stamp_ns = imu.latest.updated_ns
    if stamp_ns is None:
        raise AssertionError("the sample vanished")
    return stamp_ns


def test_it_is_a_component_with_named_units(imu: Imu) -> None:
    component: Component = imu
    assert component.kind is ComponentKind.IMU
    units = {channel.name: channel.unit for channel in component.channels}
    assert units["trunk.tilt_forward"] == "rad"
    assert units["trunk.acceleration_z"] == "m/s²"


def test_value_is_live_then_null_as_it_goes_stale_and_lost(imu: Imu, terminal: Terminal) -> None:
    stamp_ns = go_live(imu, terminal)
    value, _ = imu.latest.read(0, stamp_ns)
    assert value == pytest.approx(0.174533, abs=1e-4)
    assert imu.quality(stamp_ns).state is ComponentState.OK
    assert imu.quality(stamp_ns).problem is None
    last_ns = imu.latest.updated_ns or stamp_ns
    stale = imu.quality(last_ns + SECOND_NS)
    assert (stale.state, imu.latest.read(0, last_ns + SECOND_NS)[0]) == (ComponentState.STALE, None)
    lost = imu.quality(last_ns + 3 * SECOND_NS)
    assert lost.state is ComponentState.LOST
    assert lost.problem is not None
    assert "no byte" in lost.problem
    assert "power" in lost.problem


def test_bytes_without_a_frame_are_called_wrong_baud_rate_or_format(imu: Imu, terminal: Terminal) -> None:
    until(lambda: imu.line.problem(time.monotonic_ns()) is None, "the port to open")
    send_until(
        terminal,
        b"\x00\xf8\x80\xfe",
        lambda: "wrong baud rate" in str(imu.quality(time.monotonic_ns()).problem),
        "words",
    )
    quality = imu.quality(time.monotonic_ns())
    assert quality.state is ComponentState.LOST
    assert quality.age_ms is None
    assert quality.counters["bytes_dropped"] > 0


def test_unplugged_sensor_is_lost_at_once_and_comes_back_without_a_restart(
    imu: Imu, terminal: Terminal
) -> None:
    go_live(imu, terminal)
    terminal.unplug()
    until(lambda: imu.quality(time.monotonic_ns()).state is ComponentState.LOST, "the loss")
    assert imu.latest.read(0, time.monotonic_ns()) == (None, None)
    until(lambda: "does not exist" in str(imu.quality(time.monotonic_ns()).problem), "the reason")
    terminal.plug_in()
    until(lambda: imu.line.problem(time.monotonic_ns()) is None, "the port to open")
    go_live(imu, terminal)
    quality = imu.quality(time.monotonic_ns())
    assert quality.state is ComponentState.OK
    assert quality.counters["reconnects"] == 1


def test_stopped_component_keeps_no_value_and_no_port(imu: Imu, terminal: Terminal) -> None:
    go_live(imu, terminal)
    imu.stop()
    assert imu.latest.read(0, time.monotonic_ns()) == (None, None)
    assert imu.quality(time.monotonic_ns()).state is ComponentState.LOST
