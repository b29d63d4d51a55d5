"""Who sends on a bus: its nodes, each by what it sends itself, and all other frames by their kind.

What the gateway receives is told by kind and node. A PDO or a request to a node is no frame of that node:
somebody else has sent it. The rest of the frames are the gateway's own, or filtered by its interface.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from gateway.wire.bus import BusInfo, identifier_text

OWN_KINDS: Final = frozenset({"EMCY", "TPDO", "SDO answer", "heartbeat"})  # that a node sends itself
OTHER: Final = "other"  # of no kind that CiA 301 names
NOBODY: Final = "no known node"
REST: Final = "gateway or filtered"  # names the frames that did not come to the gateway
MOST_IDS: Final = 4  # that are named one by one; of a kind and node the gateway names no more
NOISE: Final = 1.0  # frames/s: so much the rounding of each kind may add up to
FEWER: Final = "send fewer PDOs or SYNC less often"


@dataclass(frozen=True, slots=True)
class Talking:
    """One sender on a bus: its share of the bus's frames, and what it sends, the most first.

    `name` is what it is called where `node_id` is None: the kind of the frames, `NOBODY` or `REST`.
    """

    node_id: int | None
    names: tuple[str, ...]
    frames_per_s: float
    share: float  # 0–1
    kinds: tuple[tuple[str, float], ...]
    name: str = ""
    identifiers: tuple[int, ...] = ()  # with the most frames, with SocketCAN's flags
    has_more: bool = False  # perhaps: the gateway names but the first of each kind and node

    @property
    def ids(self) -> str:
        """Name the identifiers, of 29 bits with eight digits; of many the lowest and the highest."""
        known = sorted(self.identifiers)
        if len(known) > MOST_IDS:
            return f"{identifier_text(known[0])} … {identifier_text(known[-1])}"
        return ", ".join(map(identifier_text, known)) + (", …" if self.has_more else "")

    @property
    def who(self) -> str:
        """Name it for people."""
        if self.node_id is None:
            return self.name
        return ", ".join(name.replace("_", " ") for name in self.names) or f"node {self.node_id}"

    @property
    def said(self) -> str:
        """Say how much of a bus's traffic it is, so that nobody takes it for the bus's load."""
        percent = f"{100 * self.share:.0f} % of its frames"
        if self.name == REST:
            return f"{percent} are the gateway's own, or filtered"
        named = self.node_id is None and self.name != NOBODY
        return f"{percent} are {self.name}" if named else f"{percent} are from {self.who}"


def total(bus: BusInfo) -> float | None:
    """Return the bus's frames a second; None where they are not known."""
    came = sum(one.frames_per_s for one in bus.talks)
    told = bus.frames_per_s
    if told is None:
        return came if bus.talks else None
    is_noise = bool(bus.talks) and told - came < NOISE
    return came if is_noise else told


def kinds(bus: BusInfo) -> list[tuple[str, float]]:
    """Return the frames a second of each kind, the most first; all of them together are the total."""
    found: dict[str, float] = {}
    for one in bus.talks:
        found[one.kind] = found.get(one.kind, 0.0) + one.frames_per_s
    if rest := _rest(bus):
        found[REST] = rest
    return sorted(found.items(), key=lambda item: -item[1])


def talking(bus: BusInfo) -> list[Talking]:
    """Return the senders on a bus, the busiest first; all of them together are its total."""
    names = {node.node_id: tuple(node.components) for node in bus.nodes}
    whole = total(bus) or 0.0
    found: dict[tuple[int | None, str], dict[str, float]] = {}
    identifiers: dict[tuple[int | None, str], list[int]] = {}
    cut: set[tuple[int | None, str]] = set()
    for one in bus.talks:
        node_id = one.node_id if one.kind in OWN_KINDS or one.kind == OTHER else None
        name = "" if node_id is not None else NOBODY if one.kind == OTHER else one.kind
        identifiers.setdefault((node_id, name), []).extend(one.identifiers)
        if len(one.identifiers) >= MOST_IDS:
            cut.add((node_id, name))
        sends = found.setdefault((node_id, name), {})
        sends[one.kind] = sends.get(one.kind, 0.0) + one.frames_per_s
    if rest := _rest(bus):
        found[None, REST] = {REST: rest}
    senders = [
        Talking(
            node_id,
            names.get(node_id, ()) if node_id is not None else (),
            rate := sum(sends.values()),
            rate / whole if whole else 0.0,
            tuple(sorted(sends.items(), key=lambda item: -item[1])),
            name,
            tuple(dict.fromkeys(identifiers.get((node_id, name), ()))),
            (node_id, name) in cut,
        )
        for (node_id, name), sends in found.items()
    ]
    return sorted(senders, key=_order)


def fewer(bus: BusInfo) -> str:
    """Return what to do about a bus that carries too much, with its largest sender where that is known."""
    most = next(iter(talking(bus)), None)
    if most is None:
        return f"find what sends so much, and {FEWER}"
    if most.name == NOBODY:
        known = f" ({most.ids})" if most.ids else ""
        return f"{most.said}{known}: find what sends them (gwrms trace) and switch it off; else {FEWER}"
    return f"{most.said}, the most: {FEWER}"


def whole_numbers(rates: Sequence[float], of: float) -> list[int]:
    """Return the rates as whole numbers which add up to `of`, as that is shown."""
    numbers = [int(rate) for rate in rates]
    short = round(of) - sum(numbers)
    by_rest = sorted(range(len(rates)), key=lambda place: numbers[place] - rates[place])
    for place in by_rest[: max(short, 0)]:
        numbers[place] += 1
    return numbers


def _rest(bus: BusInfo) -> float:
    """Return the frames a second that did not come to the gateway; 0 where nothing is known of the others."""
    return max((total(bus) or 0.0) - sum(one.frames_per_s for one in bus.talks), 0.0) if bus.talks else 0.0


def _order(one: Talking) -> tuple[int, bool, int, str]:
    """Order by the share as it is shown: of one and the same the lowest node comes first."""
    return -round(100 * one.share), one.node_id is None, one.node_id or 0, one.name
