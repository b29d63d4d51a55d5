"""The contents of an EDS or DCF file, and the repairs that were needed to read it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

if TYPE_CHECKING:
    import canopen
    from canopen.objectdictionary import ODVariable


FIRST_OBJECT = 0x1000  # below are data types


class EdsError(Exception):
    """A file that cannot be used; the message names file, section or line, and what to do."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing in a file that was repaired, left out, or that a person should look at."""

    severity: Literal["info", "warning"]
    where: str  # section or line
    text: str


@dataclass(frozen=True, slots=True)
class Description:
    """A device as its EDS or DCF describes it.

    `vendor_id` and `product_code` are those of object 1018h where the file gives them.
    """

    path: Path
    object_dictionary: canopen.ObjectDictionary
    vendor: str
    product: str
    vendor_id: int | None
    product_code: int | None
    findings: tuple[Finding, ...]
    digest: str = ""  # SHA-256 of the file's text

    def has(self, index: int, subindex: int = 0) -> bool:
        """Return whether the file describes this object."""
        return self.variable(index, subindex) is not None

    def variable(self, index: int, subindex: int = 0) -> ODVariable | None:
        """Return the description of one object, `None` where the file has none."""
        if index not in self.object_dictionary.indices:
            return None  # without an error that canopen makes and takes
        found = self.object_dictionary.get_variable(index, subindex)
        if found is None or found.subindex != subindex:
            return None
        # canopen invents entries of arrays that the device does not have.
        members = getattr(found.parent, "subindices", None)
        return found if members is None or subindex in members else None

    def variables(self) -> Iterator[ODVariable]:
        """Yield every object and sub-object of the device, by index and sub-index."""
        for index in self.object_dictionary:
            if index < FIRST_OBJECT:
                continue
            entry = self.object_dictionary[index]
            members: Mapping[int, ODVariable] | None = getattr(entry, "subindices", None)
            yield from (cast("ODVariable", entry),) if members is None else members.values()

    def require(self, objects: Iterable[tuple[int, str]], purpose: str) -> None:
        """Raise `EdsError` that names every one of `objects` (index, name) that the file lacks."""
        missing = [f"0x{index:04X} ({name})" for index, name in objects if not self.has(index)]
        if missing:
            raise EdsError(
                f"{self.path}: {', '.join(missing)} missing, which {purpose} needs; "
                "take the EDS of this device and firmware from its vendor"
            )
