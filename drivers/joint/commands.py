"""Every controlword that is ever sent (6040h), and which leads from which state where (CiA 402-2 §8.3).

A stop sends QUICK_STOP, and as its fallback DISABLE_VOLTAGE. A reset goes the WAY_DOWN. From no state can any
of these lead to operation enabled, so that a state that has changed since it was read does no harm. Only the
WAY_UP leads there; START_HOMING is sent where it has led already, on the same word.
"""

from collections.abc import Mapping
from enum import IntEnum

from drivers.joint.cia402 import DriveState

CONTROLWORD, STATUSWORD = 0x6040, 0x6041


class Controlword(IntEnum):
    """Commands of the device control; all their other bits are 0."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    ENABLE_OPERATION = 0x000F
    START_HOMING = 0x001F  # in the mode homing, where bit 4 rises
    FAULT_RESET = 0x0080  # where bit 7 rises

    @property
    def data(self) -> bytes:
        return self.to_bytes(2, "little")

    @property
    def words(self) -> str:
        return self.name.lower().replace("_", " ")


# States in which a drive is braking or not driving, and cannot move on its own.
STOPPED_STATES = frozenset({DriveState.QUICK_STOP_ACTIVE, DriveState.SWITCH_ON_DISABLED, DriveState.FAULT})

# To SWITCH ON DISABLED, one state after the other. A state that is not here is left by the drive itself.
WAY_DOWN: Mapping[DriveState, tuple[Controlword, ...]] = {
    DriveState.OPERATION_ENABLED: (Controlword.QUICK_STOP,),  # 11
    DriveState.QUICK_STOP_ACTIVE: (Controlword.DISABLE_VOLTAGE,),  # 12; only when it stands
    DriveState.SWITCHED_ON: (Controlword.DISABLE_VOLTAGE,),  # 10
    DriveState.READY_TO_SWITCH_ON: (Controlword.DISABLE_VOLTAGE,),  # 7
    DriveState.FAULT: (  # 15; bit 7 must rise, and is low again for the next time
        Controlword.DISABLE_VOLTAGE,
        Controlword.FAULT_RESET,
        Controlword.DISABLE_VOLTAGE,
    ),
}

# To OPERATION ENABLED: from each state the command, and the one state that it must lead to.
WAY_UP: Mapping[DriveState, tuple[Controlword, DriveState]] = {
    DriveState.SWITCH_ON_DISABLED: (Controlword.SHUTDOWN, DriveState.READY_TO_SWITCH_ON),  # 2
    DriveState.READY_TO_SWITCH_ON: (Controlword.SWITCH_ON, DriveState.SWITCHED_ON),  # 3
    DriveState.SWITCHED_ON: (Controlword.ENABLE_OPERATION, DriveState.OPERATION_ENABLED),  # 4
}
