"""A simulated robot: what may be advised of it alone, and what may not, as its bus has no wires."""

import dataclasses
import re
from collections.abc import Iterable, Iterator
from typing import Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.overload import BLAMED, PARTS, is_unplugged
from server_gui.core.follow.robot import Robot

VENDOR: Final = "GWRMS"  # of the simulator's devices, by their EDS files
WIRES: Final = "termination"
CABLES: Final = re.compile(r"\b(?:cable|plug|power|radio)\b")
FAULTS: Final = "see which faults are simulated (gwrms sim-fault)"
NO_WIRES: Final = f"{BLAMED}{FAULTS}"


def is_simulated(robot: Robot) -> bool:
    """Return whether a device of the simulator is among its own, as far as is known."""
    known = () if robot.description is None else robot.description.components
    return any(isinstance(one.device, dict) and one.device.get("vendor") == VENDOR for one in known)


def advised(check: str, *, simulated: bool) -> str:
    """Return what to check, of a simulated robot without its wires."""
    if not simulated or WIRES not in check:
        return check
    return "; ".join(dict.fromkeys(NO_WIRES if WIRES in one else one for one in check.split("; ")))


def without_wires(alarms: Iterable[Alarm], robot: Robot) -> Iterator[Alarm]:
    """Yield the alarms; of a simulated robot none sends anybody to termination, wiring and cables."""
    simulated = is_simulated(robot)
    for one in alarms:
        if simulated and one.kind in PARTS and CABLES.search(one.check) and not is_unplugged(one):
            yield dataclasses.replace(one, check=NO_WIRES)
            continue
        yield dataclasses.replace(one, check=advised(one.check, simulated=simulated))
