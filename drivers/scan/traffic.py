"""Passive observation of a bus: its nodes, masters and periods (CiA 301 §7.3.3)."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from drivers.bus.frames import EXTENDED, STANDARD_IDS
from drivers.bus.nmt import HEARTBEAT, NmtState, parse_heartbeat

NMT, SYNC, EMCY, TIME = 0x000, 0x080, 0x080, 0x100
SDO_RESPONSE, SDO_REQUEST = 0x580, 0x600
LSS_ANSWER, LSS_REQUEST = 0x7E4, 0x7E5
TPDOS = (0x180, 0x280, 0x380, 0x480)
RPDOS = (0x200, 0x300, 0x400, 0x500)
_NODES = range(1, 128)


@dataclass(slots=True)
class IdentifierTraffic:
    """The frames of one identifier; stamps in ns of the monotonic clock."""

    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    data: bytes = b""

    @property
    def period_s(self) -> float | None:
        """On average; `None` for less than two frames."""
        return (self.last_ns - self.first_ns) / 1e9 / (self.count - 1) if self.count > 1 else None


@dataclass(slots=True)
class Traffic:
    """Every identifier that came. Written by one thread, read after it has ended."""

    seen: dict[int, IdentifierTraffic] = field(default_factory=dict)
    boots: dict[int, int] = field(default_factory=dict)  # boot-ups by node
    states: dict[int, NmtState] = field(default_factory=dict)

    def take(self, stamp_ns: int, can_id: int, data: bytes) -> None:
        """One frame that came; error frames are not for this."""
        one = self.seen.setdefault(can_id, IdentifierTraffic(first_ns=stamp_ns))
        one.count += 1
        one.last_ns = stamp_ns
        one.data = data
        if HEARTBEAT < can_id < HEARTBEAT + 128 and (state := parse_heartbeat(data)) is not None:
            self.states[can_id - HEARTBEAT] = state
            if state is NmtState.BOOT_UP:
                self.boots[can_id - HEARTBEAT] = self.boots.get(can_id - HEARTBEAT, 0) + 1

    def nodes(self) -> frozenset[int]:
        """Ids whose frames only a node of that id sends, by the predefined connection set."""
        bases = (EMCY, SDO_RESPONSE, HEARTBEAT, *TPDOS)
        return frozenset(node for node in _NODES if any(base + node in self.seen for base in bases))

    def asked(self) -> frozenset[int]:
        """Return nodes that somebody asks by SDO."""
        return frozenset(node for node in _NODES if SDO_REQUEST + node in self.seen)

    def commanded(self) -> frozenset[int]:
        """Return nodes that somebody sends process data to."""
        return frozenset(node for node in _NODES if any(base + node in self.seen for base in RPDOS))

    def sends(self, node: int) -> dict[int, IdentifierTraffic]:
        """Return its TPDOs of the predefined connection set, by identifier."""
        return {base + node: self.seen[base + node] for base in TPDOS if base + node in self.seen}

    def master(self) -> Iterator[str]:
        """Yield why a node is the bus's master, in words; nothing if none is heard to be."""
        if (nmt := self.seen.get(NMT)) is not None:
            yield f"NMT commands ({nmt.count})"
        if (sync := self.seen.get(SYNC)) is not None:
            period_s = sync.period_s
            yield "SYNC once" if period_s is None else f"SYNC every {period_s * 1000:.3g} ms"
        if TIME in self.seen:
            yield "TIME"
        if LSS_REQUEST in self.seen:
            yield "LSS requests"
        for words, nodes in (("SDO requests to", self.asked()), ("RPDOs to", self.commanded())):
            if nodes:
                yield f"{words} {', '.join(map(str, sorted(nodes)))}"

    def others(self) -> tuple[int, ...]:
        """Return identifiers outside of the predefined connection set, including extended ones."""
        known = {NMT, SYNC, TIME, LSS_ANSWER, LSS_REQUEST}
        return tuple(
            sorted(can_id for can_id in self.seen if can_id not in known and not _is_of_a_node(can_id))
        )


def _is_of_a_node(can_id: int) -> bool:
    if can_id & EXTENDED or can_id > STANDARD_IDS:
        return False
    base, node = can_id & 0x780, can_id & 0x7F
    return node in _NODES and base in {EMCY, SDO_RESPONSE, SDO_REQUEST, HEARTBEAT, *TPDOS, *RPDOS}
