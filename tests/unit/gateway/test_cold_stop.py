"""A stop while nothing runs: the first quick stop leaves at once; what has confirmed is not waited for."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from drivers.bus.frames import EXTENDED
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable
from drivers.joint.quick_stop import StopOutcome
from gateway.modules.stop.controllers import Controllers
from gateway.modules.stop.first_stop import FirstStop
from gateway.modules.stop.stop import StopAnswers
from gateway.modules.stop.stopper import Stopper
from gateway.modules.stop.target import Report
from gateway.process.futures import done
from gateway.process.loop import Loop
from gateway.registry import Context, Spec
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import Bench, Client, config, serving

ROBOT = """
[robot]
name = "exo-test"
[gateway]
port = 0
linger_s = 0.05
[can.left]
interface = "socketcan"
channel = "can0"
[can.right]
interface = "socketcand"
channel = "can1"
[can.sensors]
interface = "socketcan"
channel = "can2"
[can.bench]
interface = "slcan"
channel = "/dev/null"
"""
JOINT = """
[joint.{name}]
bus = "{bus}"
node_id = {node_id}
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
"""
JOINTS = (
    JOINT.format(name="left_knee", bus="left", node_id=2)
    + JOINT.format(name="left_hip", bus="left", node_id=3)
    + "axis = 1\nsdo_cob_ids = [0x10001, 0x10002]\n"
    + JOINT.format(name="right_knee", bus="right", node_id=5)
    + JOINT.format(name="trunk", bus="bench", node_id=6)
)
QUICK_STOP = bytes.fromhex("2b40600002000000")  # 6040h:00 = 0002h, expedited (CiA 301 §7.2.4.3.3)
OF_AXIS_1 = bytes.fromhex("2b40680002000000")


class Wires:
    """What is sent on which channel; each can be broken."""

    def __init__(self) -> None:
        self.sent: list[tuple[str | int, int, bytes]] = []
        self.opened: list[str | int] = []
        self.closed: list[str | int] = []
        self.full = 0  # frames that are not taken at first
        self.blocked = threading.Event()
        self.blocked.set()

    def open(self, settings: CanSettings) -> "Wire":
        self.opened.append(settings.channel)
        if settings.channel == "can0":
            assert self.blocked.wait(WAIT_S)
        return Wire(self, settings.channel)


class Wire:
    """One open channel."""

    def __init__(self, wires: Wires, channel: str | int) -> None:
        self._wires = wires
        self._channel = channel

    def try_send(self, can_id: int, data: bytes) -> bool:
        if self._wires.full:
            self._wires.full -= 1
            return False
        self._wires.sent.append((self._channel, can_id, data))
        return True

    def await_room(self, timeout_s: float) -> None:
        """There is some."""

    def close(self) -> None:
        self._wires.closed.append(self._channel)


@pytest.fixture
def wires(monkeypatch: pytest.MonkeyPatch) -> Wires:
    wires = Wires()
    monkeypatch.setattr("drivers.bus.interfaces.opening.open_transport", wires.open)
    return wires


@pytest.fixture
def first(tmp_path: Path) -> Iterator[FirstStop]:
    first = FirstStop(config(tmp_path, ROBOT + JOINTS))
    yield first
    first.join()


def test_it_goes_to_every_joint_by_its_own_channel_where_more_than_one_may_send(
    wires: Wires, first: FirstStop
) -> None:
    first.begin()
    first.join()
    assert sorted(wires.sent) == [
        ("can0", 0x602, QUICK_STOP),
        ("can0", 0x10001 | EXTENDED, OF_AXIS_1),
        ("can1", 0x605, QUICK_STOP),
    ]
    assert sorted(wires.closed) == sorted(wires.opened) == ["can0", "can1"]


def test_a_bus_that_hangs_delays_no_other_and_is_tried_once_at_a_time(wires: Wires, first: FirstStop) -> None:
    wires.blocked.clear()
    first.begin()
    until(lambda: "can1" in wires.closed, "the other bus has its stop")
    first.begin()
    wires.blocked.set()
    first.join()
    assert len(wires.opened) == 2
    first.begin()
    first.join()
    assert len(wires.opened) == 4


def test_a_bus_that_takes_no_frame_for_a_moment_is_waited_for(wires: Wires, first: FirstStop) -> None:
    wires.full = 2
    first.begin()
    first.join()
    assert len(wires.sent) == 3


def test_a_bus_that_cannot_be_opened_is_told(
    first: FirstStop, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(settings: CanSettings) -> Wire:
        raise Unavailable(f"{settings.channel} is down")

    monkeypatch.setattr("drivers.bus.interfaces.opening.open_transport", refuse)
    first.begin()
    first.join()
    assert "can0 is down" in caplog.text
    assert "can1 is down" in caplog.text


class Slow:
    """A module in the place of `control` that does not come up as long as a test wants."""

    may_start = threading.Event()

    def __init__(self, context: Context) -> None:
        assert self.may_start.wait(WAIT_S)
        raise OSError("enough")


def test_it_leaves_before_anything_else_has_started(wires: Wires, tmp_path: Path) -> None:
    Slow.may_start.clear()
    specs = {"control": Spec(f"{__name__}:Slow")}
    with serving(config(tmp_path, ROBOT + JOINTS), specs=specs) as address, Client(address) as client:
        client.call("clock.read")
        assert wires.opened == []
        client.request("robot.stop", reason="cold")
        until(lambda: len(wires.sent) == 3, "every joint was asked")
        Slow.may_start.set()


def test_where_the_stop_s_own_modules_run_nothing_is_sent_beside_them(
    bench: Bench, wires: Wires, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("robot.describe")
        monkeypatch.setattr("gateway.modules.stop.first_stop.SHARED", ("virtual",))
        assert client.call("robot.stop")["held"]
        assert wires.opened == []


def test_what_has_confirmed_is_not_kept_waiting_for_until_its_node_has_booted(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drive stops as soon as its bus is open; all that is read of it when it comes up takes longer."""
    monkeypatch.setattr("gateway.modules.component.module.COLD_S", 1000.0)
    bench.left.lost = bench.right.lost = "it is being read"
    with serving(config(tmp_path)) as address, Client(address) as client:
        drives = client.call("robot.stop")["drives"]
        assert drives == {"left_knee": "confirmed", "right_knee": "confirmed"}
    assert (bench.left.stops, bench.right.stops) == (1, 1)


