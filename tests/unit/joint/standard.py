"""The power drive system's state machine, written from CiA 402-2 alone; the product is judged by it."""

from drivers.joint.cia402 import DriveState

S = DriveState

# CiA 402-2, table "command coding": mask and pattern of the controlword's bits 7, 3, 2, 1, 0.
CODING = (
    ("disable voltage", 0x82, 0x00),
    ("quick stop", 0x86, 0x02),
    ("shutdown", 0x87, 0x06),
    ("switch on", 0x8F, 0x07),
    ("enable operation", 0x8F, 0x0F),
)
# Figure "state machine": what each command makes of each state; where nothing stands, nothing happens. Some
# drives take "enable operation" in READY TO SWITCH ON as transitions 3 and 4 in one.
TRANSITIONS = {
    "shutdown": {
        S.SWITCH_ON_DISABLED: S.READY_TO_SWITCH_ON,
        S.SWITCHED_ON: S.READY_TO_SWITCH_ON,
        S.OPERATION_ENABLED: S.READY_TO_SWITCH_ON,
    },
    "switch on": {S.READY_TO_SWITCH_ON: S.SWITCHED_ON, S.OPERATION_ENABLED: S.SWITCHED_ON},
    "enable operation": {S.READY_TO_SWITCH_ON: S.OPERATION_ENABLED, S.SWITCHED_ON: S.OPERATION_ENABLED},
    "disable voltage": dict.fromkeys(
        (S.READY_TO_SWITCH_ON, S.SWITCHED_ON, S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE), S.SWITCH_ON_DISABLED
    ),
    "quick stop": {
        S.READY_TO_SWITCH_ON: S.SWITCH_ON_DISABLED,
        S.SWITCHED_ON: S.SWITCH_ON_DISABLED,
        S.OPERATION_ENABLED: S.QUICK_STOP_ACTIVE,
    },
    "fault reset": {S.FAULT: S.SWITCH_ON_DISABLED},
}
LEAVES_BY_ITSELF = frozenset({S.NOT_READY_TO_SWITCH_ON, S.FAULT_REACTION_ACTIVE})

# CiA 402-2, table "state coding": statusword bits 6, 5, 3, 2, 1, 0 as the standard prints them.
STATUSWORDS = {
    "x0xx0000": S.NOT_READY_TO_SWITCH_ON,
    "x1xx0000": S.SWITCH_ON_DISABLED,
    "x01x0001": S.READY_TO_SWITCH_ON,
    "x01x0011": S.SWITCHED_ON,
    "x01x0111": S.OPERATION_ENABLED,
    "x00x0111": S.QUICK_STOP_ACTIVE,
    "x0xx1111": S.FAULT_REACTION_ACTIVE,
    "x0xx1000": S.FAULT,
}


def after(state: DriveState, controlword: int, before: int, stays: bool) -> DriveState:
    """The state after a controlword; `before` is the one before it, `stays` where 605Ah is 5 to 8."""
    if controlword & ~before & 0x80:
        return TRANSITIONS["fault reset"].get(state, state)
    for command, mask, pattern in CODING:
        if controlword & mask == pattern:
            if (command, state, stays) == ("enable operation", S.QUICK_STOP_ACTIVE, True):
                return S.OPERATION_ENABLED  # 16
            return TRANSITIONS[command].get(state, state)
    return state


def statusword(state: DriveState) -> int:
    """One that says this state, with every bit set that says nothing about it."""
    pattern = next(pattern for pattern, one in STATUSWORDS.items() if one is state)
    return int(pattern.replace("x", "1"), 2)
