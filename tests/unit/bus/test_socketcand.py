"""The socketcand client: its parser at every split, and its words for a server that is not in order."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.bus import sender as senders
from drivers.bus.frames import ERROR, EXTENDED, REMOTE, Frame
from drivers.bus.interfaces import socketcand
from drivers.bus.interfaces.socketcand import (
    MAX_PENDING,
    SocketcandParser,
    SocketcandTransport,
    frame_of,
    send_message,
)
from drivers.bus.sender import Sender
from drivers.errors import Unavailable
from tests.support.waiting import WAIT_S, until

SECOND_NS = 1_000_000_000
STREAM = (
    "< frame 181 1234.5 0102030405060708 >< frame 1FFFFFFF 0.0 AA >< error 20000004 1.0 >< frame 702 1.0 05 >"
)


@pytest.mark.parametrize("split", range(len(STREAM) + 1))
def test_messages_survive_every_split(split: int) -> None:
    parser = SocketcandParser()
    messages = parser.feed(STREAM[:split]) + parser.feed(STREAM[split:])
    frames = [frame_of(message, 7) for message in messages]
    assert frames == [
        (7, 0x181, bytes.fromhex("0102030405060708")),
        (7, 0x1FFFFFFF | EXTENDED, b"\xaa"),
        (7, 0x004 | ERROR, b""),
        (7, 0x702, b"\x05"),
    ]


@pytest.mark.parametrize(
    "message",
    [
        "",
        " frame",
        " frame 181",
        " frame xyz 1.0 01",
        " frame -1 1.0 01",
        " frame -1FFFFFF 1.0 01",
        " frame 800 1.0 01",
        " frame 20000000 1.0 01",
        " frame 181 1.0 0",
        " frame 181 1.0 010203040506070809",
        " error unknown command ",
        " error -88 1.0 ",
        " error 088 ",
    ],
)
def test_a_damaged_message_is_no_frame(message: str) -> None:
    assert frame_of(message, 0) is None


def test_a_frame_without_data_is_a_frame() -> None:
    assert frame_of(" frame 080 1.0 ", 3) == (3, 0x80, b"")


@given(st.text(max_size=200))
def test_garbage_costs_only_itself(garbage: str) -> None:
    parser = SocketcandParser()
    parser.feed(garbage)
    messages = parser.feed("> < frame 181 1.0 01 >")
    assert frame_of(messages[-1], 0) == (0, 0x181, b"\x01")


def test_a_stream_without_an_end_is_bounded() -> None:
    parser = SocketcandParser()
    assert parser.feed("<" + "x" * 2 * MAX_PENDING) == []
    assert parser.skipped == 1
    assert parser.feed("< frame 181 1.0 01 >")


def test_what_is_sent_is_what_the_protocol_says() -> None:
    assert send_message(0x601, bytes([0x40, 0x41, 0x60, 0])) == "< send 601 4 40 41 60 00 >"
    assert send_message(0x12345 | EXTENDED, b"") == "< send 00012345 0  >"


@contextlib.contextmanager
def server(*answers: bytes, then: bytes = b"", keep_open: bool = False) -> Iterator[int]:
    """A server that gives one answer a request, the first at once; returns its port."""
    done = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                for number, answer in enumerate(answers):
                    if number:
                        connection.recv(100)
                    connection.sendall(answer)
                connection.sendall(then)
                if keep_open:
                    done.wait(WAIT_S)

        thread = threading.Thread(target=serve)
        thread.start()
        yield listener.getsockname()[1]
        done.set()
        thread.join()


def receive(transport: SocketcandTransport) -> list[Frame]:
    frames: list[Frame] = []
    while not frames:
        frames.extend(transport.receive(5.0))
    return frames


def test_a_frame_glued_to_the_handshake_is_not_lost() -> None:
    with server(b"< hi >", b"< ok >", b"< ok >< frame 181 1.0 0102 >", keep_open=True) as port:
        transport = SocketcandTransport("127.0.0.1", port, "can0")
        assert [frame[1:] for frame in receive(transport)] == [(0x181, b"\x01\x02")]
        transport.close()


class Trickle(socket.socket):
    """Takes seven bytes, then none, and so on: a network that is nearly stuck."""

    def __init__(self, original: socket.socket) -> None:
        super().__init__(fileno=original.detach())
        self.setblocking(False)
        self.calls = 0

    def send(self, data: bytes, flags: int = 0) -> int:  # type: ignore[override]
        self.calls += 1
        if self.calls % 2 == 0:
            raise BlockingIOError
        return super().send(data[:7])


@contextlib.contextmanager
def listening() -> Iterator[tuple[int, bytearray]]:
    """A server that takes all that comes after the handshake; its port, and what came."""
    lines = bytearray()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.sendall(b"< hi >")
                for _ in range(2):
                    connection.recv(100)
                    connection.sendall(b"< ok >")
                while data := connection.recv(777):
                    lines.extend(data)

        thread = threading.Thread(target=serve)
        thread.start()
        yield listener.getsockname()[1], lines
        thread.join()


FRAMES = [(0x601, number.to_bytes(8, "big")) for number in range(20)]
LINES = "".join(send_message(*frame) for frame in FRAMES)


def test_a_frame_that_leaves_in_part_is_mixed_with_no_other() -> None:
    with listening() as (port, lines):
        transport = SocketcandTransport("127.0.0.1", port, "can0")
        transport._out = Trickle(transport._out)
        refused = 0
        for frame in FRAMES:
            while not transport.try_send(*frame):
                refused += 1
        while not transport.flush():
            transport.await_room(1000.0)
        transport.close()
    assert refused >= len(FRAMES)
    assert lines.decode() == LINES


def test_what_is_left_of_a_frame_follows_though_nobody_sends_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(senders, "SEND_TIMEOUT_S", WAIT_S)
    with listening() as (port, lines):
        transport = SocketcandTransport("127.0.0.1", port, "can0")
        transport._out = Trickle(transport._out)
        sender = Sender("main", lambda: "bus main is not open")
        sender.start(transport)
        for frame in FRAMES:
            sender.send(*frame)
        until(lambda: lines.decode() == LINES)
        sender.stop()
        transport.close()
        sender.join()


def test_what_a_stuck_network_does_not_take_now_is_not_waited_for() -> None:
    with server(b"< hi >", b"< ok >", b"< ok >", keep_open=True) as port:
        transport = SocketcandTransport("127.0.0.1", port, "can0")
        while transport.try_send(*FRAMES[0]):
            pass
        transport.await_room(0.0)
        assert "is the CAN server, or the network to it, stuck?" in transport.full
        transport.close()


def test_a_remote_frame_is_refused_in_words() -> None:
    with server(b"< hi >", b"< ok >", b"< ok >", keep_open=True) as port:
        transport = SocketcandTransport("127.0.0.1", port, "can0")
        with pytest.raises(Unavailable, match="no remote frames, so no node guarding"):
            transport.try_send(0x702 | REMOTE, b"")
        transport.close()


def test_a_server_that_knows_remote_frames_is_told_first_and_gets_them() -> None:
    with server(b"< hi >", b"< ok >", b"< ok >", b"< ok >< frame 702 1.0 R >", keep_open=True) as port:
        transport = SocketcandTransport("127.0.0.1", port, "can0", remote_frames=True)
        assert [frame[1:] for frame in receive(transport)] == [(0x702 | REMOTE, b"")]
        assert transport.try_send(0x702 | REMOTE, b"")
        transport.close()
    assert send_message(0x702 | REMOTE, b"") == "< send 702 R >"
    assert frame_of(" frame 7G2 1.0 R ", 0) is None


def test_a_server_that_knows_no_remote_frames_says_so() -> None:
    words = b"< error unknown command >"
    with server(b"< hi >", words) as port, pytest.raises(Unavailable, match="'error unknown command'"):
        SocketcandTransport("127.0.0.1", port, "can0", remote_frames=True)


def test_a_server_that_does_not_greet_is_named() -> None:
    with server(b"< h", b"", keep_open=True) as port, pytest.raises(Unavailable, match="did not answer 'hi'"):
        SocketcandTransport("127.0.0.1", port, "can0")


def test_a_server_that_goes_is_noticed_at_once() -> None:
    with server(b"< hi >", b"< ok >", b"< ok >") as port:
        transport = SocketcandTransport("127.0.0.1", port, "can0")
        with pytest.raises(Unavailable, match="closed the connection"):
            receive(transport)
        transport.close()


def test_a_refused_channel_is_told_in_the_servers_words() -> None:
    words = b"< error could not open bus >"
    with server(b"< hi >", words) as port, pytest.raises(Unavailable, match="'error could not open bus'"):
        SocketcandTransport("127.0.0.1", port, "can9")


def test_a_server_that_is_not_there_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    with pytest.raises(Unavailable, match=rf"nothing answers as socketcand at 127\.0\.0\.1:{port}"):
        SocketcandTransport("127.0.0.1", port, "can0")


def test_what_waited_in_many_reads_is_taken_at_once_and_stamped_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(socketcand, "RECEIVE_BYTES", 100)
    burst = b"".join(b"< frame 181 %.3f 01 >" % (5.0 + number / 1000) for number in range(100))
    with server(b"< hi >", b"< ok >", b"< ok >", then=burst, keep_open=True) as port:
        transport = SocketcandTransport("127.0.0.1", port, "can0")
        until(lambda: len(transport._socket.recv(len(burst), socket.MSG_PEEK)) >= len(burst) - 100)
        since_ns = transport._read_ns = time.monotonic_ns() - SECOND_NS
        stamps = [frame[0] for frame in receive(transport)]
        transport.close()
    assert len(stamps) == 100
    assert stamps[-1] - stamps[0] == pytest.approx(99_000_000, abs=1000)
    assert since_ns < stamps[0] < stamps[-1] <= time.monotonic_ns()