@pytest.mark.parametrize(
    ("first", "asked"),
    [(StopOutcome.UNREACHABLE, 1), (StopOutcome.UNCONFIRMED, 1), (StopOutcome.CONFIRMED, 0)],
)
def test_what_could_not_be_reached_yet_is_asked_once_more_when_it_can_be(
    first: StopOutcome, asked: int, tmp_path: Path
) -> None:
    loop, knee = Loop(), FakeStopper()
    ready: Future[None] = Future()
    controllers = cast("Controllers", SimpleNamespace(targets={}, absent={}, names=frozenset()))
    stoppers = cast("dict[str, Stopper]", {"knee": knee})
    answers = StopAnswers(
        loop, config(tmp_path), stoppers, (), controllers, lambda _name: ready, lambda _name, _text: None
    )
    answer = answers.follow({"knee": done(Report(first))}, None)
    answer.add_done_callback(lambda _answer: loop.stop())
    loop.call_later(0.0, lambda: ready.set_result(None))
    loop.run()
    assert answer.result(0).drives == {"knee": "confirmed"}
    assert knee.asked == asked
    loop.close()


class FakeStopper:
    """A drive that confirms each stop."""

    def __init__(self) -> None:
        self.asked = 0

    def stop(self) -> "Future[Report]":
        self.asked += 1
        return done(Report(StopOutcome.CONFIRMED))
