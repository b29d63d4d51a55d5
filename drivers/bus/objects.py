"""Reading a device's objects as its EDS describes them, within a job of its SDO worker."""

from collections.abc import Sequence

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import size_of, unsigned
from drivers.errors import DeviceAbort, DriverError
from eds import Description


def read(sdo: SdoChannel, description: Description, index: int, subindex: int) -> bytes:
    """Return an object's bytes, no more than its type has.

    Some devices answer with four whatever its size.
    """
    data = sdo.upload(index, subindex)
    variable = description.variable(index, subindex)
    size = None if variable is None else size_of(variable.data_type or 0)
    return data if size is None else data[:size]


def read_rest(
    sdo: SdoChannel,
    description: Description,
    objects: Sequence[tuple[int, int]],
    found: list[bytes | DriverError],
) -> list[bytes | DriverError]:
    """Add to `found` what of `objects` is not in it yet, errors too; one without an answer ends the list."""
    for index, subindex in objects[len(found) :]:
        try:
            found.append(read(sdo, description, index, subindex))
        except DriverError as error:
            found.append(error)
            if not isinstance(error, DeviceAbort):
                break
    return found


def read_optional(sdo: SdoChannel, description: Description, index: int, subindex: int) -> int | None:
    """Return a number that not every device has."""
    if not description.has(index, subindex):
        return None
    try:
        return unsigned(read(sdo, description, index, subindex))
    except DeviceAbort:
        return None


def identity_problem(sdo: SdoChannel, description: Description) -> str | None:
    """Return why a node may not be the device of its EDS (1018h, CiA 301 §7.5.2.19), in words."""
    expected = (description.vendor_id, description.product_code)
    problems = []
    for subindex, name, should in zip((1, 2), ("vendor id", "product code"), expected, strict=True):
        if not should or not description.has(0x1018, subindex):
            continue
        is_ = read_optional(sdo, description, 0x1018, subindex)
        if is_ != should:
            words = "cannot be read" if is_ is None else f"is 0x{is_:X}"
            problems.append(f"1018h {name} {words}, the EDS {description.path.name} is for 0x{should:X}")
    if not problems:
        return None
    return f"{'; '.join(problems)}: nothing is written to it; correct its eds or its node_id"
