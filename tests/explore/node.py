"""A CANopen device from CiA 301: SDO server, heartbeat, boot-up, TPDOs; and all that can be wrong with it."""

import struct
from collections.abc import Callable
from dataclasses import astuple, dataclass, field

from tests.explore.can import GATEWAY, Wire

Address = tuple[int, int]

SDO_REQUEST, SDO_RESPONSE, HEARTBEAT, RPDO1, TPDO1 = 0x600, 0x580, 0x700, 0x200, 0x180
BOOT_UP, OPERATIONAL, STOPPED = 0x00, 0x05, 0x04
ABORT_NO_OBJECT, ABORT_READ_ONLY, ABORT_LENGTH = 0x06020000, 0x06010002, 0x06070010
ABORT_COMMAND, ABORT_REFUSED = 0x05040001, 0x08000022
_OWN_OBJECTS = (*range(0x2000, 0x3000), *range(0x6072, 0xA000, 0x800))
ANSWER_S, SLOW_S, LATE_S, DOUBLED_AFTER_S = 0.0004, 0.01, 1.2, 0.0006
HEARTBEAT_S = 0.5
BOOT_S = 0.3  # from losing its power to its boot-up
_SIZES = {0x02: 1, 0x03: 2, 0x04: 4, 0x05: 1, 0x06: 2, 0x07: 4}


@dataclass(frozen=True, slots=True)
class Entry:
    """One object: its type (CiA 301 §7.4.7), access and value after power-on."""

    data_type: int
    access: str
    value: int = 0

    @property
    def size(self) -> int:
        return _SIZES[self.data_type]

    @property
    def data(self) -> bytes:
        return self.value.to_bytes(self.size, "little", signed=self.value < 0)


@dataclass(slots=True)
class Faults:
    """What is wrong with a device now."""

    dead: bool = False  # as if it were switched off
    no_sdo: bool = False
    no_tpdo: bool = False
    late_s: float = 0.0  # its answers come so much later
    doubled: bool = False
    lose: int = 0  # answers that get lost
    refuse: int = 0  # writes of its own objects that it refuses


