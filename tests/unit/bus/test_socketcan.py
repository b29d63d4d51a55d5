"""The raw SocketCAN reader over datagrams that carry struct can_frame; link state out of netlink bytes."""

import errno
import socket
import struct
import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.bus.frames import ERROR, EXTENDED, REMOTE
from drivers.bus.interfaces.link_report import blocking_problem, missing_link, warning
from drivers.bus.interfaces.netlink import NetworkInterface, link_request, parse_link, read_link
from drivers.bus.interfaces.opening import open_transport
from drivers.bus.interfaces.socketcan import SocketCanTransport, filters
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable


@pytest.fixture
def wire() -> Iterator[tuple[SocketCanTransport, socket.socket]]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    transport = SocketCanTransport(ours, "interface can0")
    yield transport, theirs
    transport.close()
    theirs.close()


KEPT_WAITING_NS = 1_000_000_000  # between both clocks, on a busy computer: a stamp is older by so much then


def can_frame(can_id: int, data: bytes) -> bytes:
    return struct.pack("=IB3x8s", can_id, len(data), data)


@pytest.mark.parametrize(
    ("can_id", "data"),
    [(0x181, bytes(range(8))), (0x80, b""), (0x12345 | EXTENDED, b"\x01"), (ERROR | 0x40, bytes(8))],
)
def test_a_frame_comes_with_flags_data_and_time(
    wire: tuple[SocketCanTransport, socket.socket], can_id: int, data: bytes
) -> None:
    transport, peer = wire
    before_ns = time.monotonic_ns()
    peer.send(can_frame(can_id, data))
    ((stamp_ns, got_id, got_data),) = transport.receive(5.0)
    assert (got_id, got_data) == (can_id, data)
    assert before_ns - KEPT_WAITING_NS <= stamp_ns <= time.monotonic_ns()


def test_silence_returns_after_the_timeout(wire: tuple[SocketCanTransport, socket.socket]) -> None:
    transport, _ = wire
    assert transport.receive(0.01) == ()
    assert transport.receive(0.02) == ()


def test_what_is_no_frame_is_passed_over(wire: tuple[SocketCanTransport, socket.socket]) -> None:
    transport, peer = wire
    peer.send(b"short")
    assert transport.receive(5.0) == ()


def test_what_is_sent_is_a_can_frame(wire: tuple[SocketCanTransport, socket.socket]) -> None:
    transport, peer = wire
    transport.try_send(0x601, b"\x40\x41\x60\x00\x00\x00\x00\x00")
    assert peer.recv(100) == can_frame(0x601, b"\x40\x41\x60\x00\x00\x00\x00\x00")


def test_a_peer_that_is_gone_is_named(wire: tuple[SocketCanTransport, socket.socket]) -> None:
    transport, peer = wire
    peer.close()
    with pytest.raises(Unavailable, match="interface can0 does not send"):
        transport.try_send(0x601, bytes(8))


def test_what_the_socket_does_not_take_now_is_not_waited_for(
    wire: tuple[SocketCanTransport, socket.socket],
) -> None:
    transport, peer = wire
    count = 0
    while transport.try_send(0x601, count.to_bytes(4, "little")):
        count += 1
    transport.await_room(0.0)  # there is none
    assert not transport.try_send(0x601, b"")
    for number in range(count):
        assert peer.recv(100) == can_frame(0x601, number.to_bytes(4, "little"))
    transport.await_room(1000.0)
    assert transport.try_send(0x601, b"")


def test_a_full_queue_of_the_interface_is_no_error() -> None:
    class FullQueue(socket.socket):
        def send(self, data: object, flags: int = 0) -> int:
            raise OSError(errno.ENOBUFS, "No buffer space available")

    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    transport = SocketCanTransport(FullQueue(fileno=ours.detach()), "interface can0")
    assert not transport.try_send(0x601, b"")
    transport.await_room(1000.0)  # the socket has room, and knows nothing of the queue
    assert transport.full == "interface can0 does not send: does anybody on the bus acknowledge?"
    transport.close()
    theirs.close()


def test_kernel_stamps_become_monotonic_and_drops_are_counted() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    transport = SocketCanTransport(ours, "interface can0")
    second_ago_ns = time.time_ns() - 1_000_000_000
    stamp = struct.pack("@ll", *divmod(second_ago_ns, 1_000_000_000))
    ancillary = [(socket.SOL_SOCKET, 35, stamp), (socket.SOL_SOCKET, 40, (7).to_bytes(4, "little"))]
    assert abs(time.monotonic_ns() - 1_000_000_000 - transport._stamp_ns(ancillary)) < 500_000_000
    assert transport.dropped == 7
    future = struct.pack("@ll", 2**33, 0)  # wall time was set back: never a stamp in the future
    assert transport._stamp_ns([(socket.SOL_SOCKET, 35, future)]) <= time.monotonic_ns()
    transport.close()
    theirs.close()


