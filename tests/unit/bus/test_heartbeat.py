"""Our own heartbeat: in either role, without drift, and only as long as the gateway is alive."""

import time
from collections.abc import Iterator

import can
import pytest

from drivers.bus import heartbeat as heartbeats
from drivers.bus.bus import CanBus
from drivers.bus.cycles import next_due
from drivers.bus.heartbeat import Heartbeat
from drivers.bus.settings import CanSettings, Role
from drivers.errors import SettingsError
from tests.support.waiting import until

OURS = 0x700 + 100


@pytest.fixture(params=[Role.OBSERVER, Role.MASTER])
def bus(request: pytest.FixtureRequest, channel: str) -> CanBus:
    return CanBus("main", CanSettings(interface="virtual", channel=channel, node_id=100), request.param)


@pytest.fixture
def wire(channel: str) -> Iterator[can.BusABC]:
    with can.Bus(channel=channel, interface="virtual") as wire:
        yield wire


def frames(wire: can.BusABC) -> list[tuple[int, bytes]]:
    """What has come since the last call."""
    found = []
    while (message := wire.recv(0)) is not None:
        found.append((message.arbitration_id, bytes(message.data)))
    return found


def test_it_is_sent_in_either_role_and_ends_with_its_owner(bus: CanBus, wire: can.BusABC) -> None:
    heartbeat = Heartbeat(bus, 0.01)
    heartbeat.start()
    found: list[tuple[int, bytes]] = []

    def enough() -> bool:
        heartbeat.feed()
        found.extend(frames(wire))
        return len(found) >= 5

    until(enough)
    assert set(found) == {(OURS, b"\x05")}
    heartbeat.stop()
    frames(wire)  # its thread has ended, which every test is asked for: none comes later
    assert not bus._handlers, "nobody listens for it any more"


def test_it_ends_when_nobody_feeds_it(bus: CanBus, wire: can.BusABC, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heartbeats, "HUNG_S", 0.2)
    heartbeat = Heartbeat(bus, 0.01)
    heartbeat.start()

    def silent() -> bool:
        frames(wire)
        time.sleep(0.1)  # ten times its period: silence is what is asked for
        return not frames(wire)

    until(silent)
    heartbeat.feed()
    until(lambda: frames(wire))
    heartbeat.stop()


def test_it_ends_when_the_bus_itself_hangs(
    bus: CanBus, wire: can.BusABC, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(heartbeats, "HUNG_S", 0.2)
    hangs = True

    def handler(_stamp_ns: int, _data: bytes) -> None:
        until(lambda: not hangs)

    bus.subscribe(0x123, handler)
    heartbeat = Heartbeat(bus, 0.01)
    heartbeat.start()

    def beats() -> bool:
        heartbeat.feed()
        return bool(frames(wire))

    until(beats)
    wire.send(can.Message(arbitration_id=0x123, is_extended_id=False))

    def silent() -> bool:
        heartbeat.feed()
        frames(wire)
        time.sleep(0.1)  # ten times its period: silence is what is asked for
        return not frames(wire)

    until(silent)
    hangs = False
    until(beats)
    heartbeat.stop()


def test_somebody_else_with_our_node_id_is_said(bus: CanBus, wire: can.BusABC) -> None:
    heartbeat = Heartbeat(bus, 0.01)
    heartbeat.start()
    until(lambda: frames(wire))
    assert heartbeat.problem is None
    wire.send(can.Message(arbitration_id=OURS, data=b"\x05", is_extended_id=False))
    until(lambda: heartbeat.problem is not None)
    assert "node 100" in str(heartbeat.problem)
    assert "another node_id" in str(heartbeat.problem)
    heartbeat.stop()


def test_a_bus_without_a_node_id_of_ours_is_refused(channel: str) -> None:
    with pytest.raises(SettingsError, match=r"\[can.main\] lacks node_id"):
        Heartbeat(CanBus("main", CanSettings(interface="virtual", channel=channel)), 0.1)


@pytest.mark.parametrize(
    ("due", "now", "following"),
    [
        (10.0, 10.0, 11.0),
        (10.0, 10.4, 11.0),  # late: the next one is not, nothing drifts
        (10.0, 11.0, 12.0),  # one was missed: it is not made up for
        (10.0, 17.3, 18.3),
    ],
)
def test_cycles_do_not_drift_and_what_was_missed_is_not_made_up_for(
    due: float, now: float, following: float
) -> None:
    assert next_due(due, 1.0, now) == pytest.approx(following)
