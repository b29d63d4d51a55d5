"""Option codes: how a drive comes to rest on quick stop, shutdown, disable operation, halt and fault.

605Ah–605Eh and 6007h of CiA 402-2 §6.4; slowing down on the voltage limit (4 and 8) is not offered.
"""

from enum import Enum

from hil_sim.drive import objects as od
from hil_sim.drive.objects import Objects
from hil_sim.drive.power_state import Command
from hil_sim.node.dictionary import Key


class Ramp(Enum):
    """Ramp to standstill."""

    OFF = "the current goes at once"
    SLOW_DOWN = "profile deceleration"
    QUICK_STOP = "quick stop deceleration"
    CURRENT_LIMIT = "as hard as the current limit allows"


RAMPS = {
    0: Ramp.OFF,
    1: Ramp.SLOW_DOWN,
    2: Ramp.QUICK_STOP,
    3: Ramp.CURRENT_LIMIT,
    5: Ramp.SLOW_DOWN,
    6: Ramp.QUICK_STOP,
    7: Ramp.CURRENT_LIMIT,
}
_STAYING = (5, 6, 7)  # of 605Ah: the drive stays in QUICK STOP ACTIVE

ALLOWED: dict[Key, tuple[int, ...]] = {
    od.ABORT_CONNECTION_OPTION: (0, 1, 2, 3),
    od.QUICK_STOP_OPTION: tuple(RAMPS),
    od.SHUTDOWN_OPTION: (0, 1),
    od.DISABLE_OPERATION_OPTION: (0, 1),
    od.HALT_OPTION: (1, 2, 3),
    od.FAULT_REACTION_OPTION: (0, 1, 2, 3),
}

# 6007h: what the drive does when communication is gone; 0 does nothing.
ABORT_CONNECTION = {1: Command.FAULT_DETECTED, 2: Command.DISABLE_VOLTAGE, 3: Command.QUICK_STOP}

# Commands that take a drive out of operation by way of a ramp (transitions 5 and 8).
WAYS_OUT = {
    Command.SWITCH_ON: od.DISABLE_OPERATION_OPTION,
    Command.SHUTDOWN: od.SHUTDOWN_OPTION,
}


def ramp(objects: Objects, option: Key) -> Ramp:
    """Return the ramp of `option`; a vendor's own code counts as the quick stop ramp."""
    return RAMPS.get(objects.number(option), Ramp.QUICK_STOP)


def stays(objects: Objects) -> bool:
    """Return whether a quick stop ends in QUICK STOP ACTIVE, from where the drive can be enabled again."""
    return objects.number(od.QUICK_STOP_OPTION) in _STAYING
