"""Every unconfigured device on a bus, found by questions about the bits of its identity (CiA 305, fastscan).

The search as the standard has it ends with the lowest one, ready to be configured. This one asks about both
values of each bit, and so finds all of them without touching any.
"""

from collections.abc import Iterator

from drivers.errors import Mismatch
from drivers.lss.master import PARTS, Identity, LssMaster

BITS = 32
SEARCHES = 2
PATIENCE = 4


def unconfigured(master: LssMaster) -> list[Identity]:
    """Find every device without a node id; where answers came late it is searched again, with more patience.

    Raises:
        Mismatch: an identity that was found is not confirmed: answers came late, or were lost. Or a device
            without a node id answers, and takes no part in the search.
        Unavailable: the bus is not open.

    """
    if not master.begin_scan():
        if master.is_anybody_unconfigured():
            raise Mismatch(
                "a device without a node id answers, and knows no fastscan: give its identity (1018h, often "
                "on its label), or take all other devices off the bus and say `only`"
            )
        return []
    for _ in range(SEARCHES):
        identities = [Identity(*numbers) for numbers in _identities(master, ())]
        doubtful = [one for one in identities if not _confirmed(master, one.numbers)]
        if not doubtful:
            master.release()
            return identities
        master.scan_s *= PATIENCE
    raise Mismatch(
        f"the search found {doubtful[0]}, and no device confirms it: answers came late or were lost; "
        "search again, with a longer --timeout"
    )


def _identities(master: LssMaster, known: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Yield every identity that begins with the numbers that are known."""
    part = len(known)
    if part == len(PARTS):
        yield known
        return
    _confirmed(master, known)  # the devices that have them turn to this part, all others wait
    for number in list(_numbers(master, part, 0, BITS)):
        yield from _identities(master, (*known, number))


def _numbers(master: LssMaster, part: int, above: int, bit: int) -> Iterator[int]:
    """Every number of this part whose bits from `bit` upwards are those of `above`: somebody has them."""
    if bit == 0:
        yield above
        return
    bit -= 1
    zero = master.matches(part, above, bit, part)
    if zero:
        yield from _numbers(master, part, above, bit)
    one = above | 1 << bit
    if not zero or master.matches(part, one, bit, part):
        yield from _numbers(master, part, one, bit)


def _confirmed(master: LssMaster, numbers: tuple[int, ...]) -> bool:
    """Begin anew, and go through these numbers; the last of four leads to no other, and selects nobody."""
    if not master.begin_scan():
        return False
    last = len(PARTS) - 1
    return all(master.matches(part, number, 0, min(part + 1, last)) for part, number in enumerate(numbers))
