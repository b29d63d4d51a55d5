"""The power drive system's states as one table (CiA 402-2 §6.2, figure 5 and tables 4 to 7)."""

from enum import Enum, StrEnum


class PowerState(Enum):
    """States, each with the bits of the statusword that show it (bits 0–3, 5, 6)."""

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08

    __hash__ = object.__hash__  # each is one object, looked up in every cycle


class Command(StrEnum):
    """Commands of the power state machine: those of the controlword, then the drive's own."""

    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"  # the same bits mean "disable operation" in OPERATION ENABLED
    ENABLE_OPERATION = "enable operation"
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"
    FAULT_RESET = "fault reset"

    BOOTED = "booted"
    FAULT_DETECTED = "fault detected"
    STANDSTILL = "standstill reached"


ENABLING = (Command.SHUTDOWN, Command.SWITCH_ON, Command.ENABLE_OPERATION)

_FAULT_RESET_BIT = 0x80

# Mask and value of the controlword's bits 7, 3, 2, 1, 0 (table 4); the first row that fits counts.
_CONTROLWORDS: tuple[tuple[int, int, Command], ...] = (
    (0x82, 0x00, Command.DISABLE_VOLTAGE),
    (0x86, 0x02, Command.QUICK_STOP),
    (0x87, 0x06, Command.SHUTDOWN),
    (0x8F, 0x07, Command.SWITCH_ON),
    (0x8F, 0x0F, Command.ENABLE_OPERATION),
)

# The same by the controlword's first byte.
_COMMANDS = [
    next((command for mask, value, command in _CONTROLWORDS if byte & mask == value), None)
    for byte in range(256)
]

S, C = PowerState, Command

# Transition numbers of figure 5 stand behind each row. What is not here does nothing.
TRANSITIONS: dict[tuple[PowerState, Command], PowerState] = {
    (S.NOT_READY_TO_SWITCH_ON, C.BOOTED): S.SWITCH_ON_DISABLED,  # 1
    (S.SWITCH_ON_DISABLED, C.SHUTDOWN): S.READY_TO_SWITCH_ON,  # 2
    (S.READY_TO_SWITCH_ON, C.SWITCH_ON): S.SWITCHED_ON,  # 3
    (S.READY_TO_SWITCH_ON, C.ENABLE_OPERATION): S.OPERATION_ENABLED,  # 3 and 4 in one
    (S.READY_TO_SWITCH_ON, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,  # 7
    (S.READY_TO_SWITCH_ON, C.QUICK_STOP): S.SWITCH_ON_DISABLED,  # 7
    (S.SWITCHED_ON, C.ENABLE_OPERATION): S.OPERATION_ENABLED,  # 4
    (S.SWITCHED_ON, C.SHUTDOWN): S.READY_TO_SWITCH_ON,  # 6
    (S.SWITCHED_ON, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,  # 10
    (S.SWITCHED_ON, C.QUICK_STOP): S.SWITCH_ON_DISABLED,  # 10
    (S.OPERATION_ENABLED, C.SWITCH_ON): S.SWITCHED_ON,  # 5
    (S.OPERATION_ENABLED, C.SHUTDOWN): S.READY_TO_SWITCH_ON,  # 8
    (S.OPERATION_ENABLED, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,  # 9
    (S.OPERATION_ENABLED, C.QUICK_STOP): S.QUICK_STOP_ACTIVE,  # 11
    (S.QUICK_STOP_ACTIVE, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,  # 12
    (S.QUICK_STOP_ACTIVE, C.STANDSTILL): S.SWITCH_ON_DISABLED,  # 12, where 605Ah does not stay
    (S.QUICK_STOP_ACTIVE, C.ENABLE_OPERATION): S.OPERATION_ENABLED,  # 16, where 605Ah stays
    **{
        (state, C.FAULT_DETECTED): S.FAULT_REACTION_ACTIVE  # 13
        for state in S
        if state not in (S.FAULT, S.FAULT_REACTION_ACTIVE)
    },
    (S.FAULT_REACTION_ACTIVE, C.STANDSTILL): S.FAULT,  # 14
    (S.FAULT, C.FAULT_RESET): S.SWITCH_ON_DISABLED,  # 15
}

# States in which the power stage has its voltage, and those in which the motor has current.
LIVE = (S.SWITCHED_ON, S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE)
ENERGISED = (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE, S.FAULT_REACTION_ACTIVE)


def command_of(controlword: int, previous: int) -> Command | None:
    """Return a controlword's command; a fault reset is a rising edge of bit 7 since the `previous` one."""
    if controlword & ~previous & _FAULT_RESET_BIT:
        return Command.FAULT_RESET
    return _COMMANDS[controlword & 0xFF]


def after(state: PowerState, command: Command) -> PowerState:
    """Return the state that follows; the same one where the table has no transition."""
    return TRANSITIONS.get((state, command), state)
