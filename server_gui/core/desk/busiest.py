"""Which process of the robot's computer takes most of it, as far as its table was looked at of late."""

import time
from dataclasses import dataclass
from typing import Final

from server_gui.core.desk.station import Station

OLD_S: Final = 10.0  # a look before says nothing of now


@dataclass(frozen=True, slots=True)
class Busiest:
    """A process; `percent` is of one core."""

    name: str
    percent: float


def busiest(station: Station) -> Busiest | None:
    """Return the one that takes most, None where nobody has looked."""
    table, at_ns = station.processes, station.processes_at_ns
    if table is None or at_ns is None or not isinstance(table.processes, list) or not station.is_linked:
        return None
    if time.monotonic_ns() - at_ns > OLD_S * 1e9:
        return None
    known = [(one.cpu_percent, one.name) for one in table.processes if one.cpu_percent is not None]
    percent, name = max(known, default=(0.0, ""))
    return Busiest(name, percent) if name else None
