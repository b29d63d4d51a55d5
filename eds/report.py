"""The contents of an EDS or DCF file as rows for people and programs."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from eds.datatypes import DATA_TYPES
from eds.description import Description

AXIS_OFFSET = 0x800
MAX_AXES = 8
JOINT_OBJECTS = ((0x6041, "statusword"), (0x6064, "position actual value"))

# Communication and mapping parameters (CiA 301 §7.5.2): name, first communication, first mapping object.
_PDOS = (("TPDO", 0x1800, 0x1A00), ("RPDO", 0x1400, 0x1600))
_NOT_VALID = 0x8000_0000
MAX_MAPPED = 64  # CiA 301 §7.5.2.36

Objects = Mapping[tuple[int, int], int]  # values by index and sub-index


@dataclass(frozen=True, slots=True)
class ObjectRow:
    """One object or sub-object. Limits and default are `None` where the file gives none."""

    index: int
    subindex: int
    name: str
    data_type: str
    access: str
    minimum: float | None
    maximum: float | None
    default: object
    value: object  # a DCF's


@dataclass(frozen=True, slots=True)
class PdoRow:
    """One PDO as the file's defaults, or a DCF's values, have it; what it does not say is `None`."""

    name: str
    cob_id: int | None
    enabled: bool | None
    transmission_type: int | None
    mapped: tuple[tuple[int, int, int], ...]  # index, sub-index, bits


def object_rows(description: Description) -> Iterator[ObjectRow]:
    """Yield every object of the device, by index and sub-index."""
    for variable in description.variables():
        data_type = DATA_TYPES.get(variable.data_type or 0)
        yield ObjectRow(
            variable.index,
            variable.subindex,
            variable.qualname,
            "?" if data_type is None else data_type.name,
            variable.access_type,
            variable.min,
            variable.max,
            variable.default,
            variable.value,
        )


def pdo_rows(description: Description) -> Iterator[PdoRow]:
    """Yield every PDO that the file describes."""
    for kind, communication, mapping in _PDOS:
        for number in range(512):
            if not description.has(communication + number, 1):
                continue
            cob_id = file_value(description, communication + number, 1)
            count = file_value(description, mapping + number, 0)
            last = MAX_MAPPED if count is None else min(count, MAX_MAPPED)  # a file may give entries alone
            entries = (file_value(description, mapping + number, sub) for sub in range(1, last + 1))
            yield PdoRow(
                f"{kind}{number + 1}",
                None if cob_id is None else cob_id & 0x1FFF_FFFF,
                None if cob_id is None else not cob_id & _NOT_VALID,
                file_value(description, communication + number, 2),
                tuple((entry >> 16, entry >> 8 & 0xFF, entry & 0xFF) for entry in entries if entry),
            )


def axes(description: Description) -> int:
    """Return the number of joints that the device can be: axes with all objects that a joint needs."""
    return sum(
        all(description.has(index + axis * AXIS_OFFSET) for index, _ in JOINT_OBJECTS)
        for axis in range(MAX_AXES)
    )


def joint_text(description: Description) -> str:
    """Return whether the device can be a joint, and what it lacks, in words."""
    count = axes(description)
    if count:
        return "yes" if count == 1 else f"yes, {count} axes"
    missing = [f"0x{index:04X} ({name})" for index, name in JOINT_OBJECTS if not description.has(index)]
    return f"no, {' and '.join(missing)} missing"


def grouped_findings(description: Description) -> list[tuple[str, str, str, int]]:
    """Return findings as (severity, first place, text, how often).

    What stands in thirty sections is told once.
    """
    first: dict[tuple[str, str], str] = {}
    often: Counter[tuple[str, str]] = Counter()
    for finding in description.findings:
        key = (finding.severity, finding.text)
        first.setdefault(key, finding.where)
        often[key] += 1
    return [(severity, first[severity, text], text, often[severity, text]) for severity, text in first]


def file_value(description: Description, index: int, subindex: int) -> int | None:
    """Return the file's value of an object, a DCF's before a default; `None` without one."""
    variable = description.variable(index, subindex)
    if variable is None:
        return None
    value = variable.default if variable.value is None else variable.value
    return value if isinstance(value, int) else None


def ratio(description: Description, index: int, read: Objects | None = None) -> float | None:
    """Return the ratio of an object's first two entries, as in 608Fh and 6091h; `read` values come first.

    `None` where nobody knows: 1:1 is what drives hold that were never told.
    """
    above, below = (
        (read or {}).get((index, subindex), file_value(description, index, subindex)) for subindex in (1, 2)
    )
    return above / below if above and below and above != below else None
