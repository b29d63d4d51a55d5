"""The matching EDS file of a device that was found, and its deviations from the device."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import eds
from drivers.scan.identification import NodeAnswers
from eds import Description, EdsError
from eds.report import pdo_rows
from eds.shipped import SHIPPED, shipped

SUFFIXES = (".eds", ".dcf")


@dataclass(frozen=True, slots=True)
class Proposal:
    """A file whose vendor and product are the device's; `differs` says what else is not as it says."""

    description: Description
    differs: tuple[str, ...]


def files(folders: Sequence[Path]) -> tuple[Path, ...]:
    """Return every EDS and DCF file in these folders and below, and those that ship; each once."""
    found = (
        path for folder in folders for path in sorted(folder.rglob("*")) if path.suffix.lower() in SUFFIXES
    )
    every = (*found, *(SHIPPED / name for name in shipped()))
    return tuple({path.resolve(): path for path in reversed(every)}.values())[::-1]


class Library:
    """EDS files by vendor and product; those that cannot be read are told in `unreadable`."""

    def __init__(self, paths: Iterable[Path]) -> None:
        self.unreadable: dict[Path, str] = {}
        self._by_product: dict[tuple[int, int], list[Path]] = {}
        for path in paths:
            try:
                found = eds.load(path, 1)
            except EdsError as error:
                self.unreadable[path] = str(error)
                continue
            if found.vendor_id is not None and found.product_code is not None:
                self._by_product.setdefault((found.vendor_id, found.product_code), []).append(path)

    def proposals(self, node: int, told: NodeAnswers) -> tuple[Proposal, ...]:
        """Return the files for this device, those that contradict it least first."""
        if told.vendor_id is None or told.product_code is None:
            return ()
        paths = self._by_product.get((told.vendor_id, told.product_code), ())
        descriptions = (eds.load(path, node) for path in paths)
        found = (Proposal(one, tuple(_differences(one, told))) for one in descriptions)
        return tuple(sorted(found, key=lambda proposal: len(proposal.differs)))


def _differences(description: Description, told: NodeAnswers) -> Iterator[str]:
    for index, subindex, name, value in (
        (0x1018, 3, "revision", told.revision),
        (0x1000, 0, "device type", told.device_type),
    ):
        said = _default(description, index, subindex)
        if said and value is not None and value != said:
            yield f"{index:04X}h {name} is 0x{value:X}, the file says 0x{said:X}"
    rows = {row.name: row for row in pdo_rows(description)}
    for tpdo in told.tpdos:
        row = rows.get(f"TPDO{tpdo.number}")
        if row is None:
            yield f"has a TPDO{tpdo.number}, which the file lacks"
        elif (
            tpdo.enabled
            and row.mapped
            and row.mapped != tuple((o.index, o.subindex, o.bits) for o in tpdo.objects)
        ):
            yield f"TPDO{tpdo.number} is mapped otherwise than the file's default: somebody has configured it"
    for axis in told.axes:
        if axis.number and not description.has(0x6041 + 0x800 * axis.number):
            yield f"has axis {axis.number}, which the file lacks"


def _default(description: Description, index: int, subindex: int) -> int | None:
    variable = description.variable(index, subindex)
    default = None if variable is None else variable.default
    return default if isinstance(default, int) else None