def test_an_interface_that_is_not_there_is_named_with_what_is() -> None:
    with pytest.raises(Unavailable, match=r"there is no interface can99; .*: plug the adapter in"):
        open_transport(CanSettings(interface="socketcan", channel="can99", bitrate=1_000_000))
    assert missing_link("can99")


def attribute(kind: int, data: bytes) -> bytes:
    return (struct.pack("=HH", 4 + len(data), kind) + data).ljust((4 + len(data) + 3) & ~3, b"\0")


def link_message(up: bool = True, bitrate: int = 500_000, restart_ms: int = 100, state: int = 0) -> bytes:
    can = attribute(1, struct.pack("=8I", bitrate, *range(7))) + attribute(4, struct.pack("=I", state))
    can += attribute(6, struct.pack("=I", restart_ms))
    info = attribute(1, b"can\0") + attribute(2 | 0x8000, can)
    body = (
        struct.pack("=BxHiII", 0, 280, 3, int(up), 0) + attribute(3, b"can0\0") + attribute(18 | 0x8000, info)
    )
    return struct.pack("=IHHII", 16 + len(body), 16, 0, 1, 0) + body


def test_a_can_link_is_read_out_of_the_kernels_answer() -> None:
    link = parse_link(link_message(state=2))
    assert link == NetworkInterface(
        up=True, kind="can", bitrate=500_000, restart_ms=100, state="error passive"
    )
    down = parse_link(link_message(up=False))
    assert down is not None
    assert not down.up


def test_other_answers_are_no_link() -> None:
    error = struct.pack("=IHHII", 36, 2, 0, 1, 0) + struct.pack("=i", -errno.ENODEV) + bytes(16)
    assert parse_link(error) is None
    assert parse_link(b"") is None


@given(st.binary(max_size=200), st.integers(0, 200))
def test_damaged_answers_never_break_the_parser(garbage: bytes, cut: int) -> None:
    parse_link(link_message()[:cut])
    parse_link(link_message()[:32] + garbage)


def test_the_kernel_answers_for_a_link_that_is_always_there() -> None:
    link = read_link("lo")
    assert link is not None
    assert link.bitrate is None
    assert read_link("nothing99") is None
    assert len(link_request(1)) == 32


CAN = NetworkInterface(up=True, kind="can", bitrate=500_000, restart_ms=100, state="error active")


@pytest.mark.parametrize(
    ("link", "bitrate", "line"),
    [
        (
            NetworkInterface(False, "can", None, 0, "stopped"),
            500_000,
            "sudo ip link set can0 up type can bitrate 500000 restart-ms 100",
        ),
        (
            NetworkInterface(False, "can", None, 0, "stopped"),
            None,
            "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100",
        ),
        (NetworkInterface(False, "vcan", None, None, None), None, "sudo ip link set can0 up"),
    ],
)
def test_a_link_that_is_down_comes_with_the_line_that_mends_it(
    link: NetworkInterface, bitrate: int | None, line: str
) -> None:
    assert blocking_problem("can0", link, bitrate) == f"can0 is down; run: {line}"


def test_another_bitrate_and_no_restart_are_warned_about_and_block_nothing() -> None:
    assert blocking_problem("can0", CAN, 1_000_000) is None
    assert (
        "can0 runs at 500000 bit/s, the robot's file says 1000000; run: sudo ip link set can0 down && "
        in str(warning("can0", CAN, 1_000_000))
    )
    assert "stays off after bus off (restart-ms 0)" in str(
        warning("can0", NetworkInterface(True, "can", 500_000, 0, None), None)
    )
    assert warning("can0", CAN, 500_000) is None
    assert warning("can0", NetworkInterface(True, "vcan", None, None, None), 500_000) is None


PASSES = {0x182: True, 0x183: False, 0x702: True, 0x733: True, 0x700 | REMOTE: False, 0x80000733: False}


@pytest.mark.parametrize("can_id", PASSES)
def test_once_all_is_ready_the_kernel_passes_what_is_asked_for_and_every_heartbeat(can_id: int) -> None:
    """A node with an id that no table has, which boots later, is to be told (CiA 301 §7.2.8.3.2)."""
    rules = list(struct.iter_unpack("=II", filters(frozenset({0x182, 0x702, 0x582}))))
    assert len(rules) == 3, "no frame comes twice"
    assert any(can_id & mask == wanted & mask for wanted, mask in rules) is PASSES[can_id]


def test_what_is_too_much_for_the_kernel_is_not_filtered() -> None:
    for many in (None, frozenset(range(0x180, 0x180 + 600))):
        assert filters(many) == bytes(8)
