"""A drive behind an SDO channel: the standard's state machine, in the thread that asks."""

from collections.abc import Callable

from drivers.bus.sdo.channel import SdoChannel
from drivers.joint.axis import Axis
from drivers.joint.cia402 import DriveState
from tests.unit.bus.direct import Direct
from tests.unit.joint.standard import after, statusword

NO_OBJECT = 0x0602_0000


class SdoDrive:
    """Answers at once, and follows each controlword as CiA 402-2 says, unless a test wants it otherwise."""

    def __init__(self, state: DriveState, *, stays: bool = True, mode: int = 8) -> None:
        self.state = state
        self.stays = stays  # in quick stop active, as with 605Ah 5 to 8
        self.controlwords: list[int] = []
        self.states: list[DriveState] = [state]
        self.aborts: dict[int, int] = {}  # index → code
        self.deaf_to: set[int] = set()  # controlwords that do nothing
        self.stuck: set[int] = set()  # objects that keep their value, whatever is written
        self.on_request: Callable[[int], None] = lambda index: None
        self.values: dict[tuple[int, int], bytes] = {
            (0x6061, 0): bytes([mode]),
            (0x6064, 0): (1234).to_bytes(4, "little"),
            (0x607A, 0): bytes(4),
            (0x60FF, 0): (77).to_bytes(4, "little"),
            (0x6071, 0): (5).to_bytes(2, "little"),
        }
        self.written: list[tuple[int, int, bytes]] = []
        self.channel = SdoChannel("left_knee", Direct(self._hear), timeout_s=0.02)

    @property
    def axis(self) -> Axis:
        return Axis(self.channel, 0)

    def go(self, state: DriveState) -> None:
        if state is not self.state:
            self.state = state
            self.states.append(state)

    def _hear(self, request: bytes) -> None:
        if request[0] == 0x80:
            return
        index, subindex = int.from_bytes(request[1:3], "little"), request[3]
        self.on_request(index)
        self.channel.on_response(0, self._reply(request, index, subindex))

    def _reply(self, request: bytes, index: int, subindex: int) -> bytes:
        if index in self.aborts:
            return b"\x80" + request[1:4] + self.aborts[index].to_bytes(4, "little")
        if request[0] != 0x40 and (index, subindex) in self.values | {(0x6040, 0): b""}:
            self._write(index, subindex, request[4 : 8 - (request[0] >> 2 & 3)])
            return b"\x60" + request[1:4] + bytes(4)
        self.values[0x6041, 0] = statusword(self.state).to_bytes(2, "little")
        data = self.values.get((index, subindex))
        if data is None:
            return b"\x80" + request[1:4] + NO_OBJECT.to_bytes(4, "little")
        return bytes([0x43 | (4 - len(data)) << 2]) + request[1:4] + data.ljust(4, b"\0")

    def _write(self, index: int, subindex: int, data: bytes) -> None:
        self.written.append((index, subindex, data))
        if index != 0x6040:
            if index not in self.stuck:
                self.values[index, subindex] = data
            return
        word, before = int.from_bytes(data, "little"), self.controlwords[-1] if self.controlwords else 0x80
        self.controlwords.append(word)
        if word not in self.deaf_to:
            self.go(after(self.state, word, before, self.stays))
