"""The table of a robot's file for a device: what its EDS tells, and what is left to fill in as comments."""

import json
from collections.abc import Iterator

from eds.description import Description
from eds.report import AXIS_OFFSET, Objects, axes, ratio
from eds.shipped import SHIPPED

BUS = "main"
_WIDTH = 34  # of a line before its comment
_RATIOS = (  # key, the object that tells it, what it is, and an example
    ("counts_per_revolution", 0x608F, "counts of 6064h per revolution of the encoder", "4096"),
    ("gear_ratio", 0x6091, "revolutions of the encoder per revolution of the joint", "100"),
)


def joint_table(
    description: Description,
    node_id: int | None = None,
    bus: str = BUS,
    read: Objects | None = None,
) -> str:
    """TOML to paste into a robot's file: a table a joint that the device can be, else `[device.NAME]`.

    `node_id` is `None` where nobody knows it; `read` is what the device itself has said, which counts more
    than its file. A key that is needed and not known is a comment, so that nobody runs what was made up.
    """
    count = axes(description)
    if not count:
        return _text(_device(description, node_id, bus))
    each = (_joint(description, node_id, bus, read, axis if count > 1 else None) for axis in range(count))
    return "\n".join(_text(lines) for lines in each)


def _joint(
    description: Description, node_id: int | None, bus: str, read: Objects | None, axis: int | None
) -> Iterator[tuple[str, str]]:
    name = f"{_name(node_id)}{'' if axis is None else f'_{axis}'}"
    yield f"[joint.{name}]", "call it by what it moves, such as left_knee"
    yield from _place(description, node_id, bus)
    if axis is not None:
        yield f"axis = {axis}", ""
    for key, index, what, example in _RATIOS:
        told = ratio(description, index + (axis or 0) * AXIS_OFFSET, read)
        if told is None:
            yield f"# {key} = {example}", f"fill in: {what}"
        else:
            yield f"{key} = {told:g}", f"{index:X}h; {what}"
    yield "# direction = -1", "where the joint counts the wrong way"
    yield "# zero_offset = 0.0", "rad: its angle where the drive counts 0"


def _device(description: Description, node_id: int | None, bus: str) -> Iterator[tuple[str, str]]:
    yield f"[device.{_name(node_id)}]", "call it by what it does, such as gait"
    yield from _place(description, node_id, bus)


def _place(description: Description, node_id: int | None, bus: str) -> Iterator[tuple[str, str]]:
    yield f'bus = "{bus}"', f"the name of its [can.{bus}]"
    if node_id is None:
        yield "# node_id = 1", "fill in: gwrms scan BUS says who is there"
    else:
        yield f"node_id = {node_id}", ""
    file = description.path
    ships = file.parent == SHIPPED
    yield (
        f"eds = {json.dumps(file.name, ensure_ascii=False)}",
        "" if ships else "put the file beside this one",
    )


def _name(node_id: int | None) -> str:
    return "NAME" if node_id is None else f"node_{node_id}"


def _text(lines: Iterator[tuple[str, str]]) -> str:
    return "".join(
        f"{line:<{_WIDTH}}# {comment}".rstrip() + "\n" if comment else f"{line}\n" for line, comment in lines
    )
