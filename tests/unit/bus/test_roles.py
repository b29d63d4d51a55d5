"""An observer sends SDO requests and nothing else; a master starts nodes, sends SYNC and its heartbeat."""

import time
from collections import Counter
from collections.abc import Callable

import can
import pytest

from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.settings import CanSettings, DeviceSettings, Role
from drivers.samples import State
from eds import Description
from tests.unit.bus.conftest import IDENTITY
from tests.unit.bus.fake_node import FakeNode
from tests.unit.bus.waiting import until

Describe = Callable[[int], Description]


def bench_bus(channel: str, role: Role) -> CanBus:
    settings = CanSettings(
        interface="virtual", channel=channel, sync_period_s=0.01, node_id=100, heartbeat_s=0.02
    )
    return CanBus("bench", settings, role)


def device(bus: CanBus, description: Description, **more: float) -> CanDevice:
    settings = DeviceSettings(bus="bench", node_id=5, eds="small.eds", sdo_timeout_s=0.2, **more)  # type: ignore[arg-type]
    return CanDevice("gait", settings, bus, description)


def test_an_observer_sends_sdo_requests_and_nothing_else(channel: str, describe: Describe) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)) as fake:
        bus = bench_bus(channel, Role.OBSERVER)
        gait = device(bus, describe(5), guard_time_s=0.05)
        gait.start()
        until(lambda: gait.node.ready)
        until(lambda: fake.seen)
        time.sleep(0.2)
        assert {can_id for can_id, _ in fake.seen} == {0x605}
        assert "node guarding is the master's" in str(gait.quality(time.monotonic_ns()).problem)
        gait.stop()


def test_a_master_starts_each_node_and_sends_sync_and_heartbeat(channel: str, describe: Describe) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)) as fake:
        bus = bench_bus(channel, Role.MASTER)
        gait = device(bus, describe(5))
        gait.start()
        until(lambda: gait.node.ready)

        def counted() -> Counter[int]:
            return Counter(can_id for can_id, _ in list(fake.seen))

        until(lambda: counted()[0x080] >= 5 and counted()[0x764] >= 3)
        assert (0x000, b"\x01\x05") in fake.seen
        assert (0x764, b"\x05") in fake.seen
        assert set(counted()) == {0x000, 0x080, 0x605, 0x764}
        gait.stop()
        silent = len(fake.seen)
        time.sleep(0.1)
        assert len(fake.seen) == silent


def test_a_rebooted_node_is_started_again_by_its_master(channel: str, describe: Describe) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)) as fake:
        bus = bench_bus(channel, Role.MASTER)
        gait = device(bus, describe(5))
        gait.start()
        until(lambda: gait.node.ready)
        fake.boot_up()
        until(lambda: [frame for frame in list(fake.seen) if frame == (0x000, b"\x01\x05")][1:])
        gait.stop()


@pytest.mark.parametrize("answers", [True, False])
def test_a_master_guards_a_node_that_has_no_heartbeat(
    channel: str, describe: Describe, answers: bool
) -> None:
    with can.Bus(channel=channel, interface="virtual") as wire, FakeNode(channel, 5, dict(IDENTITY)) as fake:
        bus = bench_bus(channel, Role.MASTER)
        gait = device(bus, describe(5), guard_time_s=0.06, stale_after_s=0.5, lost_after_s=0.6)
        gait.start()
        until(lambda: gait.node.ready)
        asked = 0

        def guarded() -> bool:
            nonlocal asked
            message = wire.recv(0.01)
            if message is not None and message.is_remote_frame and message.arbitration_id == 0x705:
                asked += 1
                if answers:
                    fake.heartbeat(0x05 | 0x80 * (asked % 2))
            return asked >= 10

        until(guarded)
        if answers:
            assert gait.node.life.heartbeats >= 8
            assert gait.quality(time.monotonic_ns()).state is State.OK
        else:
            until(lambda: gait.quality(time.monotonic_ns()).state is State.LOST)
            assert "heartbeat is missing" in str(gait.quality(time.monotonic_ns()).problem)
        gait.stop()
