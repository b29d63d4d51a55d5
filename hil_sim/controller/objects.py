"""The objects of the gait controller (gait_controller.eds), and what the numbers in them mean."""

from collections.abc import Sequence
from enum import IntEnum

from hil_sim.node.cob_id import INVALID
from hil_sim.node.dictionary import Dictionary

COMMAND = (0x2000, 0)
STEP_LENGTH = (0x2001, 0)
CYCLE_TIME = (0x2002, 0)
TOE_HEIGHT = (0x2003, 0)
TRUNK_ANGLE = (0x2004, 0)
ACTIVITY = (0x2005, 0)
STATE = (0x2010, 0)
PHASE = (0x2011, 0)
HOLDER = (0x2012, 0)
CONTROLWORDS, MODES, TARGETS = 0x2110, 0x2111, 0x2112
STATUSWORDS, POSITIONS = 0x2120, 0x2121

STOPPED_BY_COMMAND = 255  # in HOLDER


class ControllerState(IntEnum):
    """States in object 2010h."""

    IDLE = 0  # not booted
    STARTING = 1  # waits for the statusword of every drive
    ENABLING = 2  # brings the drives up
    RUNNING = 3
    HELD = 4  # quick stop to all until the start object is written


COMMANDING = (ControllerState.STARTING, ControllerState.ENABLING, ControllerState.RUNNING)

_HEARTBEAT_MS = 250
_RPDO, _TPDO, _OWN_TPDOS = 0x1400, 0x1800, 1


_NOT_VALID = 0x8000_0000  # bit 31 of a PDO's COB-ID


def listen_to(dictionary: Dictionary, nodes: Sequence[int | None]) -> None:
    """Put the drives of these node ids behind its PDOs and heartbeats, in the order of its sub-indices.

    Where there is None, no frame goes to a drive, and none is listened to.
    """
    for number, node in enumerate(nodes):
        if node is None:
            _leave_alone(dictionary, number)
            continue
        for key, value in (
            ((0x1016, number + 1), node << 16 | _HEARTBEAT_MS),
            ((_RPDO + number, 1), 0x180 + node),
            ((_TPDO + _OWN_TPDOS + number, 1), 0x200 + node),
        ):
            dictionary[key].commissioned = dictionary[key].value = value


def _leave_alone(dictionary: Dictionary, number: int) -> None:
    for key in ((_RPDO + number, 1), (_TPDO + _OWN_TPDOS + number, 1)):
        entry = dictionary[key]
        entry.default = entry.commissioned = entry.value = int(entry.number()) | INVALID
    dictionary[0x1016, number + 1].commissioned = dictionary[0x1016, number + 1].value = 0
