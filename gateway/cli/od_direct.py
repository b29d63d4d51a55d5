"""`gwrms od NODE --interface BUS --eds FILE`: objects read straight from a bus, without a gateway."""

from pathlib import Path

from drivers.cli.buses import named
from drivers.errors import SettingsError
from drivers.scan.objects import read_objects
from drivers.trace.values import value_of
from eds import Description, EdsError, load, locate
from gateway.modules.control.dictionary import address, by_eds, unreadable
from gateway.wire.dictionary import ObjectInfo, ObjectValue
from gateway.wire.object_search import fitting


def read_directly(
    bus: str, node: int, file: str, search: str, bitrate: int | None
) -> tuple[list[ObjectInfo], dict[str, ObjectValue]]:
    """Return the objects that fit, and what the node holds of them.

    Raises:
        DriverError: the file or the interface cannot be had, or somebody else asks the node.

    """
    buses = list(named([bus], bitrate))
    if len(buses) != 1:
        raise SettingsError(f"{bus} has {len(buses)} buses: name the interface of one")
    description, fits = _described(file, node), fitting(search)
    found = [one for one in description.variables() if fits(one.index, one.subindex, one.qualname)]
    values = {
        address(one.index, one.subindex): ObjectValue(None, "", None, why)
        for one in found
        if (why := unreadable(one)) is not None
    }
    wanted = [(one.index, one.subindex) for one in found if not unreadable(one)]
    for (index, subindex), told in read_objects(buses[0][1], node, wanted) if wanted else ():
        where = address(index, subindex)
        if isinstance(told, Exception):
            values[where] = ObjectValue(None, "", None, str(told) or "no answer")
        else:
            read = value_of(description, index, subindex, told)
            values[where] = ObjectValue(read.value, read.words, None)
    return [by_eds(one) for one in found], values


def _described(file: str, node: int) -> Description:
    try:
        return load(locate(file, Path.cwd() / "here"), node)
    except EdsError as error:
        raise SettingsError(str(error)) from error
