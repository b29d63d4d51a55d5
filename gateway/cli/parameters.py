"""`gwrms get` and `gwrms set`: parameters, as the devices hold them."""

import argparse
import math

from gateway.cli.reach import check_names, parameter_names, parser, reach
from gateway.cli.text import exact, say, say_json, table
from gateway.messages import Description, Written

SET_EPILOG = """All changes happen or none: they are checked first, written, read back from the devices, and
taken back if one fails. Somebody else may be the one writer; then nothing is changed and it is said.

example:
  gwrms set gait.step_length=0.42 left_knee.max_torque=0.8"""


def get(argv: list[str]) -> int:
    """Run `gwrms get`."""
    made = parser("get", "Read parameters from the devices, now.", "example:\n  gwrms get 'gait.*'")
    made.add_argument("names", metavar="GLOB", nargs="*", help="names or globs (default: all)")
    arguments = made.parse_args(argv)
    with reach(arguments, "get") as robot:
        check_names("parameter", arguments.names, parameter_names(robot.describe()))
        values = robot.read(*arguments.names).values
    if arguments.json:
        say_json({"values": values})
    else:
        rows = [
            (name, exact(held.value), held.unit, f"{exact(held.min)} … {exact(held.max)}", held.problem or "")
            for name, held in values.items()
        ]
        say(table(("PARAMETER", "VALUE", "UNIT", "RANGE", "PROBLEM"), rows, right=(1,)))
    return 1 if any(held.value is None for held in values.values()) else 0


def set_(argv: list[str]) -> int:
    """Run `gwrms set`."""
    made = parser("set", "Change parameters: all or none, limit-checked, read back.", SET_EPILOG)
    made.add_argument(
        "changes", metavar="NAME=VALUE", nargs="+", type=_change, help="in the parameter's own unit"
    )
    arguments = made.parse_args(argv)
    changes = dict(arguments.changes)
    if len(changes) != len(arguments.changes):
        made.error("a parameter is named twice")
    with reach(arguments, "set") as robot:
        description = robot.describe()
        check_names("parameter", changes, parameter_names(description))
        written = robot.write(changes)
    if arguments.json:
        say_json(written)
    else:
        say(_written_text(written, description))
    return 0


def _change(text: str) -> tuple[str, float]:
    name, equals, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not name or not equals or not math.isfinite(value):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not NAME=VALUE with a number, as in gait.step_length=0.42"
        )
    return name, value


def _written_text(written: Written, description: Description) -> str:
    units = {parameter.name: parameter.unit for parameter in description.parameters}
    rows = [
        (name, exact(written.before.get(name)), "→", exact(after), units.get(name, ""), "read back")
        for name, after in written.after.items()
    ]
    return table(("PARAMETER", "BEFORE", "", "AFTER", "UNIT", ""), rows, right=(1, 3))