class Device:
    """One node on a wire. `told` hears what is answered to a read, and of when that is."""

    def __init__(self, wire: Wire, name: str, node_id: int, entries: dict[Address, Entry]) -> None:
        self.wire, self.name, self.node_id, self.entries = wire, name, node_id, entries
        self.faults = Faults()
        self.told: Callable[[Device, Address, int, bytes], object] = lambda *_read: None
        self.values: dict[Address, bytes] = {}
        self.writers: dict[Address, tuple[str, int]] = {}  # who wrote each object last, and when
        self.nmt = OPERATIONAL
        self.boots = 0
        self._answer_ns = 0
        self._answers = 0  # that are still to come
        self._forget()
        wire.listeners.append(self)
        wire.runtime.call_in(0.01 * node_id, self._beat)

    # What it is

    def get(self, index: int, subindex: int = 0) -> int:
        data = self.read(index, subindex)
        signed = self.entries[index, subindex].data_type <= 0x04
        return int.from_bytes(data or b"", "little", signed=signed)

    def read(self, index: int, subindex: int) -> bytes | None:
        """As the device itself has it; drives know more."""
        return self.values.get((index, subindex))

    def write(self, who: str, index: int, subindex: int, data: bytes) -> None:
        """Anybody's write, by SDO or otherwise."""
        self.values[index, subindex] = data
        self.writers[index, subindex] = who, self.wire.runtime.now_ns

    @property
    def state(self) -> tuple[object, ...]:
        """What tells one situation from another."""
        faults = self.faults
        return (self.nmt, astuple(faults), self._answers, tuple(self.values.values()))

    @property
    def answers(self) -> bool:
        """Whether who asks it gets one answer in time."""
        faults = self.faults
        deaf = faults.dead or faults.no_sdo or self.nmt == STOPPED or self.wire.blocked or self.wire.gone
        odd = faults.late_s > SLOW_S or faults.lose or faults.doubled or self.distrusted
        return not deaf and not odd

    # What happens to it

    def boot(self) -> None:
        """It loses its power and comes up again: what it was told is forgotten."""
        self.faults.dead = True
        self._forget()
        self.wire.runtime.call_in(BOOT_S, self.come_up)

    def come_up(self) -> None:
        self.faults.dead = False
        self.nmt = OPERATIONAL
        self.boots += 1
        self._send(HEARTBEAT + self.node_id, bytes([BOOT_UP]))

    def on_power(self) -> None:
        """For what else it forgets."""

    def on_rpdo(self, data: bytes) -> None:
        """For what takes an RPDO."""

    def on_nmt(self, stopped: bool) -> None:
        self.nmt = STOPPED if stopped else OPERATIONAL

    # Frames

    def on_frame(self, can_id: int, data: bytes) -> None:
        if self.faults.dead:
            return
        if can_id == SDO_REQUEST + self.node_id and not self.faults.no_sdo and self.nmt != STOPPED:
            answer = self._serve(data)
            if answer is not None:
                self._answer(answer, self.wire.runtime.now_ns)
        elif can_id == RPDO1 + self.node_id and self.nmt == OPERATIONAL:
            self.on_rpdo(data)
        elif can_id == 0 and data[1] in (0, self.node_id) and data[0] in (1, 2):
            self.on_nmt(stopped=data[0] == 2)

    def send_tpdo(self, data: bytes) -> None:
        if not self.faults.no_tpdo and self.nmt == OPERATIONAL:
            self._send(TPDO1 + self.node_id, data)

    def _send(self, can_id: int, data: bytes) -> None:
        if not self.faults.dead:
            self.wire.send(self.name, can_id, data)

    def _beat(self) -> None:
        self._send(HEARTBEAT + self.node_id, bytes([self.nmt]))
        self.wire.runtime.call_in(HEARTBEAT_S, self._beat)

    def _forget(self) -> None:
        self.values = {address: entry.data for address, entry in self.entries.items()}
        self.writers = dict.fromkeys(self.entries, ("power", self.wire.runtime.now_ns))
        self.distrusted = False
        self.on_power()

    def _answer(self, data: bytes, asked_ns: int) -> None:
        """In order, each as late as the device is now."""
        runtime, faults = self.wire.runtime, self.faults
        if faults.lose:
            faults.lose -= 1
            return
        due_ns = max(self._answer_ns, runtime.now_ns + round((ANSWER_S + faults.late_s) * 1e9))
        self._answer_ns = due_ns

        self._answers += 1

        def send() -> None:
            self._answers = max(0, self._answers - 1)
            self._send(SDO_RESPONSE + self.node_id, data)
            command, index, subindex = struct.unpack_from("<BHB", data)
            if command & 0xE0 == 0x40 and self.wire.transport is not None:
                self.told(self, (index, subindex), asked_ns, data[4 : 8 - (command >> 2 & 3)])

        runtime.call_at(due_ns, send)
        if faults.doubled:
            self.distrusted = True  # whoever has seen it may wait until it boots
            runtime.call_at(due_ns + round(DOUBLED_AFTER_S * 1e9), send)

    def _serve(self, request: bytes) -> bytes | None:
        """An SDO server that knows expedited transfers (CiA 301 §7.2.4.3)."""
        command, index, subindex = struct.unpack_from("<BHB", request)
        entry, specifier = self.entries.get((index, subindex)), command >> 5
        if specifier == 4:  # an abort is not answered
            return None
        abort = _why_not(entry, specifier, command)
        if abort is not None or entry is None:
            return struct.pack("<BHBI", 0x80, index, subindex, abort or ABORT_NO_OBJECT)
        if specifier == 2:
            data = self.read(index, subindex) or b""
            return struct.pack("<BHB", 0x43 | (4 - len(data)) << 2, index, subindex) + data.ljust(4, b"\0")
        if self.faults.refuse and index in _OWN_OBJECTS:
            self.faults.refuse -= 1
            return struct.pack("<BHBI", 0x80, index, subindex, ABORT_REFUSED)
        self.write(GATEWAY, index, subindex, request[4 : 4 + entry.size])
        return struct.pack("<BHB", 0x60, index, subindex) + bytes(4)


def _why_not(entry: Entry | None, specifier: int, command: int) -> int | None:
    if entry is None:
        return ABORT_NO_OBJECT
    if specifier == 2:
        return None
    if specifier != 1 or not command & 0x02:
        return ABORT_COMMAND
    if entry.access not in ("rw", "rww", "rwr"):
        return ABORT_READ_ONLY
    return None if 4 - (command >> 2 & 3) == entry.size else ABORT_LENGTH


@dataclass(slots=True)
class EdsText:
    """What a vendor would ship with a device of these entries."""

    product: str
    entries: dict[Address, Entry]
    lines: list[str] = field(default_factory=list)

    def text(self) -> str:
        indices = sorted({index for index, _ in self.entries})
        self.lines = [f"[DeviceInfo]\nVendorName=GWRMS\nProductName={self.product}\nVendorNumber=0\n"]
        self.lines.append("[OptionalObjects]\nSupportedObjects=" + str(len(indices)))
        self.lines += [f"{number}=0x{index:04X}" for number, index in enumerate(indices, 1)]
        for index in indices:
            self._object(index)
        return "\n".join(self.lines) + "\n"

    def _object(self, index: int) -> None:
        subs = [subindex for at, subindex in self.entries if at == index]
        if subs == [0]:
            self._variable(f"{index:04X}", self.entries[index, 0])
            return
        self.lines.append(f"[{index:04X}]\nParameterName=O{index:04X}\nObjectType=0x9\nSubNumber={len(subs)}")
        for subindex in subs:
            self._variable(f"{index:04X}sub{subindex:X}", self.entries[index, subindex])

    def _variable(self, section: str, entry: Entry) -> None:
        self.lines.append(
            f"[{section}]\nParameterName=O{section}\nObjectType=0x7\nDataType=0x{entry.data_type:04X}\n"
            f"AccessType={entry.access}\nDefaultValue={entry.value}\nPDOMapping=1"
        )
