"""`gwrms od`: the object dictionary of a device, with what it holds now."""

import argparse
from dataclasses import replace
from typing import Final

from gateway.cli.arguments import lines
from gateway.cli.connect import UnknownName, connect, parser
from gateway.cli.od_watch import watch
from gateway.cli.set import TypedValue, change_of, value_of
from gateway.cli.text import exact, say, say_json, table
from gateway.cli.writing import add_trial, write
from gateway.client import ClientError, Robot
from gateway.wire.dictionary import ObjectInfo, ObjectList, ObjectValue
from gateway.wire.limits import OBJECTS_READ
from gateway.wire.robot import Description

EPILOG = """--set writes as `gwrms set` does: only parameters, in their own unit, with the same checks, in
the journal, read back. To make another object a parameter, use parameters = "eds" and release in
robot.toml.

examples:
  gwrms od left_knee                     every object of its EDS
  gwrms od left_knee 0x6060…             from there on
  gwrms od 2 'target position'           of node 2, by words of the name
  gwrms od left_knee 0x60* --read        with what the device holds now
  gwrms od left_knee 0x6041 --watch      a line for each change, looked for once a second
  gwrms od left_knee 0x6072:0 --set 500
  gwrms od 5 0x1018 --interface can0 --eds drive.eds   read from the bus itself, without a gateway"""


NODES: Final = range(1, 128)
NO_NODE: Final = "with --interface DEVICE is a node id, 1 to 127"


class NotOne(ClientError):
    """The value to write is not a single parameter."""


def main(argv: list[str]) -> int:
    """Run `gwrms od`."""
    made = parser("od", "Search a device's object dictionary: names, types, limits, values.", EPILOG)
    made.add_argument("device", metavar="DEVICE", help="a joint or device by name, or a node id")
    made.add_argument(
        "search",
        metavar="SEARCH",
        nargs="?",
        default="",
        help="0x6041, 0x1018:4, 0x60*, 0x6060-0x607F, 0x6060…, or words of the name (default: all)",
    )
    made.add_argument("--read", action="store_true", help="read the values from the device")
    made.add_argument("--watch", action="store_true", help="print a line for every change, until Ctrl-C")
    made.add_argument("--count", type=lines, metavar="N", help="end --watch after N lines")
    made.add_argument(
        "--set",
        metavar="VALUE",
        type=_value,
        help="write the one object that SEARCH finds; units as in 3deg, 420mm",
    )
    add_trial(made)
    made.add_argument(
        "--interface",
        metavar="BUS",
        help="can0, INTERFACE:CHANNEL of python-can, or a robot's file: read node DEVICE there, by --eds",
    )
    made.add_argument("--eds", metavar="FILE", help="the node's EDS or DCF, for --interface")
    made.add_argument("--bitrate", type=int, help="bit/s, for interfaces that need one")
    arguments = made.parse_args(argv)
    if wrong := _misused(arguments):
        made.error(wrong)
    if arguments.interface is not None:
        return _show_directly(arguments)
    with connect(arguments, "od") as robot:
        description = robot.describe()
        component = _component(arguments.device, description)
        found = robot.objects(component, arguments.search)
        if not found.objects:
            raise UnknownName(f"{component} has no object that fits {arguments.search!r}")
        if arguments.watch:
            return watch(robot, found, arguments.count, as_json=arguments.json)
        if arguments.set is not None:
            return _set(robot, found, description, arguments)
        return _show(robot, found, arguments)


def _misused(arguments: argparse.Namespace) -> str | None:
    if arguments.trial is not None and arguments.set is None:
        return "--trial is for --set"
    if arguments.watch and (arguments.set is not None or arguments.interface is not None):
        return "--watch is neither for --set nor for --interface"
    if arguments.count is not None and not arguments.watch:
        return "--count is for --watch"
    if arguments.interface is None:
        return "--eds and --bitrate are for --interface" if arguments.eds or arguments.bitrate else None
    if arguments.set is not None:
        return "--set goes through a gateway, which has limits and a journal; --interface only reads"
    if arguments.eds is None:
        return "--interface needs --eds FILE (gwrms scan --active tells which fits)"
    return None if arguments.device.isdecimal() and int(arguments.device) in NODES else NO_NODE


def _show_directly(arguments: argparse.Namespace) -> int:
    from gateway.cli.od_direct import read_directly  # for who reads a bus only

    node, search = int(arguments.device), arguments.search
    objects, values = read_directly(arguments.interface, node, arguments.eds, search, arguments.bitrate)
    if not objects:
        raise UnknownName(f"{arguments.eds} has no object that fits {search!r}")
    return _say(ObjectList(f"node {node}", objects), values, arguments, is_read=True)


def _component(device: str, description: Description) -> str:
    """Return the component's name; of a node with several the first, whose EDS is that of all."""
    if not device.isdecimal():
        return device
    nodes = {node.node_id: node.components for bus in description.buses for node in bus.nodes}
    components = nodes.get(int(device))
    if not components:
        known = ", ".join(f"{node_id} ({'/'.join(names)})" for node_id, names in sorted(nodes.items()))
        raise UnknownName(f"the robot has no node {device}; it has {known or 'none'}")
    return components[0]


def _show(robot: Robot, found: ObjectList, arguments: argparse.Namespace) -> int:
    values: dict[str, ObjectValue] = {}
    if arguments.read:
        addresses = [one.object for one in found.objects]
        for first in range(0, len(addresses), OBJECTS_READ):
            values |= robot.read_objects(found.component, *addresses[first : first + OBJECTS_READ]).values
    return _say(found, values, arguments, is_read=arguments.read)


def _say(
    found: ObjectList, values: dict[str, ObjectValue], arguments: argparse.Namespace, *, is_read: bool
) -> int:
    if arguments.json:
        told = {"component": found.component, "objects": found.objects, "left_off": found.left_off}
        say_json(told | {"values": values})
    else:
        head = ("OBJECT", "NAME", "TYPE", "ACCESS", "RANGE", *(("HOLDS",) if is_read else ()), "")
        say(table(head, [_row(one, values.get(one.object)) for one in found.objects]))
        if found.left_off:
            say(f"and {found.left_off} more: search for less, or from 0x…… on\n")
    return 1 if values and all(one.problem for one in values.values()) else 0


def _row(info: ObjectInfo, value: ObjectValue | None) -> tuple[str, ...]:
    low_high = "" if info.min is None and info.max is None else f"{exact(info.min)} … {exact(info.max)}"
    name = info.parameter or ""
    note = name if info.read_only is None or not name else f"{name} (read-only: {info.read_only})"
    held = () if value is None else (value.problem or value.words,)
    return info.object, info.name, info.type, info.access, low_high, *held, note


def _set(robot: Robot, found: ObjectList, description: Description, arguments: argparse.Namespace) -> int:
    if len(found.objects) != 1 or found.left_off:
        count = len(found.objects) + found.left_off
        raise NotOne(f"{arguments.search!r} fits {count} objects; name one, as 0x6072:0")
    info = found.objects[0]
    if info.parameter is None:
        raise NotOne(
            f"{found.component} {info.object} {info.name} is no parameter, {info.access} in the EDS; what "
            'may be written stands in robot.toml: [parameter."…"], or parameters = "eds" and release'
        )
    change: TypedValue = replace(arguments.set, name=info.parameter)
    return write(robot, {info.parameter: value_of(change, description)}, description, arguments)


def _value(text: str) -> TypedValue:
    """Return a value and its unit, for a parameter that is not known yet."""
    try:
        return change_of(f"object={text}")
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no number with or without its unit, as 60 or 3deg"
        ) from error
