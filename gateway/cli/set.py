"""`gwrms set`: parameters changed, all or none."""

import argparse
import contextlib
import math

from gateway.cli.connect import check_names, connect, parameter_names, parser
from gateway.cli.writing import add_trial, write
from gateway.coding import Number

EPILOG = """All changes happen or none: they are checked first, written, read back from the devices, and
taken back if one fails. Somebody else may be the one writer; then nothing is changed and it is said.

With --trial they are taken back by the robot itself after that time, and at once when this command ends in
any way, its terminal, computer or network included. Enter keeps them.

examples:
  gwrms set gait.step_length=0.42 left_knee.max_torque=0.8
  gwrms set --trial 30 gait.cycle_time=1.1"""


def main(argv: list[str]) -> int:
    """Run `gwrms set`."""
    made = parser("set", "Change parameters: all or none, limit-checked, read back.", EPILOG)
    made.add_argument(
        "changes", metavar="NAME=VALUE", nargs="+", type=_change, help="in the parameter's own unit"
    )
    add_trial(made)
    arguments = made.parse_args(argv)
    changes = dict(arguments.changes)
    if len(changes) != len(arguments.changes):
        made.error("a parameter is named twice")
    with connect(arguments, "set") as robot:
        description = robot.describe()
        check_names("parameter", changes, parameter_names(description))
        return write(robot, changes, description, arguments)


def _change(text: str) -> tuple[str, Number]:
    name, equals, number = text.partition("=")
    value = _number(number)
    if not name or not equals or not math.isfinite(value):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not NAME=VALUE with a number, as in gait.step_length=0.42"
        )
    return name, value


def _number(text: str) -> Number:
    """A whole number as such, so that none of its digits is lost; no number is NaN."""
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return math.nan
