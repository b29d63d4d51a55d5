"""A simulated bus with a listener on it and one device as node 5, driven in simulated time."""

from dataclasses import dataclass
from pathlib import Path

import eds
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.drive.drive import JointDrive
from hil_sim.drive.mechanics import Joint, JointConstants
from hil_sim.node.node import Node

NODE = 5


@dataclass(frozen=True)
class Heard:
    """A frame and when it was over (ms)."""

    at_ms: float
    frame: Frame

    @property
    def cob_id(self) -> int:
        return self.frame.cob_id

    @property
    def data(self) -> bytes:
        return self.frame.data


class DeviceBench:
    """Clock, bus, and a device without a profile from any EDS or DCF; `heard` is all that others send."""

    def __init__(self, file: Path) -> None:
        self.clock = Clock()
        self.bus = CanBus(self.clock)
        self.heard: list[Heard] = []
        self.bus.attach(self, self._hear)
        self.node = self._device(eds.load(file, NODE))

    def _device(self, description: eds.Description) -> Node:
        return Node(self.clock, self.bus, "device", NODE, description)

    def _hear(self, frame: Frame, _sender: object) -> None:
        self.heard.append(Heard(self.clock.now_ns / MILLISECOND_NS, frame))

    def boot(self) -> None:
        self.node.power_on()
        self.run(100)

    def start(self) -> None:
        self.boot()
        self.send(0x000, "01 00")

    def run(self, milliseconds: float) -> None:
        self.clock.run_until(self.clock.now_ns + round(milliseconds * MILLISECOND_NS))

    def send(self, cob_id: int, data: str = "") -> None:
        """Put a frame on the bus and give it time to arrive and be answered."""
        self.bus.send(Frame(cob_id, bytes.fromhex(data)), self)
        self.run(2)

    def ask(self, cob_id: int) -> list[bytes]:
        """Send a remote frame; the frames that answer it."""
        before = len(self.heard)
        self.bus.send(Frame(cob_id, remote=True), self)
        self.run(2)
        return self.of(cob_id, before)

    def of(self, cob_id: int, first: int = 0) -> list[bytes]:
        """The data of all frames heard with this identifier, but for those before the `first` of all."""
        return [heard.data for heard in self.heard[first:] if heard.cob_id == cob_id]

    def sdo(self, request: str) -> str | None:
        """Ask the SDO server; hexadecimal as in a manual, `None` for silence."""
        before = len(self.heard)
        self.send(0x600 + NODE, request)
        answers = self.of(0x580 + NODE, before)
        return answers[0].hex(" ").upper() if answers else None

    def read(self, index: int, subindex: int = 0, signed: bool = False) -> int:
        answer = bytes.fromhex(self.sdo(f"40 {_multiplexer(index, subindex)} 00 00 00 00") or "")
        assert answer[0] & 0xE3 == 0x43, answer.hex(" ")
        size = 4 - (answer[0] >> 2 & 3)
        return int.from_bytes(answer[4 : 4 + size], "little", signed=signed)

    def write(self, index: int, subindex: int, value: int, size: int) -> str:
        """Expedited download; `ok`, or the abort code in hexadecimal."""
        data = (value & (1 << 8 * size) - 1).to_bytes(4, "little").hex(" ")
        answer = self.sdo(f"{0x23 | (4 - size) << 2:02X} {_multiplexer(index, subindex)} {data}")
        assert answer is not None
        raw = bytes.fromhex(answer)
        return "ok" if raw[0] == 0x60 else f"{int.from_bytes(raw[4:], 'little'):08X}"


class Bench(DeviceBench):
    """The same with a joint drive."""

    def __init__(self, position: float = 0.0, file: Path | None = None) -> None:
        self.joint = Joint(JointConstants(), position)
        super().__init__(file or eds.locate("joint_drive.eds", None))

    def _device(self, description: eds.Description) -> Node:
        self.drive = JointDrive(self.clock, self.bus, "joint", NODE, description, self.joint)
        return self.drive

    def controlword(self, value: int) -> int:
        """Write the controlword by SDO; gives the statusword after it."""
        assert self.write(0x6040, 0, value, 2) == "ok"
        return self.read(0x6041)

    def enable(self) -> None:
        for value in (0x06, 0x07, 0x0F):
            self.controlword(value)
        assert self.read(0x6041) & 0x6F == 0x27


def _multiplexer(index: int, subindex: int) -> str:
    return f"{index & 0xFF:02X} {index >> 8:02X} {subindex:02X}"
