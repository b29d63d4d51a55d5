"""Eight drives on a fully loaded bus, as a process of its own: answers SDO, then sends every TPDO in turn.

Started as `python -m tests.bench._drives PORT`, it is a socketcand server there; as `… fd N` it carries
`struct can_frame` datagrams over the inherited AF_UNIX socket N. A line on its standard input starts the
stream: frames a second and seconds. It answers with the number of frames it sent.
"""

import select
import socket
import struct
import sys
import time
from collections.abc import Callable

from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_objects, tpdo

DRIVES = 8
PAUSE_S = 0.00005  # frames come one by one, as on a wire: bursts would flatter the reader
MAPPED = (0x60410010, 0x60640020, 0x60770010)  # statusword, position, torque: 8 bytes
_CAN = struct.Struct("=IB3x8s")


def objects(node_id: int) -> dict[tuple[int, int], bytes]:
    """What one drive holds."""
    return drive_objects() | tpdo(1, 0x40000180 + node_id, *MAPPED)


def frames() -> list[tuple[int, bytes]]:
    """One TPDO of each drive."""
    return [(0x181 + at, struct.pack("<Hih", 0x1637, 1000 * at, 10 * at)) for at in range(DRIVES)]


class Drives:
    """The SDO servers of all drives, and the stream of their TPDOs."""

    def __init__(self, send: Callable[[int, bytes], None]) -> None:
        self._send = send
        self._nodes = {0x600 + id_: FakeNode("", id_, objects(id_)) for id_ in range(1, DRIVES + 1)}
        for node in self._nodes.values():
            node.send = send  # type: ignore[method-assign,assignment]

    def hear(self, can_id: int, data: bytes) -> None:
        if can_id in self._nodes:
            self._nodes[can_id]._answer(data)

    def stream(self, rate: float, seconds: float) -> int:
        """Send at `rate`, one by one as on a wire; returns how many were sent."""
        turn, sent = frames(), 0
        began = time.perf_counter()
        while (now := time.perf_counter()) - began < seconds:
            while sent < (now - began) * rate:
                self._send(*turn[sent % DRIVES])
                sent += 1
            time.sleep(PAUSE_S)
        return sent


def serve(read: Callable[[], list[tuple[int, bytes]]], wire: socket.socket, drives: Drives) -> None:
    while True:
        ready, _, _ = select.select([wire, sys.stdin], [], [])
        if wire in ready:
            for can_id, data in read():
                drives.hear(can_id, data)
        if sys.stdin in ready:
            line = sys.stdin.readline()
            if not line:
                return
            rate, seconds = map(float, line.split())
            sys.stdout.write(f"{drives.stream(rate, seconds)}\n")
            sys.stdout.flush()


def socketcand(port: int) -> None:
    with socket.create_server(("127.0.0.1", port)) as listener:
        sys.stdout.write(f"{listener.getsockname()[1]}\n")
        sys.stdout.flush()
        wire, _ = listener.accept()
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    wire.sendall(b"< hi >")
    for _ in range(2):
        wire.recv(100)
        time.sleep(0.02)  # python-can wants each answer alone
        wire.sendall(b"< ok >")
    time.sleep(0.05)

    def send(can_id: int, data: bytes) -> None:
        wire.sendall(b"< frame %03X 1.000000 %s >" % (can_id, data.hex().encode()))

    def read() -> list[tuple[int, bytes]]:
        heard = []
        data = wire.recv(65536)
        if not data:
            sys.exit(0)
        for message in data.decode().split(">")[:-1]:
            words = message.split()
            if words[1] == "send":
                heard.append((int(words[2], 16), bytes(int(byte, 16) for byte in words[4:])))
        return heard

    serve(read, wire, Drives(send))


def datagrams(descriptor: int) -> None:
    wire = socket.socket(fileno=descriptor)

    def read() -> list[tuple[int, bytes]]:
        can_id, length, data = _CAN.unpack(wire.recv(_CAN.size))
        return [(can_id, data[:length])]

    serve(read, wire, Drives(lambda can_id, data: void(wire.send(_CAN.pack(can_id, len(data), data)))))


def void(_: object) -> None:
    """For a callback whose result nobody wants."""


if __name__ == "__main__":
    if sys.argv[1] == "fd":
        datagrams(int(sys.argv[2]))
    else:
        socketcand(int(sys.argv[1]))
