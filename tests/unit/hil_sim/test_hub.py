"""The hub, with python-can's own socketcand interface and with clients that misbehave."""

import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing

import can
import pytest

from hil_sim.bus import hub as hub_module
from hil_sim.bus.can_bus import CanBus, Disturbance, Frame
from hil_sim.bus.hub import Hub
from hil_sim.bus.socketcand import Messages, frame_message, parse_send
from hil_sim.clock import Clock
from hil_sim.errors import SimulatorError
from hil_sim.loop import Loop
from tests.support.waiting import WAIT_S


class Running:
    """A bus with a hub, run by a thread; a participant talks each millisecond, with `load` more frames."""

    def __init__(self, load: int = 0) -> None:
        self._load = load
        self.clock = Clock()
        self.loop = Loop(self.clock)
        self.bus = CanBus(self.clock)
        self.hub = Hub(self.loop, self.bus)
        self.heard: list[Frame] = []
        self.bus.attach(self, self._hear)
        self._counter = 0
        self.clock.every(1_000_000, self._talk)
        self._thread = threading.Thread(target=self.loop.run)
        self._thread.start()

    def _hear(self, frame: Frame, _sender: object) -> None:
        self.heard.append(frame)

    def _talk(self) -> None:
        self._counter += 1
        self.bus.send(Frame(0x181, struct.pack("<Q", self._counter)), self)
        self.bus.send(Frame(0x080), self)
        for _ in range(self._load):
            self.bus.send(Frame(0x7FF, bytes(8)), self)

    def client(self) -> can.BusABC:
        return can.Bus(
            interface="socketcand", host="127.0.0.1", port=self.hub.port, channel="sim", tcp_tune=True
        )

    def close(self) -> None:
        self.loop.stop()
        self._thread.join()
        self.hub.close()
        self.loop.close()


@pytest.fixture
def running() -> Iterator[Running]:
    with closing(Running()) as running:
        yield running


def receive(bus: can.BusABC, wanted: Callable[[can.Message], bool]) -> can.Message:
    deadline_s = time.monotonic() + WAIT_S
    while (message := bus.recv(WAIT_S)) is not None:
        if wanted(message):
            return message
        assert time.monotonic() < deadline_s, "it never came"
    raise AssertionError("the hub fell silent")


def test_clients_can_join_while_the_bus_is_busy(running: Running) -> None:
    with ExitStack() as stack:
        clients = [stack.enter_context(running.client()) for _ in range(20)]
        for client in clients:
            counters: list[int] = []
            while len(counters) < 20:
                message = receive(client, lambda message: message.arbitration_id == 0x181)
                counters.append(struct.unpack("<Q", message.data)[0])
            assert counters == list(range(counters[0], counters[0] + 20))


def test_a_frame_without_data_arrives(running: Running) -> None:
    with running.client() as client:
        assert receive(client, lambda message: message.arbitration_id == 0x080).dlc == 0


def test_a_client_reaches_the_bus_and_the_other_clients_but_not_itself(running: Running) -> None:
    with running.client() as one, running.client() as two:
        one.send(can.Message(arbitration_id=0x60A, data=[0x40, 0, 0x10, 0xFF], is_extended_id=False))
        got = receive(two, lambda message: message.arbitration_id == 0x60A)
        assert bytes(got.data) == b"\x40\x00\x10\xff"
        two.send(can.Message(arbitration_id=0x1ABCDEF0, data=b"", is_extended_id=True))
        answer = receive(one, lambda message: message.arbitration_id in (0x60A, 0x1ABCDEF0))
        assert answer.arbitration_id == 0x1ABCDEF0
        assert answer.is_extended_id
    assert Frame(0x60A, b"\x40\x00\x10\xff") in running.heard


class Loaded(Running):
    """More numbered frames than the bus has time for, for a second, once it may begin."""

    FRAMES = 8457  # of 8 bytes in a second at 1 Mbit/s
    begins = False

    def _talk(self) -> None:
        for _ in range(9):
            if self.begins and self._counter < self.FRAMES:
                self.bus.send(Frame(0x181, struct.pack("<Q", self._counter)), self)
                self._counter += 1


def test_a_fully_loaded_bus_reaches_three_clients_whole_and_in_order() -> None:
    with closing(Loaded()) as running, ExitStack() as stack:
        clients = [stack.enter_context(running.client()) for _ in range(3)]
        running.begins = True
        for client in clients:
            got = [receive(client, lambda _: True).data for _ in range(Loaded.FRAMES)]
            assert got == [struct.pack("<Q", counter) for counter in range(Loaded.FRAMES)]
        assert running.hub.clients_cut == 0


def test_error_frames_reach_the_clients_and_cost_no_frame(running: Running) -> None:
    class EverySecondAttempt(Disturbance):
        attempts = 0

        def survives(self, _frame: Frame, _sender: object, /) -> bool:
            self.attempts += 1
            return self.attempts % 2 == 0

    with running.client() as client:
        running.bus.disturbances.append(EverySecondAttempt())
        error = receive(client, lambda message: message.is_error_frame)
        assert error.arbitration_id == 0x088  # Linux can/error.h: protocol violation, error on the bus
        counters: list[int] = []
        while len(counters) < 20:
            message = receive(client, lambda message: message.arbitration_id == 0x181)
            counters.append(struct.unpack("<Q", message.data)[0])
        assert counters == list(range(counters[0], counters[0] + 20))


