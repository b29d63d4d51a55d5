"""Eight CiA 402 drives on a fully loaded bus, as a process of its own that stamps every controlword.

Started as `python -m tests.bench._bus`, it is a socketcand server: its first line says on which port. Each
drive's TPDO is sent in turn, at the rate that the first line of its standard input says, and SDO is answered
meanwhile. On standard output it tells of each controlword `word NODE CONTROLWORD NS`, stamped when its bytes
were read, on the monotonic clock that all processes of a machine share. The line `trip NODE POSITION` sends
one TPDO with that position (counts), and is answered by `trip NODE POSITION NS`.

Real drives share no processor with the gateway: where the system allows it, these have a priority above it.
"""

import contextlib
import os
import select
import socket
import struct
import sys
import time

from drivers.realtime_priority import PRIORITY
from tests.bench._drives import DRIVES, MAPPED
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_objects, tpdo

_TPDO = struct.Struct("<Hih")
_CONTROLWORD, _STATUSWORD = (0x6040, 0), (0x6041, 0)
# What quick stop (0002h) makes of each state; the drive stays in quick stop active.
_AFTER_QUICK_STOP = {0x1637: 0x1617, 0x1617: 0x1617}


class Drive(FakeNode):
    """One drive: its objects, and what a controlword makes of its statusword."""

    def __init__(self, node_id: int) -> None:
        objects = drive_objects() | tpdo(1, 0x40000180 + node_id, *MAPPED)
        objects[_STATUSWORD] = (0x1637).to_bytes(2, "little")
        super().__init__("", node_id, objects, on_write=self._written)
        self.stamp_ns = 0
        self.position = 1000 * node_id

    def frame(self, position: int | None = None) -> bytes:
        statusword = int.from_bytes(self.objects[_STATUSWORD], "little")
        return _TPDO.pack(statusword, self.position if position is None else position, 10 * self.node_id)

    def _written(self, index: int, subindex: int, data: bytes) -> None:
        if (index, subindex) == _CONTROLWORD:
            word, now = int.from_bytes(data, "little"), int.from_bytes(self.objects[_STATUSWORD], "little")
            tell(f"word {self.node_id} {word} {self.stamp_ns}")
            self.objects[_STATUSWORD] = _AFTER_QUICK_STOP.get(now, now).to_bytes(2, "little")


def tell(line: str) -> None:
    os.write(1, f"{line}\n".encode("ascii"))


class Bus:
    """The server's one client, and the drives."""

    def __init__(self, wire: socket.socket) -> None:
        self._wire = wire
        self._rest = b""
        self.drives = {node_id: Drive(node_id) for node_id in range(1, DRIVES + 1)}
        for drive in self.drives.values():
            drive.send = self.send  # type: ignore[method-assign]

    def send(self, can_id: int, data: bytes) -> None:
        self._wire.sendall(b"< frame %03X 1.000000 %s >" % (can_id, data.hex().encode()))

    def hear(self) -> bool:
        """Take what has come; false at the end."""
        data = self._wire.recv(65536)
        stamp_ns = time.monotonic_ns()
        *messages, self._rest = (self._rest + data).split(b">")
        for message in messages:
            words = message.split()
            node_id = int(words[2], 16) - 0x600 if words[1:2] == [b"send"] else 0
            if node_id in self.drives:
                self.drives[node_id].stamp_ns = stamp_ns
                self.drives[node_id]._answer(bytes(int(byte, 16) for byte in words[4:]))
        return bool(data)

    def obey(self, line: str) -> None:
        _, node_id, position = line.split()
        self.send(0x180 + int(node_id), self.drives[int(node_id)].frame(int(position)))
        tell(f"trip {node_id} {position} {time.monotonic_ns()}")

    def run(self, rate: float) -> None:
        """One frame after another, as on a wire, and whatever comes in between."""
        began, sent = time.monotonic(), 0
        while True:
            due = began + sent / rate - time.monotonic()
            ready, _, _ = select.select([self._wire, sys.stdin], [], [], max(0.0, due))
            if self._wire in ready and not self.hear():
                return
            if sys.stdin in ready:
                line = sys.stdin.readline()
                if not line:
                    return
                self.obey(line)
            if began + sent / rate <= time.monotonic():
                drive = self.drives[1 + sent % DRIVES]
                self.send(0x180 + drive.node_id, drive.frame())
                sent += 1


def accept() -> socket.socket:
    """One client, in raw mode."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        tell(str(listener.getsockname()[1]))
        wire, _ = listener.accept()
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    wire.sendall(b"< hi >")
    for _ in range(2):
        wire.recv(100)
        time.sleep(0.02)  # python-can wants each answer alone
        wire.sendall(b"< ok >")
    time.sleep(0.05)
    return wire


if __name__ == "__main__":
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY + 1))
    with contextlib.suppress(ConnectionError):  # the client has gone
        Bus(accept()).run(float(sys.stdin.readline()))
