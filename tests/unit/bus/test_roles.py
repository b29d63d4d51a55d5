"""An observer sends SDO requests and nothing else; a master starts nodes, sends SYNC and its heartbeat."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
import pytest

from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.settings import CanSettings, DeviceSettings, Role
from drivers.samples import ComponentState
from eds import Description
from tests.support.waiting import until
from tests.unit.bus.conftest import IDENTITY
from tests.unit.bus.fake_node import FakeNode

Describe = Callable[[int], Description]
MARK = 0x7F0  # nobody else sends it


def bench_bus(channel: str, role: Role) -> CanBus:
    settings = CanSettings(
        interface="virtual", channel=channel, sync_period_s=0.01, node_id=100, heartbeat_s=0.02
    )
    return CanBus("bench", settings, role)


@contextmanager
def running(channel: str, role: Role, description: Description, **more: float) -> Iterator[CanDevice]:
    """A device that has come up; it is stopped whatever happens."""
    settings = DeviceSettings(bus="bench", node_id=5, eds="small.eds", sdo_timeout_s=2.0, **more)  # type: ignore[arg-type]
    gait = CanDevice("gait", settings, bench_bus(channel, role), description)
    gait.start()
    try:
        until(lambda: gait.node.ready)
        yield gait
    finally:
        gait.stop()


def seen_until_now(wire: can.BusABC, fake: FakeNode) -> int:
    """How many frames went over the bus before this instant; the fake reads them later."""
    mark = (MARK, len(fake.seen).to_bytes(4, "little"))
    wire.send(can.Message(arbitration_id=MARK, data=mark[1], is_extended_id=False))
    until(lambda: mark in fake.seen)
    return fake.seen.index(mark)


def test_an_observer_sends_sdo_requests_and_nothing_else(channel: str, describe: Describe) -> None:
    with (
        FakeNode(channel, 5, dict(IDENTITY)) as fake,
        running(channel, Role.OBSERVER, describe(5), guard_time_s=0.05) as gait,
    ):
        time.sleep(0.2)  # four times guard_time_s: a master would have asked by then
        assert {can_id for can_id, _ in fake.seen} == {0x605}
        assert "node guarding is the master's" in str(gait.quality(time.monotonic_ns()).problem)


def test_a_master_starts_each_node_and_sends_sync_and_heartbeat(channel: str, describe: Describe) -> None:
    def counted() -> Counter[int]:
        return Counter(can_id for can_id, _ in list(fake.seen))

    with can.Bus(channel=channel, interface="virtual") as wire, FakeNode(channel, 5, dict(IDENTITY)) as fake:
        with running(channel, Role.MASTER, describe(5)):
            until(lambda: counted()[0x080] >= 5 and counted()[0x764] >= 3)
            assert (0x000, b"\x01\x05") in fake.seen
            assert (0x764, b"\x05") in fake.seen
            assert set(counted()) == {0x000, 0x080, 0x605, 0x764}
        silent = seen_until_now(wire, fake)  # no thread is left that could send later
        assert seen_until_now(wire, fake) == silent + 1


def test_a_rebooted_node_is_started_again_by_its_master(channel: str, describe: Describe) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)) as fake, running(channel, Role.MASTER, describe(5)):
        fake.boot_up()
        until(lambda: [frame for frame in list(fake.seen) if frame == (0x000, b"\x01\x05")][1:])


@pytest.mark.parametrize("answers", [True, False])
def test_a_master_guards_a_node_that_has_no_heartbeat(
    channel: str, describe: Describe, answers: bool
) -> None:
    times = {"guard_time_s": 0.06, "stale_after_s": 0.5, "lost_after_s": 0.6}
    with (
        can.Bus(channel=channel, interface="virtual") as wire,
        FakeNode(channel, 5, dict(IDENTITY)) as fake,
        running(channel, Role.MASTER, describe(5), **times) as gait,
    ):
        asked = 0

        def guard() -> None:
            nonlocal asked
            message = wire.recv(0.01)
            if message is not None and message.is_remote_frame and message.arbitration_id == 0x705:
                asked += 1
                if answers:
                    fake.heartbeat(0x05 | 0x80 * (asked % 2))

        def is_as_it_should() -> bool:
            quality = gait.quality(time.monotonic_ns())
            if answers:
                return quality.state is ComponentState.OK and gait.node.life.heartbeats >= 8
            return quality.state is ComponentState.LOST and "heartbeat has been missing" in str(
                quality.problem
            )

        until(lambda: asked >= 10 and is_as_it_should(), step=guard)
