"""NMT states and services of a device (CiA 301 §7.3.2)."""

from enum import IntEnum


class NmtState(IntEnum):
    """The state as a heartbeat carries it; INITIALISING is also the boot-up message."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtService(IntEnum):
    """Commands of an NMT master; the first byte of COB-ID 0."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


NMT_COB_ID = 0x000
HEARTBEAT_BASE = 0x700

STATE_AFTER: dict[int, NmtState] = {
    NmtService.START: NmtState.OPERATIONAL,
    NmtService.STOP: NmtState.STOPPED,
    NmtService.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}

# 1F80h: a device with neither bit 0 (it leads the network) nor bit 2 (it waits for who does) starts itself.
STARTUP = (0x1F80, 0)
LEADS_OR_WAITS = 0b101

# 1029h:1: what an operational device enters on a communication error; 1 changes nothing (CiA 301 §7.5.2.32).
ERROR_BEHAVIOUR = (0x1029, 1)
STATE_AFTER_ERROR: dict[int, NmtState] = {0: NmtState.PRE_OPERATIONAL, 2: NmtState.STOPPED}

# CiA 301 table 38: SDO, SYNC and EMCY live in PRE-OPERATIONAL and OPERATIONAL, PDOs in OPERATIONAL alone.
COMMUNICATING = (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)
