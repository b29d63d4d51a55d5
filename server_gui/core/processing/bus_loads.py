"""Load of each bus over the last minutes, as the looks at them have told it."""

from collections.abc import Iterable

import numpy as np

from gateway.wire.bus import BusInfo
from server_gui.core.processing.history import Floats, History

LOAD = ("load_percent",)


class BusLoads:
    """By the name of a bus; a look that did not tell its load is a gap.

    A bus that is gone is forgotten with its last load.
    """

    def __init__(self) -> None:
        self._known: dict[str, History] = {}

    def take(self, buses: Iterable[BusInfo] | None, at_ns: int) -> None:
        """Take a look at all buses; None: nobody knows."""
        found = {bus.name: bus.load_percent for bus in buses or ()}
        for name in found.keys() - self._known.keys():
            self._known[name] = History(LOAD)
        for name, history in self._known.items():
            history.append(at_ns / 1e9, (found.get(name),))
        if buses is not None:
            self._known = {
                name: history
                for name, history in self._known.items()
                if name in found or np.isfinite(history.recent()[:, 1]).any()
            }

    def recent(self, name: str) -> Floats:
        """Return (rows, 2): time in s and load in percent, NaN where it is not known."""
        return self._known[name].recent() if name in self._known else History(LOAD).recent()
