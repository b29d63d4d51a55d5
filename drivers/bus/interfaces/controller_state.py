"""The CAN controller's own state, as error frames tell it (Linux `can/error.h`)."""

from enum import StrEnum

from drivers.bus.frames import ERROR

_CONTROLLER, _BUS_OFF, _RESTARTED = 0x04, 0x40, 0x100


class BusState(StrEnum):
    """State of the CAN controller (ISO 11898-1 fault confinement)."""

    ACTIVE = "error active"
    WARNING = "error warning"
    PASSIVE = "error passive"
    OFF = "bus off"


# Bits of data byte 1 of a controller error, worst first.
_CONTROLLER_STATES = ((0x30, BusState.PASSIVE), (0x0C, BusState.WARNING), (0x40, BusState.ACTIVE))


def bus_state(can_id: int, data: bytes) -> BusState | None:
    """Return the state that an error frame announces; `None` where it is about something else."""
    if not can_id & ERROR:
        return None
    if can_id & _BUS_OFF:
        return BusState.OFF
    if can_id & _RESTARTED:
        return BusState.ACTIVE
    if can_id & _CONTROLLER and len(data) > 1:
        return next((state for bits, state in _CONTROLLER_STATES if data[1] & bits), None)
    return None
