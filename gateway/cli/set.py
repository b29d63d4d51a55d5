"""`gwrms set`: parameters changed, all or none."""

import argparse
import re
from dataclasses import dataclass
from typing import Final

from gateway.cli.connect import check_names, connect, parameter_names, parser
from gateway.cli.writing import add_trial, write
from gateway.client import ClientError
from gateway.coding import Number
from gateway.units import unit_named
from gateway.wire.robot import Description

EPILOG = """All changes happen or none: they are checked first, written, read back from the devices, and
taken back if one fails. Where somebody else has control nothing is changed, and that
is said.

With --trial they are taken back by the robot itself after that time, and at once when this command ends in
any way, its terminal, computer or network included. Enter keeps them.

examples:
  gwrms set gait.step_length=0.42 left_knee.max_torque=40
  gwrms set gait.trunk_angle=3deg gait.step_length=420mm
  gwrms set --trial 30 gait.cycle_time=1.1"""


OBJECTS: Final = range(-(2**63), 2**64)  # what a device's object can hold
LONGEST: Final = 20  # of such a number, with its sign


class UnknownUnit(ClientError):
    """A value is no number that there can be, or in a unit that its parameter cannot be in."""


_CHANGE: Final = re.compile(r"([^=]+)=([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?) ?([^\d\s.,].*)?")


@dataclass(frozen=True, slots=True)
class Change:
    """What was typed: a number as it stands, and its unit, where one was given."""

    name: str
    number: str
    unit: str | None


def main(argv: list[str]) -> int:
    """Run `gwrms set`."""
    made = parser("set", "Change parameters: all or none, limit-checked, read back.", EPILOG)
    made.add_argument(
        "changes",
        metavar="NAME=VALUE[UNIT]",
        nargs="+",
        type=change_of,
        help="in the parameter's own unit, or in another: 3deg, 420mm, 30rpm",
    )
    add_trial(made)
    arguments = made.parse_args(argv)
    if len({change.name for change in arguments.changes}) != len(arguments.changes):
        made.error("a parameter is named twice")
    with connect(arguments, "set") as robot:
        description = robot.describe()
        check_names("parameter", [each.name for each in arguments.changes], parameter_names(description))
        changes = {each.name: value_of(each, description) for each in arguments.changes}
        return write(robot, changes, description, arguments)


def change_of(text: str) -> Change:
    """Take NAME=VALUE[UNIT] apart; an `argparse` type."""
    found = _CHANGE.fullmatch(text)
    if found is None:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not NAME=VALUE with a number, as in gait.step_length=0.42 or gait.trunk_angle=3deg"
        )
    return Change(found[1], found[2], found[3])


def value_of(change: Change, description: Description) -> Number:
    """The value in the parameter's own unit; a whole number as such, so that none of its digits is lost."""
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
