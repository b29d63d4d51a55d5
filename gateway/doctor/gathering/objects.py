"""The objects that the doctor reads, by device."""

from collections.abc import Iterator

from eds import Description
from gateway.config.robot import JointTable
from gateway.doctor.observations import FIRST_PROFILE_OBJECT, Object, Place

PDOS = range(4)
MAPPED = 8
_NODE: tuple[Object, ...] = (
    (0x1000, 0),
    (0x1006, 0),
    (0x1017, 0),
    *((0x1018, sub) for sub in (1, 2, 3)),
)
_JOINT: tuple[Object, ...] = (
    (0x6007, 0),
    (0x605A, 0),
    (0x6060, 0),
    (0x6061, 0),
    (0x6065, 0),
    (0x6073, 0),
    (0x6075, 0),
    (0x608F, 1),
    (0x608F, 2),
    (0x6091, 1),
    (0x6091, 2),
    (0x60A9, 0),
    (0x60C2, 1),
    (0x60C2, 2),
)
_PARAMETERS: tuple[Object, ...] = tuple(
    (base + number, sub) for base in (0x1400, 0x1800) for number in PDOS for sub in (1, 2)
)
_MAPPINGS: tuple[Object, ...] = tuple(
    (base + number, sub) for base in (0x1600, 0x1A00) for number in PDOS for sub in range(MAPPED + 1)
)


def wanted(place: Place, description: Description | None) -> Iterator[Object]:
    """Yield the objects to read: those of its file, and its identity in any case."""
    for index, subindex in _NODE:
        if index == 0x1018 or description is None or description.has(index, subindex):
            yield index, subindex
    if not isinstance(place.table, JointTable) or description is None:
        return
    for index, subindex in (*_JOINT, *_PARAMETERS, *_MAPPINGS):
        own = index + 0x800 * place.axis if index >= FIRST_PROFILE_OBJECT else index
        if description.has(own, subindex):
            yield own, subindex
