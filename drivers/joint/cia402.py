"""The drive's state machine as its statusword tells it, and what stops it (CiA 402-2 §8)."""

from enum import IntEnum


class DriveState(IntEnum):
    """States of the power drive system; the numbers are this package's own."""

    NOT_READY_TO_SWITCH_ON = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7

    @property
    def words(self) -> str:
        return self.name.lower().replace("_", " ")


# States in which a drive may move.
ENERGISED = frozenset(
    {DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE}
)
STATE_WORDS: dict[int, str] = {int(state): state.words for state in DriveState}

# Statusword bits that tell the state: (mask, pattern) of CiA 402-2 table "state coding".
_CODING: tuple[tuple[int, int, DriveState], ...] = (
    (0x4F, 0x00, DriveState.NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, DriveState.SWITCH_ON_DISABLED),
    (0x6F, 0x21, DriveState.READY_TO_SWITCH_ON),
    (0x6F, 0x23, DriveState.SWITCHED_ON),
    (0x6F, 0x27, DriveState.OPERATION_ENABLED),
    (0x6F, 0x07, DriveState.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, DriveState.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, DriveState.FAULT),
)
STATE_BITS = 0x6F


def _decode(bits: int) -> DriveState | None:
    return next((state for mask, pattern, state in _CODING if bits & mask == pattern), None)


# By the statusword's state bits; None where they are no state of the standard.
STATE_OF: tuple[DriveState | None, ...] = tuple(_decode(bits) for bits in range(STATE_BITS + 1))


def drive_state(statusword: int) -> DriveState | None:
    """Return the state in a statusword; `None` for a pattern that the standard does not know."""
    return STATE_OF[statusword & STATE_BITS]


# What a drive does on quick stop (605Ah) and when it loses its master (6007h).
QUICK_STOP_OPTIONS: dict[int, str] = {
    0: "disables the drive at once: the joint goes limp",
    1: "slows down on the slow-down ramp, then disables the drive",
    2: "slows down on the quick-stop ramp, then disables the drive",
    3: "slows down on the current limit, then disables the drive",
    4: "slows down on the voltage limit, then disables the drive",
    5: "slows down on the slow-down ramp and holds",
    6: "slows down on the quick-stop ramp and holds",
    7: "slows down on the current limit and holds",
    8: "slows down on the voltage limit and holds",
}
ABORT_CONNECTION_OPTIONS: dict[int, str] = {
    0: "does nothing: it keeps moving",
    1: "goes into fault",
    2: "disables its voltage: the joint goes limp",
    3: "makes a quick stop",
}
MODES: dict[int, str] = {
    0: "no mode",
    1: "profile position",
    2: "velocity",
    3: "profile velocity",
    4: "profile torque",
    6: "homing",
    7: "interpolated position",
    8: "cyclic synchronous position",
    9: "cyclic synchronous velocity",
    10: "cyclic synchronous torque",
}


def option_text(options: dict[int, str], value: int | None) -> str:
    """Return an option code in words."""
    if value is None:
        return "is not told by the device"
    return options.get(value, f"is the vendor's own ({value})")
