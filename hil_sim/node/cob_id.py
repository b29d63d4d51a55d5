"""COB-IDs as objects hold them: an identifier, and bits that say how it is used (CiA 301 §7.5.2)."""

from collections.abc import Callable

from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Entry, Value

INVALID = 1 << 31
NO_REMOTE = 1 << 30  # of a TPDO: it is not sent on request
PRODUCES = 1 << 30  # of SYNC: this device makes it
IDENTIFIER = 0x7FF

_OTHER_BITS = 0x3FFF_FFFF & ~IDENTIFIER  # of extended frames, which these devices do not use

# Restricted CAN-IDs (§7.3.5): no object may be configured to use them.
_RESTRICTED = (
    range(0x080),  # NMT, and reserved
    range(0x101, 0x181),
    range(0x581, 0x600),  # default SDO
    range(0x601, 0x680),
    range(0x6E0, 0x700),
    range(0x701, 0x800),  # NMT error control, LSS
)


def is_valid(cob_id: int) -> bool:
    """Return whether the communication object exists; identifier 0 stands for none in files, it is NMT's."""
    return not cob_id & INVALID and bool(cob_id & IDENTIFIER)


def guard(
    entry: Entry, exists: Callable[[int], bool] = is_valid, frozen: Callable[[int], bool] = is_valid
) -> Callable[[Value], None]:
    """Make a check of `entry`: what `exists` may use the identifier, and keeps it while `frozen`."""

    def check(value: Value) -> None:
        new, old = int(value), entry.number()
        identifier = new & IDENTIFIER
        refused = exists(new) and any(identifier in restricted for restricted in _RESTRICTED)
        moves = frozen(old) and frozen(new) and identifier != old & IDENTIFIER
        if new & _OTHER_BITS or refused or moves:
            raise SdoAbort(AbortCode.INVALID_VALUE)

    return check
