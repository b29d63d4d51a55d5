"""Quick stop of one axis by SDO: asks for it, and answers only what the statusword confirms.

The controlword for quick stop is 0002h (enable voltage 1, quick stop 0, all else 0). It is sent without
asking for the state first, because in no state can it enable the drive or reset a fault (CiA 402-2,
transition events): from operation enabled it leads to quick stop active (transition 11), from switched on
and ready to switch on to switch on disabled (10, 7); in every other state, and in an unknown one, it asks
for nothing.
"""

import time
from enum import StrEnum

from drivers.bus.sdo_channel import SdoChannel
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from drivers.joint.cia402 import DriveState, drive_state

CONTROLWORD, STATUSWORD = 0x6040, 0x6041
QUICK_STOP = (0x0002).to_bytes(2, "little")

CONFIRMING_READS = 2  # another master may enable the drive again between two of its cycles
READ_PERIOD_S = 0.01


class StopOutcome(StrEnum):
    """What is known about a drive after a stop was asked of it."""

    CONFIRMED = "confirmed"  # its statusword says that it brakes, has stopped or is switched off
    UNCONFIRMED = "unconfirmed"  # it answers, but not that
    UNREACHABLE = "unreachable"  # it does not answer


# States in which the drive is braking or not driving, and cannot move on its own.
STOPPED_STATES = frozenset({DriveState.QUICK_STOP_ACTIVE, DriveState.SWITCH_ON_DISABLED, DriveState.FAULT})


def quick_stop(sdo: SdoChannel, axis_offset: int, timeout_s: float) -> StopOutcome:
    """Stop the axis whose objects lie `axis_offset` above the first one's; never raises for the device.

    As long as the statusword does not say that it stops, it is asked again.
    """
    deadline = time.monotonic() + timeout_s
    answered = False
    confirmed = 0
    while time.monotonic() < deadline and confirmed < CONFIRMING_READS:
        try:
            if not confirmed:
                answered |= _ask(sdo, axis_offset)
            statusword = unsigned(sdo.upload(STATUSWORD + axis_offset, 0, attempts=1)[:2])
            answered = True
            confirmed = confirmed + 1 if drive_state(statusword) in STOPPED_STATES else 0
        except DeviceAbort:
            answered = True
        except DeviceTimeout:
            confirmed = 0
        except Unavailable:
            break
        time.sleep(min(READ_PERIOD_S, max(0.0, deadline - time.monotonic())))
    if confirmed >= CONFIRMING_READS:
        return StopOutcome.CONFIRMED
    return StopOutcome.UNCONFIRMED if answered else StopOutcome.UNREACHABLE


def _ask(sdo: SdoChannel, axis_offset: int) -> bool:
    """Send the controlword; a refusal is an answer too, and the statusword may say why it need not stop."""
    try:
        sdo.download(CONTROLWORD + axis_offset, 0, QUICK_STOP)
    except DeviceAbort:
        return True
    except DeviceTimeout:
        return False
    return True
