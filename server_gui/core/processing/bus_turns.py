"""Instants at which a bus gets into trouble: it fails, is full, or its nodes do, in words."""

from collections.abc import Iterable, Iterator
from typing import Final

from gateway.wire.bus import CLOSED, BusInfo
from server_gui.core.processing.bus_health import ORDER, BusHealthLevel, joined, of_load, rated

OVER_NS: Final = 10_000_000_000  # without it, and it is over: what comes and goes is told once

Trouble = tuple[str, bool]  # a bus, and whether it is its load


class BusTurns:
    """For the looks at one robot's buses, as `Robot.buses` has them."""

    def __init__(self) -> None:
        self._known: dict[Trouble, tuple[BusHealthLevel, int]] = {}  # how bad, and when it was so last

    def take(self, buses: Iterable[BusInfo] | None, now_ns: int) -> list[str]:
        """Return what has begun, or become worse, with another look; None: nobody knows."""
        if buses is None:
            return []
        found = [text for bus in buses for text in self._of(bus, now_ns)]
        self._known = {
            key: (level, min(seen_ns, now_ns))  # a clock that goes back makes nothing last longer
            for key, (level, seen_ns) in self._known.items()
            if now_ns - seen_ns < OVER_NS
        }
        return found

    def _of(self, bus: BusInfo, now_ns: int) -> Iterator[str]:
        told = [] if bus.state == CLOSED and bus.problem is None else rated(bus)  # closed: nobody uses it
        for is_load in (True, False):
            of_kind = [one for one in told if of_load(one) is is_load]
            level = max((level for level, _, _ in of_kind), key=ORDER.index, default=BusHealthLevel.GOOD)
            said = joined(of_kind)
            if said is None or (is_load and level is not BusHealthLevel.ALARM):
                continue  # busy is no trouble yet
            before = self._known.get((bus.name, is_load))
            if before is None or ORDER.index(level) > ORDER.index(before[0]):
                yield f"{bus.name}: {said[0]}"
            self._known[bus.name, is_load] = level, now_ns
