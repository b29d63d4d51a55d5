"""`gwrms set`: parameters changed, all or none."""

import argparse
import re
from dataclasses import dataclass
from typing import Final

from gateway.cli.connect import check_names, connect, parameter_names, parser
from gateway.cli.text import warn
from gateway.cli.writing import add_trial, write
from gateway.client import ClientError, Robot
from gateway.coding import Number
from gateway.several_joints import all_joints, mirrored, spread
from gateway.units import unit_named
from gateway.wire.robot import Description

EPILOG = """Either all changes are made or none: they are checked first, written, read back from the devices,
and reverted if one fails. If somebody else has control, nothing is changed, and the command reports it.

With --trial the robot itself reverts them after that time, and at once when this command ends in any way,
for example with its terminal, computer or network. Enter keeps them.

--mirror copies each value to the same joint of the other side, --all-joints to every joint, in the same
transaction; without =VALUE it copies that joint's present value. Position limits are converted to each
joint's angle, in whichever direction its drive counts. A joint that cannot take the value is named, and
nothing is written; --leave-out excludes it.

examples:
  gwrms set gait.step_length=0.42 left_knee.max_torque=40
  gwrms set gait.trunk_angle=3deg gait.step_length=420mm
  gwrms set --trial 30 gait.cycle_time=1.1
  gwrms set --mirror left_knee.max_torque=40
  gwrms set --all-joints left_knee.profile_velocity --leave-out right_ankle"""


OBJECTS: Final = range(-(2**63), 2**64)  # what a device's object can hold
LONGEST: Final = 20  # of such a number, with its sign


class NotForAll(ClientError):
    """A joint cannot take a value that it was to have; says why, and that nothing was written."""


class UnknownUnit(ClientError):
    """A value is no number that there can be, or in a unit that its parameter cannot be in."""


_CHANGE: Final = re.compile(r"([^=]+)(?:=([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?) ?([^\d\s.,].*)?)?")


@dataclass(frozen=True, slots=True)
class TypedValue:
    """A typed value: a number and its unit, if one was given; without a number, the held value."""

    name: str
    number: str | None
    unit: str | None


def main(argv: list[str]) -> int:
    """Run `gwrms set`."""
    made = parser("set", "Change parameters: all or none, limit-checked, read back.", EPILOG)
    made.add_argument(
        "changes",
        metavar="NAME[=VALUE[UNIT]]",
        nargs="+",
        type=change_of,
        help="value, in the parameter's own unit or another: 3deg, 420mm, 30rpm",
    )
    whom = made.add_mutually_exclusive_group()
    whom.add_argument("--mirror", action="store_true", help="also set the same joint of the other side")
    whom.add_argument("--all-joints", action="store_true", help="set every joint")
    made.add_argument(
        "--leave-out",
        action="append",
        default=[],
        metavar="JOINT",
        help="with these: skip this joint (repeatable)",
    )
    add_trial(made)
    arguments = made.parse_args(argv)
    is_spread = arguments.mirror or arguments.all_joints
    if arguments.leave_out and not is_spread:
        made.error("--leave-out goes with --mirror or --all-joints")
    bare = [change.name for change in arguments.changes if change.number is None]
    if bare and not is_spread:
        made.error(f"{bare[0]} has no value: write {bare[0]}=VALUE, or say --mirror or --all-joints")
    if len({change.name for change in arguments.changes}) != len(arguments.changes):
        made.error("a parameter is named twice")
    with connect(arguments, "set") as robot:
        description = robot.describe()
        check_names("parameter", [each.name for each in arguments.changes], parameter_names(description))
        if is_spread:
            changes = _spread(robot, arguments, description)
        else:
            changes = {each.name: value_of(each, description) for each in arguments.changes}
        return write(robot, changes, description, arguments)


def _spread(robot: Robot, arguments: argparse.Namespace, description: Description) -> dict[str, Number]:
    """Return the new values of each joint; raises `NotForAll` if one cannot take it and is not left out."""
    held = robot.read().values
    changes: dict[str, Number] = {}
    check_names("joint", arguments.leave_out, all_joints(description))
    for each in arguments.changes:
        name = _named(each, description)
        joints = (
            mirrored(name.partition(".")[0], description) if arguments.mirror else all_joints(description)
        )
        value = held[name].value if each.number is None and name in held else None
        if each.number is not None:
            value = value_of(each, description)
        if value is None:
            raise NotForAll(f"nothing was written: what {name} holds is not known")
        if len(joints) < 2 or name.partition(".")[0] not in joints:
            raise NotForAll(f"nothing was written: {name} is of no joint that has others like it")
        found = spread(name, value, joints, description, held).without(arguments.leave_out)
        if found.problem:
            raise NotForAll(
                f"nothing was written. {found.problem} (--leave-out JOINT lets one stay as it is)"
            )
        if changes.keys() & found.changes.keys():
            raise NotForAll(
                f"nothing was written: {min(changes.keys() & found.changes.keys())} is meant twice"
            )
        changes |= found.changes
    if not changes:
        raise NotForAll("nothing was written: every joint is left out")
    for joint in arguments.leave_out:
        warn("set", f"{joint} is left out, and stays as it is")
    return changes


def _named(change: TypedValue, description: Description) -> str:
    """Return the parameter's name, also where its address was typed."""
    return next(
        info.name
        for info in description.parameters
        if change.name in (info.name, f"{info.component}.{info.object}")
    )


def change_of(text: str) -> TypedValue:
    """Take NAME=VALUE[UNIT] apart; an `argparse` type."""
    found = _CHANGE.fullmatch(text)
    if found is None:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not NAME=VALUE with a number, as in gait.step_length=0.42 or gait.trunk_angle=3deg"
        )
    return TypedValue(found[1], found[2], found[3])


def value_of(change: TypedValue, description: Description) -> Number:
    """Return the value in the parameter's own unit.

    A whole number as such, so that none of its digits is lost.
    """
    if change.number is None:
        raise UnknownUnit(f"{change.name} has no value")
    if change.unit is None and change.number.lstrip("+-").isdecimal() and len(change.number) <= LONGEST:
        whole = int(change.number)
        if whole in OBJECTS:
            return whole
    si = next(
        info.unit
        for info in description.parameters
        if change.name in (info.name, f"{info.component}.{info.object}")
    )
    try:
        return unit_named(si if change.unit is None else change.unit, si).si_value(change.number)
    except ValueError as error:
        raise UnknownUnit(f"{change.name}: {error}") from error
