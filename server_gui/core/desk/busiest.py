"""Which process of the robot's computer takes most of it, as far as its table was looked at of late."""

from dataclasses import dataclass
from typing import Final

from msgspec import UNSET

from gateway.wire.resource import ProcessUse
from server_gui.core.desk.station import Station
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.processing.process_names import labels, short_name

OLD_S: Final = 10.0  # a look before says nothing of now


@dataclass(frozen=True, slots=True)
class Busiest:
    """A process; `percent` is of one core."""

    name: str
    percent: float


def busiest(station: Station) -> Busiest | None:
    """Return the one that takes most, None where nobody has looked."""
    if station.most is None or not station.is_linked:
        return None
    most, at_ns = station.most
    if most.cpu_percent is None or now_ns() - at_ns > OLD_S * 1e9:
        return None
    return Busiest(_label(station, most), most.cpu_percent)


def _label(station: Station, process: ProcessUse) -> str:
    """Return what the table calls it, as far as that has come: a look without the table tells no command."""
    table = None if station.processes is None else station.processes.processes
    known = [] if table is None or table is UNSET else table
    is_there = any((one.pid, one.name) == (process.pid, process.name) for one in known)
    return labels(known)[process.pid] if is_there else short_name(process)
