"""A bus opens for those who hold it, says what is wrong, and comes back."""

import itertools
import socket
import sys
import threading
import time
from collections.abc import Iterator

import can
import pytest
from can.interfaces.virtual import VirtualBus

from drivers.bus.bus import BusUser, CanBus
from drivers.bus.frames import ERROR, EXTENDED, Transport, wire_id
from drivers.bus.interfaces.controller_state import BusState, bus_state
from drivers.bus.sender import Sender
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.narrow import NarrowTransport


class Recorder(BusUser):
    def __init__(self) -> None:
        self.events: list[str] = []
        self.ticks = 0

    def bus_opened(self) -> None:
        self.events.append("opened")

    def bus_closed(self) -> None:
        self.events.append("closed")

    def tick(self, now_ns: int) -> None:
        self.ticks += 1


@pytest.fixture
def peer(request: pytest.FixtureRequest) -> Iterator[can.BusABC]:
    with can.Bus(channel=request.node.name, interface="virtual") as bus:
        yield bus


@pytest.fixture
def bus(request: pytest.FixtureRequest) -> Iterator[CanBus]:
    bus = CanBus("main", CanSettings(interface="virtual", channel=request.node.name))
    bus.start()
    until(lambda: bus.opened)
    yield bus
    bus.stop()


def test_frames_reach_their_handlers_with_the_time_of_reception(bus: CanBus, peer: can.BusABC) -> None:
    got: list[tuple[int, bytes]] = []
    bus.subscribe(0x181, lambda stamp_ns, data: got.append((stamp_ns, data)))
    before_ns = time.monotonic_ns()
    peer.send(can.Message(arbitration_id=0x181, data=b"\x01\x02", is_extended_id=False))
    until(lambda: got)
    assert got[0][1] == b"\x01\x02"
    assert before_ns <= got[0][0] <= time.monotonic_ns()


def test_an_extended_identifier_is_not_taken_for_a_short_one(bus: CanBus, peer: can.BusABC) -> None:
    got: list[str] = []
    bus.subscribe(0x181, lambda *_: got.append("short"))
    bus.subscribe(0x181 | EXTENDED, lambda *_: got.append("long"))
    peer.send(can.Message(arbitration_id=0x181, data=b"", is_extended_id=True))
    peer.send(can.Message(arbitration_id=0x181, data=b"", is_extended_id=False))
    until(lambda: len(got) == 2)
    assert got == ["long", "short"]


@pytest.mark.parametrize(
    ("cob_id", "expected"),
    [(0x601, 0x601), (0x7FF, 0x7FF), (0x800, 0x800 | EXTENDED), (0x1FFF_FFFF, 0x9FFF_FFFF)],
)
def test_a_configured_identifier_above_eleven_bits_is_an_extended_one(cob_id: int, expected: int) -> None:
    assert wire_id(cob_id) == expected


def test_several_handlers_share_an_identifier_and_leave_one_by_one(bus: CanBus, peer: can.BusABC) -> None:
    got: list[str] = []

    def first(*_: object) -> None:
        got.append("first")

    def second(*_: object) -> None:
        got.append("second")

    def send() -> None:
        peer.send(can.Message(arbitration_id=0x181, data=b"", is_extended_id=False))

    bus.subscribe(0x181, first)
    bus.subscribe(0x181, second)
    send()
    until(lambda: got == ["first", "second"])
    bus.unsubscribe(0x181, first)
    send()
    until(lambda: got == ["first", "second", "second"])
    bus.unsubscribe(0x181, second)
    bus.unsubscribe(0x181, second)
    send()
    until(lambda: 0x181 in bus.unclaimed)
    assert got == ["first", "second", "second"]


def test_a_handler_that_fails_silences_nobody_and_is_told(bus: CanBus, peer: can.BusABC) -> None:
    got: list[bytes] = []

    def broken(_stamp_ns: int, _data: bytes) -> None:
        raise ZeroDivisionError("oops")

    bus.subscribe(0x181, broken)
    bus.subscribe(0x182, lambda _, data: got.append(data))
    for can_id in (0x181, 0x182):
        peer.send(can.Message(arbitration_id=can_id, data=b"\x07", is_extended_id=False))
    until(lambda: got)
    assert bus.failed_handlers == 1
    assert "0x181: ZeroDivisionError: oops" in str(bus.problem)


def test_a_user_that_fails_silences_nobody_and_is_told(bus: CanBus) -> None:
    class Broken(BusUser):
        def tick(self, now_ns: int) -> None:
            raise ZeroDivisionError("oops")

    user, broken = Recorder(), Broken()
    bus.hold(broken)
    bus.hold(user)
    until(lambda: user.ticks > 1)
    assert bus.opened == 1
    assert "at a tick: ZeroDivisionError: oops" in str(bus.problem)
    bus.release(broken)
    bus.release(user)


