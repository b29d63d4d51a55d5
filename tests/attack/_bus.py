"""The stop benchmark's eight drives, here walking and armed, on a bus that an attack may share.

Started as `python -m tests.attack._bus FRAMES_A_SECOND`, it is a socketcand server as `tests.bench._bus` is,
and tells besides: `beat 0 0 NS` for each heartbeat of the gateway, `wrote NODE INDEX NS` for each parameter
that is written. `trip NODE POSITION` is obeyed as there. `hostile NAME` begins one of `tests.attack.on_bus`,
`hostile none` ends it. All frames together are never more than such a bus can carry.
"""

import contextlib
import math
import os
import random
import select
import socket
import sys
import time
from collections.abc import Iterator

from drivers.realtime_priority import PRIORITY
from tests.attack.on_bus import BAD_ANSWERS, HOSTILE, LIAR, Frame, bad_answer
from tests.attack.robot_file import FIRST_PARAMETER, OUR_NODE, SERVED
from tests.bench import _bus
from tests.bench._drives import DRIVES

MOST = 8457.0  # frames of eight bytes a second, on a bus of 1 Mbit/s
SWING, SWING_S = 10_000, 2.0  # counts, and seconds of one step
HEARTBEAT_HZ = 80.0  # all drives together
_ROOM_S = 0.05  # how long the gateway may leave the wire full before a frame is lost


class Drive(_bus.Drive):
    """One drive that walks, can be armed, and may be made to answer nonsense."""

    def __init__(self, node_id: int) -> None:
        super().__init__(node_id)
        self.objects |= SERVED
        self.lies: random.Random | None = None

    def frame(self, position: int | None = None) -> bytes:
        self.position = round(
            SWING * math.sin(math.tau * (time.monotonic() / SWING_S + self.node_id / DRIVES))
        )
        return super().frame(position)

    def _written(self, index: int, subindex: int, data: bytes) -> None:
        super()._written(index, subindex, data)
        if index >= FIRST_PARAMETER and index < 0x6000:
            _bus.tell(f"wrote {self.node_id} {index} {time.monotonic_ns()}")

    def _reply(self, command: int, index: int, subindex: int, request: bytes) -> bytes:
        reply = super()._reply(command, index, subindex, request)
        return reply if self.lies is None else bad_answer(self.lies, reply)


class Pace:
    """So many a second, as on a wire: what could not be sent in time is not made up for."""

    def __init__(self, rate: float) -> None:
        self._period_s = 1 / rate
        self._due = time.monotonic()

    @property
    def wait_s(self) -> float:
        return max(0.0, self._due - time.monotonic())

    def is_due(self) -> bool:
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = max(self._due + self._period_s, now - 0.1)
        return True


class Bus(_bus.Bus):
    """The server's one client, the drives, and the attack."""

    def __init__(self, wire: socket.socket, rate: float) -> None:
        super().__init__(wire)
        self._liar = Drive(LIAR)
        self.drives = {at: self._liar if at == LIAR else Drive(at) for at in range(1, DRIVES + 1)}
        for drive in self.drives.values():
            drive.send = self.send  # type: ignore[method-assign]
        self._rate = rate
        self._foreign: Iterator[Frame] | None = None
        self._foreign_pace = Pace(MOST - rate)
        self._sent = 0

    def send(self, can_id: int, data: bytes) -> None:
        if select.select([], [self._wire], [], _ROOM_S)[1]:
            width = 3 if can_id < 0x800 else 8
            identifier = b"%0*X" % (width, can_id)
            self._wire.sendall(b"< frame %s 1.000000 %s >" % (identifier, data.hex().encode()))

    def hear(self) -> bool:
        data = self._wire.recv(65536)
        stamp_ns = time.monotonic_ns()
        *messages, self._rest = (self._rest + data).split(b">")
        for message in messages:
            words = message.split()
            if words[1:2] == [b"send"]:
                self._take(int(words[2], 16), bytes(int(byte, 16) for byte in words[4:]), stamp_ns)
        return bool(data)

    def _take(self, can_id: int, data: bytes, stamp_ns: int) -> None:
        if can_id == 0x700 + OUR_NODE:
            _bus.tell(f"beat 0 0 {stamp_ns}")
        elif can_id - 0x600 in self.drives:
            drive = self.drives[can_id - 0x600]
            drive.stamp_ns = stamp_ns
            drive._answer(data)

    def obey(self, line: str) -> None:
        what, *rest = line.split()
        if what == "trip":
            super().obey(line)
            return
        chance = random.Random(1)
        self._foreign = HOSTILE[rest[0]](chance) if rest[0] in HOSTILE else None
        self._foreign_pace = Pace(MOST - self._rate)
        self._liar.lies = chance if rest[0] == BAD_ANSWERS else None

    def run(self, rate: float) -> None:
        telemetry, alive = Pace(rate), Pace(HEARTBEAT_HZ)
        while True:
            paces = [telemetry, alive] if self._foreign is None else [telemetry, alive, self._foreign_pace]
            ready, _, _ = select.select([self._wire, sys.stdin], [], [], min(one.wait_s for one in paces))
            if self._wire in ready and not self.hear():
                return
            if sys.stdin in ready:
                line = sys.stdin.readline()
                if not line:
                    return
                self.obey(line)
            self._speak(telemetry, alive)

    def _speak(self, telemetry: Pace, alive: Pace) -> None:
        """One frame of each who has something to say."""
        if telemetry.is_due():
            self._sent += 1
            drive = self.drives[1 + self._sent % DRIVES]
            self.send(0x180 + drive.node_id, drive.frame())
        if alive.is_due():
            self._sent += 1
            self.drives[1 + self._sent % DRIVES].heartbeat()
        if self._foreign is not None and self._foreign_pace.is_due():
            self.send(*next(self._foreign))


if __name__ == "__main__":
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY + 1))
    with contextlib.suppress(ConnectionError):  # the gateway has gone
        wanted = float(sys.argv[1])
        Bus(_bus.accept(), wanted).run(wanted)
