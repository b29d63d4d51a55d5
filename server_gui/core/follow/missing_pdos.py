"""Missing PDOs with hysteresis: a node whose share comes and goes around one percent is one that lasts.

Many are told at once; few only when they stay, and both until there are none for a while.
"""

from collections.abc import Sequence
from typing import Final

from msgspec.structs import asdict, replace

from gateway.wire.bus import BusInfo, NodeInfo

SOME_PERCENT: Final = 1.0  # of a node's PDOs: fewer are none
MANY_PERCENT: Final = 2.5  # told at once
BEGINS_NS: Final = 10_000_000_000  # a few last so long, before they are told
ENDS_NS: Final = 10_000_000_000  # without any, and it is over
LOST_NS: Final = 5_000_000_000  # without a look: nothing lasts over that
CHECK: Final = "see what keeps the robot's computer busy (gwrms blame), or take load from it"
BUSY_PERCENT: Final = 90.0  # of the computer's cores


class WatchedNode(NodeInfo, frozen=True):
    """A node of which more is known than of one look: how many are told to be missing, 0 for none."""

    told_percent: float = 0.0
    is_computer_busy: bool = False


def told_percent(node: NodeInfo) -> float:
    """Return the share of a node's PDOs that is told to be missing, 0 for none."""
    if isinstance(node, WatchedNode):
        return node.told_percent
    percent = node.pdos_missing_percent or 0.0
    return percent if percent >= SOME_PERCENT else 0.0


def told_words(node: NodeInfo) -> tuple[str, str]:
    """Return what is told of it, and what to check where that is known."""
    words = f"{told_percent(node):.0f} % of its PDOs are missing"
    if isinstance(node, WatchedNode) and node.is_computer_busy:
        return f"{words}; the robot's computer is busy", CHECK
    return words, ""


class MissingPdos:
    """Missing PDOs of one robot's nodes, measurement by measurement."""

    def __init__(self) -> None:
        self._some: dict[tuple[str, int], list[tuple[int, float]]] = {}  # when, and how many
        self._told: set[tuple[str, int]] = set()
        self._looked_ns: int | None = None

    def take(
        self, buses: Sequence[BusInfo], now_ns: int, cpu_percent: float | None = None
    ) -> tuple[BusInfo, ...]:
        """Return the buses of a look with nodes that have their history, where that says otherwise."""
        if self._looked_ns is not None and now_ns - self._looked_ns > LOST_NS:
            self._some.clear()
            self._told.clear()
        self._looked_ns = now_ns
        return tuple(self._bus(bus, now_ns, (cpu_percent or 0.0) >= BUSY_PERCENT) for bus in buses)

    def _bus(self, bus: BusInfo, now_ns: int, is_busy: bool) -> BusInfo:
        told = [self._percent(bus.name, node, now_ns) for node in bus.nodes]
        is_busy = is_busy and len(told) > 1 and all(told)  # one alone has a cable of its own
        nodes = [
            node
            if (percent, is_busy) == (told_percent(node), False)
            else WatchedNode(**asdict(node), told_percent=percent, is_computer_busy=is_busy)
            for node, percent in zip(bus.nodes, told, strict=True)
        ]
        return replace(bus, nodes=nodes)

    def _percent(self, bus: str, node: NodeInfo, now_ns: int) -> float:
        key, percent = (bus, node.node_id), told_percent(node)
        known = [one for one in self._some.get(key, []) if now_ns - one[0] <= ENDS_NS + BEGINS_NS]
        if percent:
            known.append((now_ns, percent))
        lately = [share for at_ns, share in known if now_ns - at_ns < ENDS_NS]
        self._some[key] = known if lately else []
        if not lately:
            self._told.discard(key)
        elif percent >= MANY_PERCENT or now_ns - known[0][0] >= BEGINS_NS:
            self._told.add(key)
        return max(lately, default=0.0) if key in self._told else 0.0
