"""A node that dies is missed: by the heartbeat that it really has, or by being asked."""

from collections.abc import Callable

import pytest

from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.liveness import NodeLife
from drivers.bus.node_polling import SILENT_S
from drivers.bus.settings import DeviceSettings
from drivers.samples import ComponentState
from eds import Description
from tests.support.waiting import until
from tests.unit.bus.conftest import IDENTITY
from tests.unit.bus.fake_node import FakeNode

MS = 1_000_000
OPERATIONAL, PRE_OPERATIONAL, BOOT_UP = b"\x05", b"\x7f", b"\x00"


def beaten(life: NodeLife, period_ms: int, times: int, begin_ms: int = 0, state: bytes = OPERATIONAL) -> int:
    """Heartbeats, each a period after the one before; returns when the last one came."""
    for number in range(times):
        life.on_heartbeat((begin_ms + number * period_ms) * MS, state)
    return (begin_ms + (times - 1) * period_ms) * MS


def test_a_heartbeat_that_nobody_announced_is_missed() -> None:
    life = NodeLife(None)
    life.expect_every(None)
    last_ns = beaten(life, 100, 5)
    assert not life.lost(last_ns + 240 * MS)
    assert life.lost(last_ns + 260 * MS)


@pytest.mark.parametrize("period_ms", [50, 1000])
def test_a_period_that_a_master_has_changed_since_is_learned(period_ms: int) -> None:
    life = NodeLife(None)
    life.expect_every(0.2)
    last_ns = beaten(life, period_ms, 5)
    assert life.timeout_s == pytest.approx(2.5 * period_ms / 1000)
    assert life.lost(last_ns + 3 * period_ms * MS)


def test_lost_and_doubled_heartbeats_teach_nothing() -> None:
    life = NodeLife(None)
    life.expect_every(0.1)
    for at_ms in (0, 100, 100, 200, 300, 600, 700, 800):
        life.on_heartbeat(at_ms * MS, OPERATIONAL)
        assert life.timeout_s == pytest.approx(0.25)


def test_a_time_that_is_configured_counts() -> None:
    life = NodeLife(2.0)
    beaten(life, 100, 8)
    assert life.timeout_s == 2.0


def test_of_a_node_that_has_booted_and_says_no_more_nobody_says_that_it_waits() -> None:
    life = NodeLife(None)
    life.on_heartbeat(0, BOOT_UP)
    assert life.problem(10 * MS) is None  # it may have started itself
    life.on_heartbeat(20 * MS, PRE_OPERATIONAL)
    assert life.problem(30 * MS) == "it is pre-operational (NMT) and sends no PDOs until its master starts it"


def test_a_device_without_a_heartbeat_that_dies_is_lost(
    bus: CanBus, channel: str, describe: Callable[[int], Description]
) -> None:
    settings = DeviceSettings(bus="main", node_id=9, eds="small.eds", sdo_timeout_s=0.05)
    device = CanDevice("gait", settings, bus, describe(9))
    with FakeNode(channel, 9, dict(IDENTITY)) as node:
        device.start()
        try:
            until(lambda: device.node.ready, "came up")
            heard_ns = device.node.life.heard_ns or 0
            until(lambda: (device.node.life.heard_ns or 0) > heard_ns, "asked, though nobody wanted to know")
            assert device.quality(device.node.life.heard_ns or 0).state is ComponentState.OK
            node.silent = True
            asked = len(node.requests)
            until(lambda: len(node.requests) > asked, "asked again")
            quality = device.quality((device.node.life.heard_ns or 0) + round((SILENT_S + 0.1) * 1e9))
        finally:
            device.stop()
    assert quality.state is ComponentState.LOST
    assert quality.problem is not None
    assert "it has answered nothing for 3.1 s: check the node's power and cable" in quality.problem
    assert {request[0] for request in node.requests} <= {0x40, 0x80}  # it was only read