def connect(running: Running) -> socket.socket:
    return socket.create_connection(("127.0.0.1", running.hub.port), timeout=WAIT_S)


def test_a_client_that_never_reads_is_cut_and_the_others_lose_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(hub_module, "_BACKLOG_BYTES", 100_000)
    with closing(Running(load=5)) as running, socket.socket() as deaf, running.client() as client:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        deaf.settimeout(WAIT_S)
        deaf.connect(("127.0.0.1", running.hub.port))
        for command in (b"< open sim >", b"< rawmode >"):
            deaf.recv(100)
            deaf.sendall(command)
        deaf.recv(6)
        for theirs in running.hub._clients:  # else the kernel keeps megabytes for it first
            theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
        last = 0
        while running.hub.clients_cut == 0:
            message = receive(client, lambda message: message.arbitration_id == 0x181)
            (counter,) = struct.unpack("<Q", message.data)
            assert last in (0, counter - 1)
            last = counter
        assert last > 0


def test_clients_that_vanish_or_talk_nonsense_do_not_stop_the_hub(running: Running) -> None:
    with running.client() as client:
        for rubbish in (
            b"",
            b"< open sim",
            b"<<<>>>",
            b"\xff" * 10_000,
            b"< send 123 9 1 2 >",
            b"< send zz 1 1 >",
        ):
            with connect(running) as other:
                other.sendall(rubbish)
        with connect(running) as reset:
            reset.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        receive(client, lambda message: message.arbitration_id == 0x181)
        with running.client() as newcomer:
            receive(newcomer, lambda message: message.arbitration_id == 0x181)


def test_the_handshake_word_for_word(running: Running) -> None:
    with connect(running) as client:
        assert client.recv(100) == b"< hi >"
        client.sendall(b"< bcmmode >")
        assert client.recv(100) == b"< error unknown command >"
        client.sendall(b"< open sim >")
        assert client.recv(100) == b"< ok >"
        client.sendall(b"< rawmode >")
        assert client.recv(6) == b"< ok >"
        text = b""
        while text.count(b">") < 4:
            text += client.recv(1000)
        assert text.startswith((b"< frame 181 ", b"< frame 080 "))


def test_remote_frames_pass_between_who_knows_them_and_the_bus(running: Running) -> None:
    with connect(running) as knows, connect(running) as knows_not:
        for client, words in (
            (knows, b"< remote >< open sim >< rawmode >"),
            (knows_not, b"< open sim >< rawmode >"),
        ):
            assert client.recv(6) == b"< hi >"
            client.sendall(words)
        knows_not.sendall(b"< send 705 R >")
        text = b""
        while b"< frame 705 " not in text:
            text += knows.recv(1000)
        knows.sendall(b"< send 706 R >< send 707 0 >")
        others = b""
        while b"< frame 707 " not in others:
            others += knows_not.recv(1000)
    assert b" R >" in text
    assert b"< frame 706 " not in others
    assert Frame(0x706, remote=True) in running.heard


def test_it_listens_on_the_loopback_interface_only(running: Running) -> None:
    with connect(running) as client:
        assert client.getpeername()[0] == "127.0.0.1"
    listener = running.hub._listener
    assert listener.getsockname()[0] == "127.0.0.1"


def test_a_taken_port_is_refused_in_words(running: Running) -> None:
    loop = Loop(Clock())
    with pytest.raises(SimulatorError, match=f"port {running.hub.port} on 127.0.0.1 is taken"):
        Hub(loop, CanBus(loop.clock), running.hub.port)
    loop.close()


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (Frame(0x181, b"\x01\xab"), b"< frame 181 1.500000 01AB >"),
        (Frame(0x80), b"< frame 080 1.500000  >"),
        (Frame(0x1234, b"\x00", extended=True), b"< frame 00001234 1.500000 00 >"),
        (Frame(0x705, remote=True), b"< frame 705 1.500000 R >"),
    ],
)
def test_frames_as_the_protocol_writes_them(frame: Frame, text: bytes) -> None:
    assert frame_message(frame, 1.5) == text


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        ("send 123 2 1 ff", Frame(0x123, b"\x01\xff")),
        ("send 080 0", Frame(0x80)),
        ("send 00000123 1 a", Frame(0x123, b"\x0a", extended=True)),
        ("send 705 R", Frame(0x705, remote=True)),
        ("send 705 R 1", None),
        ("send 123 3 1 2", None),
        ("send 123 9 1 2 3 4 5 6 7 8 9", None),
        ("send 800 0", None),
        ("send 123 1 100", None),
        ("send 123", None),
        ("send", None),
        ("send -1 0", None),
    ],
)
def test_frames_as_clients_write_them(text: str, frame: Frame | None) -> None:
    assert parse_send(text.encode().split()) == frame


def test_messages_arrive_in_pieces_and_together() -> None:
    messages = Messages()
    assert messages.feed(b"< open si") == []
    assert messages.feed(b"m >< rawmode >< se") == [[b"open", b"sim"], [b"rawmode"]]
    assert messages.feed(b"x" * 5000) == []
    assert messages.bytes_dropped == 5004
    assert messages.feed(b"< echo >") == [[b"echo"]]