class TestUnexpectedErrors:
    """What no transport should raise is named, and the bus comes back all the same."""

    @pytest.fixture
    def opened(self, monkeypatch: pytest.MonkeyPatch) -> list[NarrowTransport]:
        """Every transport that was opened."""
        opened: list[NarrowTransport] = []

        def open_transport(_settings: CanSettings) -> NarrowTransport:
            opened.append(NarrowTransport(room=1000))
            return opened[-1]

        monkeypatch.setattr("drivers.bus.bus.open_transport", open_transport)
        return opened

    def test_in_receiving(self, opened: list[NarrowTransport]) -> None:
        bus, user = CanBus("main", CanSettings(interface="odd", channel="x")), Recorder()
        problems: list[str | None] = []

        class Asking(BusUser):
            def bus_closed(self) -> None:
                problems.append(bus.problem)

        asking = Asking()
        bus.hold(asking)
        bus.hold(user)
        until(lambda: user.events == ["opened"])
        opened[0].incoming.put(ZeroDivisionError("oops"))
        until(lambda: user.events == ["opened", "closed", "opened"])
        assert problems == ["internal error: ZeroDivisionError: oops"]
        assert opened[0].closed
        bus.send(0x601, b"")
        assert opened[1].sent == [(0x601, b"")]
        bus.release(asking)
        bus.release(user)

    def test_in_opening(self, monkeypatch: pytest.MonkeyPatch) -> None:
        times: list[float] = []

        def open_transport(_settings: CanSettings) -> NarrowTransport:
            times.append(time.monotonic())
            if len(times) < 4:
                raise KeyError("host")
            return NarrowTransport()

        monkeypatch.setattr("drivers.bus.bus.open_transport", open_transport)
        bus = CanBus("main", CanSettings(interface="odd", channel="x"))
        bus.start()
        until(lambda: bus.problem)
        assert bus.problem == "internal error: KeyError: 'host'"
        until(lambda: bus.opened)
        pauses = [after - before for before, after in itertools.pairwise(times)]
        assert all(pause >= least for pause, least in zip(pauses, (0.1, 0.2, 0.4), strict=True))
        assert bus.problem is None
        bus.stop()

    def test_in_closing(self, opened: list[NarrowTransport], monkeypatch: pytest.MonkeyPatch) -> None:
        bus, user = CanBus("main", CanSettings(interface="odd", channel="x")), Recorder()
        bus.hold(user)
        until(lambda: user.events == ["opened"])
        monkeypatch.setattr(opened[0], "close", lambda: [][0])
        opened[0].incoming.put(Unavailable("it is gone"))
        until(lambda: user.events == ["opened", "closed", "opened"])
        bus.release(user)

    def test_an_interface_that_opens_and_fails_at_once_is_not_opened_again_and_again(
        self, opened: list[NarrowTransport], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(NarrowTransport, "receive", lambda self, timeout_s: [][0])
        pauses: list[float] = []
        bus = CanBus("main", CanSettings(interface="odd", channel="x"))
        monkeypatch.setattr(bus._stopping, "wait", pauses.append)
        bus.start()
        until(lambda: len(pauses) > 6)
        bus.stop()
        assert pauses[:7] == [0.1, 0.2, 0.4, 0.8, 1.6, 2.0, 2.0]


def test_users_are_told_that_the_bus_opened_and_that_time_passes(bus: CanBus) -> None:
    user = Recorder()
    bus.hold(user)
    bus.hold(user)
    until(lambda: user.ticks > 1)
    assert user.events == ["opened"]
    bus.release(user)


def test_a_bus_nobody_holds_is_closed_and_threads_take_turns_as_before() -> None:
    before_s = sys.getswitchinterval()
    bus = CanBus("main", CanSettings(interface="virtual", channel="closing"))
    user = Recorder()
    for _ in range(3):
        user.ticks = 0
        bus.hold(user)
        bus.start()
        until(lambda: user.ticks)
        assert sys.getswitchinterval() < before_s
        bus.release(user)
        bus.stop()
        assert sys.getswitchinterval() == pytest.approx(before_s)
    assert bus.opened == 3
    with pytest.raises(Unavailable, match="bus main is not open"):
        bus.send(0x601, bytes(8))


def test_whoever_sees_a_bus_open_may_send(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    seen: list[bool] = []
    start = Sender.start
    opening = CanBus("main", CanSettings(interface="virtual", channel=request.node.name))

    def noted(sender: Sender, transport: Transport) -> None:
        seen.append(opening.is_open or opening.opened > 0)
        start(sender, transport)

    monkeypatch.setattr(Sender, "start", noted)
    opening.start()
    until(lambda: opening.opened)
    opening.stop()
    assert seen == [False]


def test_an_interface_of_python_can_that_may_block_sends_in_the_buss_own_thread(
    peer: can.BusABC, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.setattr("drivers.bus.interfaces.python_can._NEVER_BLOCKS", ())
    for name in ("SEND_TIMEOUT_S", "URGENT_S"):
        monkeypatch.setattr(f"drivers.bus.sender.{name}", WAIT_S)
    senders: list[str] = []
    send = VirtualBus.send

    def note(self: VirtualBus, message: can.Message, timeout: float | None = None) -> None:
        senders.append(threading.current_thread().name)
        send(self, message, timeout)

    monkeypatch.setattr(VirtualBus, "send", note)
    bus = CanBus("main", CanSettings(interface="virtual", channel=request.node.name))
    bus.start()
    until(lambda: bus.opened)
    bus.send(0x601, b"\x01")
    assert not bus.send_urgent(0x12345 | EXTENDED, b"\x02")
    got = [peer.recv(WAIT_S), peer.recv(WAIT_S)]
    assert [(one.arbitration_id, one.is_extended_id, bytes(one.data)) for one in got if one is not None] == [
        (0x601, False, b"\x01"),
        (0x12345, True, b"\x02"),
    ]
    until(lambda: (bus.sent, bus.sent_bytes) == (2, 2))
    bus.stop()
    assert senders == ["main out"] * 2


def test_an_interface_that_is_not_there_is_named_and_tried_again() -> None:
    bus = CanBus("main", CanSettings(interface="slcan", channel="/dev/ttyNONE"))
    bus.start()
    until(lambda: bus.problem)
    assert "slcan channel /dev/ttyNONE cannot be opened" in str(bus.problem)
    bus.stop()


@pytest.mark.parametrize("more", [{}, {"host": "127.0.0.1"}, {"host": "127.0.0.1", "port": "x"}])
def test_a_socketcand_table_without_its_keys_says_so(more: dict[str, object]) -> None:
    bus = CanBus("main", CanSettings.from_table({"interface": "socketcand", "channel": "can0", **more}))
    bus.start()
    until(lambda: bus.problem)
    assert "needs the keys host and port" in str(bus.problem)
    bus.stop()


class Hub:
    """A socketcand server that can be killed and started again on its port."""

    def __init__(self, port: int = 0) -> None:
        self.listener = socket.create_server(("127.0.0.1", port), reuse_port=True)
        self.port = self.listener.getsockname()[1]
        self.connection: socket.socket | None = None
        self.thread = threading.Thread(target=self._serve)
        self.thread.start()

    def _serve(self) -> None:
        connection, _ = self.listener.accept()
        connection.sendall(b"< hi >")
        for _ in range(2):
            connection.recv(100)
            connection.sendall(b"< ok >")
        self.connection = connection

    def kill(self) -> None:
        self.thread.join()
        assert self.connection is not None
        self.connection.close()
        self.listener.close()


def used_s(name: str) -> float:
    """Of a processor, by the thread of that name."""
    (ident,) = (thread.ident for thread in threading.enumerate() if thread.name == name)
    assert ident is not None
    return time.clock_gettime(time.pthread_getcpuclockid(ident))


def test_a_hub_that_disappears_is_noticed_costs_no_cpu_and_is_found_again() -> None:
    hub = Hub()
    more = {"host": "127.0.0.1", "port": hub.port}
    bus = CanBus("main", CanSettings.from_table({"interface": "socketcand", "channel": "can0", **more}))
    user = Recorder()
    bus.hold(user)
    until(lambda: user.events == ["opened"])
    hub.kill()
    until(lambda: user.events == ["opened", "closed"])
    until(lambda: "nothing answers as socketcand" in str(bus.problem))
    began_s = used_s("can main")
    time.sleep(1.0)  # what it costs meanwhile is what is asked
    assert used_s("can main") - began_s < 0.3
    hub = Hub(hub.port)
    until(lambda: user.events == ["opened", "closed", "opened"])
    assert bus.problem is None
    bus.release(user)
    hub.kill()


@pytest.mark.parametrize(
    ("can_id", "data", "state"),
    [
        (0x004, "00 04", BusState.WARNING),
        (0x004, "00 08", BusState.WARNING),
        (0x004, "00 10", BusState.PASSIVE),
        (0x204, "00 20", BusState.PASSIVE),
        (0x004, "00 40", BusState.ACTIVE),
        (0x004, "00 01", None),  # an overflow says nothing about the state
        (0x040, "", BusState.OFF),
        (0x100, "", BusState.ACTIVE),
        (0x020, "", None),
    ],
)
def test_error_frames_tell_the_controllers_state(can_id: int, data: str, state: BusState | None) -> None:
    assert bus_state(can_id | ERROR, bytes.fromhex(data)) is state
    assert bus_state(can_id, bytes.fromhex(data)) is None


def test_bus_off_and_back_is_seen_on_the_bus(bus: CanBus, peer: can.BusABC) -> None:
    def error_frame(can_id: int, data: bytes) -> None:
        peer.send(can.Message(arbitration_id=can_id, data=data, is_error_frame=True, is_extended_id=False))

    error_frame(0x40, b"")
    until(lambda: bus.state is BusState.OFF)
    error_frame(0x100, b"")
    until(lambda: bus.state is BusState.ACTIVE)
