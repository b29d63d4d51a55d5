"""NMT states in a node's messages: boot-up, heartbeat, node guarding (CiA 301 §7.2.8)."""

from enum import IntEnum

HEARTBEAT = 0x700  # plus the node id


class NmtState(IntEnum):
    """State in a heartbeat; `BOOT_UP` is sent once after power-on or reset."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    @property
    def words(self) -> str:
        return self.name.lower().replace("_", "-")


def parse_heartbeat(data: bytes) -> NmtState | None:
    """Return the state in a frame of 700h + node id; `None` for anything else.

    Bit 7 is node guarding's toggle.
    """
    if len(data) != 1:
        return None
    try:
        return NmtState(data[0] & 0x7F)
    except ValueError:
        return None
