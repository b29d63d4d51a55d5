"""The alarms of a CAN bus: its load, which has a beginning of its own, and all else that is wrong with it."""

import re
from collections.abc import Iterator
from typing import Final

from gateway.wire.bus import CLOSED, BusInfo
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.processing.bus_health import BusHealthLevel, joined, of_load, rated

OF_LOAD: Final = Kind.BUS_FULL, Kind.BUS_BUSY
OF_ALL_ELSE: Final = Kind.BUS_FAILS, Kind.BUS

_SAID: Final = re.compile(r"^it is (?:full|busy): ")  # as the alarm's own word says


def bus_alarms(bus: BusInfo, *, is_now: bool = True) -> Iterator[Alarm]:
    """Yield them; a bus that nobody uses is closed, and fine."""
    if bus.state == CLOSED and bus.problem is None:
        return
    told = rated(bus)
    for is_load, (grave, usual) in ((True, OF_LOAD), (False, OF_ALL_ELSE)):
        found = [one for one in told if of_load(one) is is_load]
        said = joined(found)
        if said is not None:
            kind = grave if any(level is BusHealthLevel.ALARM for level, _, _ in found) else usual
            what, check = said
            what = _SAID.sub("", what) if is_load else what
            yield Alarm(kind, f"bus.{bus.name}", what, bus.name, check=check or check_of(kind), is_now=is_now)
