"""Missing PDOs with hysteresis: a node whose share comes and goes around one percent is one that lasts.

Many are told at once; few only when they stay, and both until there are none for a while.
"""

import collections
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from msgspec.structs import asdict, replace

from gateway.wire.bus import BusInfo, NodeInfo

SOME_PERCENT: Final = 1.0  # of a node's PDOs: fewer are none
MANY_PERCENT: Final = 2.5  # told at once
SOME_LOOKS: Final = 4  # that have found a few, before they are told,
ONE_IN: Final = 4  # and at least one in so many,
BEGINS_NS: Final = 10_000_000_000  # and over so long
ENDS_NS: Final = 10_000_000_000  # without any, in so many looks, and it is over
ENDS_LOOKS: Final = 4
LOST_NS: Final = 15_000_000_000  # without a look: nothing lasts over that
KEPT_NS: Final = 20_000_000_000  # of looks that are judged, and at least
KEPT_LOOKS: Final = 16  # so many, however far apart they are
CHECK: Final = "see what keeps the robot's computer busy (gwrms blame), or take load from it"
BUSY_PERCENT: Final = 90.0  # of the computer's cores
MANY: Final = 0.5  # of the nodes


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


def _percent(node: NodeInfo) -> float | None:
    """Return the share of a look, None where it is not known."""
    return None if node.pdos_missing_percent is None else told_percent(node)


def told_words(node: NodeInfo) -> tuple[str, str]:
    """Return what is told of it, and what to check where that is known."""
    words = f"{told_percent(node):.0f} % of its PDOs are missing"
    if isinstance(node, WatchedNode) and node.is_computer_busy:
        return f"{words}; the robot's computer is overloaded", CHECK
    return words, ""


@dataclass(slots=True)
class NodeHistory:
    """What the newest looks have found of one node."""

    looks: collections.deque[tuple[int, float]] = field(default_factory=collections.deque)  # when, and share
    is_told: bool = False

    def take(self, now_ns: int, percent: float | None) -> float:
        """Return the share that is told after another look: the newest that is not zero.

        A look that does not know it is no fine one: what was told stays so, for a while.
        """
        if percent is None:
            if self.looks and now_ns - self.looks[-1][0] > LOST_NS:
                self.looks.clear()
            self.is_told = self.is_told and bool(self.looks)
            return next(share for _, share in reversed(self.looks) if share) if self.is_told else 0.0
        self.looks.append((now_ns, percent))
        while len(self.looks) > KEPT_LOOKS and now_ns - self.looks[0][0] > KEPT_NS:
            self.looks.popleft()
        places = [place for place, (_, share) in enumerate(self.looks) if share]
        if not places or self._is_over(now_ns, places[-1]):
            self.is_told = False
        else:
            self.is_told |= percent >= MANY_PERCENT or self._lasts(now_ns, places)
        return self.looks[places[-1]][1] if self.is_told else 0.0

    def join(self, percent: float | None) -> float:
        """Return the share of a look that is told at once, as another node of the bus is."""
        self.is_told = bool(percent)
        return percent or 0.0

    def _is_over(self, now_ns: int, newest: int) -> bool:
        fine = len(self.looks) - 1 - newest
        return fine >= ENDS_LOOKS and now_ns - self.looks[newest][0] >= ENDS_NS

    def _lasts(self, now_ns: int, places: Sequence[int]) -> bool:
        since = len(self.looks) - places[0]
        is_long = now_ns - self.looks[places[0]][0] >= BEGINS_NS
        return is_long and len(places) >= SOME_LOOKS and len(places) * ONE_IN >= since


class MissingPdos:
    """Missing PDOs of one robot's nodes, measurement by measurement."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[str, int], NodeHistory] = {}
        self._looked_ns: int | None = None
        self._busy_ns: int | None = None  # when the computer was so last

    def take(
        self, buses: Sequence[BusInfo], now_ns: int, cpu_percent: float | None = None
    ) -> tuple[BusInfo, ...]:
        """Return the buses of a look with nodes that have their history, where that says otherwise.

        A node that is missing from a look begins anew with the next one that has it; all do where the clock
        has gone back.
        """
        is_lost = self._looked_ns is not None and not 0 <= now_ns - self._looked_ns <= LOST_NS
        known = {} if is_lost else self._nodes
        keys = [(bus.name, node.node_id) for bus in buses for node in bus.nodes]
        self._nodes = {key: known.get(key) or NodeHistory() for key in keys}
        self._looked_ns = now_ns
        if (cpu_percent or 0.0) >= BUSY_PERCENT:
            self._busy_ns = now_ns
        is_busy = self._busy_ns is not None and 0 <= now_ns - self._busy_ns <= KEPT_NS
        return tuple(self._bus(bus, now_ns, is_busy) for bus in buses)

    def _bus(self, bus: BusInfo, now_ns: int, is_busy: bool) -> BusInfo:
        known = [(self._nodes[bus.name, node.node_id], _percent(node)) for node in bus.nodes]
        told = [history.take(now_ns, percent) for history, percent in known]
        if any(told):  # it is the bus's trouble: nobody is told that others with as many are fine
            told = [one or history.join(share) for one, (history, share) in zip(told, known, strict=True)]
        counted = [one for one, (_, share) in zip(told, known, strict=True) if one or share is not None]
        missing = sum(map(bool, counted))  # at one alone, which has a cable of its own, or at many
        is_busy = is_busy and missing > 1 and missing >= MANY * len(counted)
        nodes = [
            node
            if (percent, is_busy) == (told_percent(node), False)
            else WatchedNode(**asdict(node), told_percent=percent, is_computer_busy=is_busy)
            for node, percent in zip(bus.nodes, told, strict=True)
        ]
        return replace(bus, nodes=nodes)
