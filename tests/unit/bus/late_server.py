"""An SDO server whose answers are late or lost, but come in order, as CiA 301 §7.2.4 has them; no threads."""

import struct
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import repeat

from drivers.bus.sdo.channel import SdoChannel
from tests.unit.bus.direct import Direct

CLOCK, VALUE, LONG, ABSENT = 0x2000, 0x2001, 0x2002, 0x2003


@dataclass(frozen=True)
class Fate:
    """What becomes of one request."""

    taken: bool = True  # the device gets it
    answered: bool = True  # and its answer is not lost
    lag: int = 0  # requests that are sent before the answer comes
    copies: int = 1


AT_ONCE = Fate()


class LateServer:
    """A channel to a device that knows how many requests it was sent: `CLOCK` and `LONG` hold that number."""

    def __init__(self, fates: Iterator[Fate] | None = None, timeout_s: float = 0.001) -> None:
        self.fates = fates or repeat(AT_ONCE)
        self.sent = 0  # requests to it, whether it got them or not
        self.requests: list[bytes] = []  # those that it got
        self.value = bytes(4)  # of VALUE
        self.taken_at = 0  # when it was written
        self.on_request: Callable[[bytes], None] = lambda request: None
        self.channel = SdoChannel("node 1", Direct(self.hear), timeout_s)
        self._answers: deque[tuple[int, bytes]] = deque()
        self._left = b""  # of a segmented upload

    def hear(self, request: bytes) -> None:
        if request[0] == 0x80:
            self._left = b""
            return
        self.sent += 1
        fate = next(self.fates, AT_ONCE)
        if fate.taken:
            self.requests.append(request)
            self.on_request(request)
            answer = self._answer(request)
            if fate.answered:
                self._answers.extend([(self.sent + fate.lag, answer)] * fate.copies)
        self.deliver()

    def deliver(self) -> None:
        """Let through what is not to wait any longer."""
        while self._answers and self._answers[0][0] <= self.sent:
            self.channel.on_response(0, self._answers.popleft()[1])

    def asked(self) -> list[int]:
        """The objects of the requests that it got."""
        return [int.from_bytes(request[1:3], "little") for request in self.requests]

    def _answer(self, request: bytes) -> bytes:
        specifier, about = request[0] & 0xE0, request[1:4]
        if specifier == 0x60:
            return self._segment(request[0] & 0x10)
        if specifier == 0x00:
            return bytes([0x20 | request[0] & 0x10]) + bytes(7)  # what is written in segments is not kept
        self._left = b""
        if specifier == 0x20:
            self.value, self.taken_at = request[4:8], self.sent
            return b"\x60" + about + bytes(4)
        return self._upload(int.from_bytes(about[:2], "little"), about)

    def _upload(self, index: int, about: bytes) -> bytes:
        if index == ABSENT:
            return b"\x80" + about + (0x0602_0000).to_bytes(4, "little")
        if index == LONG:
            self._left = struct.pack("<III", self.sent, self.sent, self.sent)
            return b"\x41" + about + len(self._left).to_bytes(4, "little")
        return b"\x43" + about + (self.value if index == VALUE else self.sent.to_bytes(4, "little"))

    def _segment(self, toggle: int) -> bytes:
        if not self._left:
            return b"\x80" + bytes(3) + (0x0504_0001).to_bytes(4, "little")
        data, self._left = self._left[:7], self._left[7:]
        return bytes([toggle | (7 - len(data)) << 1 | (not self._left)]) + data.ljust(7, b"\0")
