"""One frame after the other in words: which service it belongs to, whose it is, what it says."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar

from drivers.bus.frames import ERROR, EXTENDED, REMOTE, STANDARD_IDS
from drivers.trace import services
from drivers.trace.devices import Devices, Mapped, Pdo
from drivers.trace.files import Captured
from drivers.trace.sdo import Conversation, SdoText
from drivers.trace.values import Value, label, value_of


class FrameKind(StrEnum):
    """Services of CiA 301 and CiA 305; OTHER is what belongs to none."""

    NMT = "nmt"
    SYNC = "sync"
    TIME = "time"
    EMCY = "emcy"
    PDO = "pdo"
    SDO = "sdo"
    HEARTBEAT = "heartbeat"
    LSS = "lss"
    ERROR = "error"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """One frame, decoded. `node_id` is `None` where it belongs to no node."""

    captured: Captured
    kind: FrameKind
    title: str  # the service more exactly: TPDO1, SDO answer
    node_id: int | None
    name: str | None
    words: str
    values: tuple[Value, ...] = ()
    about: tuple[int, int] | None = None  # the object of an SDO, also before its value has come


_FIXED: dict[int, FrameKind] = {
    0x000: FrameKind.NMT,
    0x080: FrameKind.SYNC,
    0x100: FrameKind.TIME,
    0x7E4: FrameKind.LSS,
    0x7E5: FrameKind.LSS,
}
_EMCY, _HEARTBEAT = 0x080, 0x700
_SDO_ANSWER, _SDO_REQUEST = 0x580, 0x600
_TPDOS = {0x180: "TPDO1", 0x280: "TPDO2", 0x380: "TPDO3", 0x480: "TPDO4"}
_RPDOS = {0x200: "RPDO1", 0x300: "RPDO2", 0x400: "RPDO3", 0x500: "RPDO4"}


class Decoder:
    """Takes every frame of one bus, in their order; it remembers SDO conversations and PDO mappings."""

    def __init__(self, devices: Devices | None = None) -> None:
        self.devices = devices or Devices()
        self._conversations: dict[int, Conversation] = {}

    def take(self, captured: Captured) -> DecodedFrame:
        """Decode one frame."""
        can_id = captured.can_id & ~REMOTE
        if can_id & ERROR:
            return _plain(captured, FrameKind.ERROR, services.error(can_id, captured.data))
        if can_id & EXTENDED or can_id > STANDARD_IDS:
            return self._pdo_or_other(captured, can_id)
        fixed = _FIXED.get(can_id)
        if fixed is not None:
            return self._fixed(captured, can_id, fixed)
        base, node_id = can_id & 0x780, can_id & 0x7F
        if node_id and (decode := self._OF_NODE.get(base)) is not None:
            return decode(self, captured, node_id)
        return self._pdo_or_other(captured, can_id)

    def _fixed(self, captured: Captured, can_id: int, kind: FrameKind) -> DecodedFrame:
        data = captured.data
        words = {
            FrameKind.NMT: lambda: services.nmt(data, self.devices.name),
            FrameKind.SYNC: lambda: services.sync(data),
            FrameKind.TIME: lambda: services.time_of_day(data),
            FrameKind.LSS: lambda: services.lss(data, answer=can_id == 0x7E4),
        }[kind]()
        return _plain(captured, kind, words)

    def _line(
        self, captured: Captured, kind: FrameKind, title: str, node_id: int, words: str
    ) -> DecodedFrame:
        return DecodedFrame(captured, kind, title, node_id, self.devices.name(node_id), words)

    # -- of one node -----------------------------------------------------------------------------------------

    def _emcy(self, captured: Captured, node_id: int) -> DecodedFrame:
        words = services.emergency(captured.data, self.devices[node_id].vendor_id)
        return self._line(captured, FrameKind.EMCY, "EMCY", node_id, words)

    def _heartbeat(self, captured: Captured, node_id: int) -> DecodedFrame:
        asked = captured.can_id & REMOTE
        words = "is asked for its state (node guarding)" if asked else services.heartbeat(captured.data)
        return self._line(captured, FrameKind.HEARTBEAT, "heartbeat", node_id, words)

    def _sdo_request(self, captured: Captured, node_id: int) -> DecodedFrame:
        return self._sdo(captured, node_id, "SDO", self._conversation(node_id).request(captured.data))

    def _sdo_answer(self, captured: Captured, node_id: int) -> DecodedFrame:
        return self._sdo(captured, node_id, "SDO answer", self._conversation(node_id).response(captured.data))

    def _conversation(self, node_id: int) -> Conversation:
        return self._conversations.setdefault(node_id, Conversation())

    def _sdo(self, captured: Captured, node_id: int, title: str, said: SdoText) -> DecodedFrame:
        device = self.devices[node_id]
        if said.object is None:
            return self._line(captured, FrameKind.SDO, title, node_id, said.words.replace("{}", "an object"))
        words = said.words.format(label(device.description, *said.object))
        values: tuple[Value, ...] = ()
        if said.value is not None:
            values = (value_of(device.description, *said.object, said.value),)
            words += f": {values[0].words}"
            if said.done:
                self.devices.learn(node_id, *said.object, said.value)
        return DecodedFrame(captured, FrameKind.SDO, title, node_id, device.name, words, values, said.object)

    # -- PDOs ------------------------------------------------------------------------------------------------

    def _pdo_of_node(self, captured: Captured, node_id: int) -> DecodedFrame:
        can_id = captured.can_id & ~REMOTE
        commanded = can_id & 0x780 in _RPDOS
        pdo, receivers = self.devices.pdo(can_id, commanded=commanded)
        if pdo is not None:
            return self._pdo(captured, pdo, receivers)
        title = (_RPDOS if commanded else _TPDOS)[can_id & 0x780]
        return self._line(captured, FrameKind.PDO, title, node_id, _raw(captured))

    def _pdo_or_other(self, captured: Captured, can_id: int) -> DecodedFrame:
        pdo, receivers = self.devices.pdo(can_id, commanded=False)
        if pdo is not None:
            return self._pdo(captured, pdo, receivers)
        return DecodedFrame(captured, FrameKind.OTHER, "other", None, None, _raw(captured))

    def _pdo(self, captured: Captured, pdo: Pdo, receivers: tuple[int, ...]) -> DecodedFrame:
        device = self.devices[pdo.node_id]
        others = [self.devices.name(node) for node in receivers if node != pdo.node_id]
        heard_by = f"   to {', '.join(others)}" if others else ""
        if captured.can_id & REMOTE:
            return self._line(captured, FrameKind.PDO, pdo.name, pdo.node_id, "is asked for")
        data = captured.data
        raw = int.from_bytes(data, "little")
        values = tuple(
            value_of(device.description, one.index, one.subindex, _part(raw, one))
            for one in pdo.objects
            if one.at + one.bits <= 8 * len(data)
        )
        missing = "" if len(values) == len(pdo.objects) else f", {len(data)} bytes, shorter than its mapping"
        words = (", ".join(map(str, values)) or _raw(captured)) + missing + heard_by
        return DecodedFrame(captured, FrameKind.PDO, pdo.name, pdo.node_id, device.name, words, values)

    _OF_NODE: ClassVar[dict[int, Callable[[Any, Captured, int], DecodedFrame]]] = {
        _EMCY: _emcy,
        _SDO_ANSWER: _sdo_answer,
        _SDO_REQUEST: _sdo_request,
        _HEARTBEAT: _heartbeat,
        **dict.fromkeys((*_TPDOS, *_RPDOS), _pdo_of_node),
    }


def _plain(captured: Captured, kind: FrameKind, words: str) -> DecodedFrame:
    title = (
        kind.value.upper()
        if kind in (FrameKind.NMT, FrameKind.SYNC, FrameKind.TIME, FrameKind.LSS)
        else kind.value
    )
    return DecodedFrame(captured, kind, title, None, None, words)


def _part(raw: int, mapped: Mapped) -> bytes:
    """Return the bytes of one object of a PDO."""
    return (raw >> mapped.at & (1 << mapped.bits) - 1).to_bytes((mapped.bits + 7) // 8, "little")


def _raw(captured: Captured) -> str:
    if captured.can_id & REMOTE:
        return "is asked for"
    return captured.data.hex(" ").upper() or "empty"
