"""`gwrms get` and `gwrms set`: parameters, as the devices hold them."""

import argparse
import contextlib
import math

from gateway.cli.reach import check_names, parameter_names, parser, reach
from gateway.cli.text import exact, say, say_json, table
from gateway.cli.trial import wait_for_decision
from gateway.coding import Number
from gateway.wire.messages import Description, ParameterInfo, ParameterValue, Written

LONGEST_TRIAL_S = 300.0

GET_EPILOG = """examples:
  gwrms get 'gait.*'
  gwrms get 'left_knee.*'            with parameters = "eds" all that its EDS lets write, read-only or not
  gwrms get left_knee.0x6072:0       by its address in the device"""

SET_EPILOG = """All changes happen or none: they are checked first, written, read back from the devices, and
taken back if one fails. Somebody else may be the one writer; then nothing is changed and it is said.

With --trial they are taken back by the robot itself after that time, and at once when this command ends in
any way, its terminal, computer or network included. Enter keeps them.

examples:
  gwrms set gait.step_length=0.42 left_knee.max_torque=0.8
  gwrms set --trial 30 gait.cycle_time=1.1"""


def get(argv: list[str]) -> int:
    """Run `gwrms get`."""
    made = parser("get", "Read parameters from the devices, now.", GET_EPILOG)
    made.add_argument(
        "names",
        metavar="GLOB",
        nargs="*",
        help="names, addresses or globs (default: all that can be changed)",
    )
    arguments = made.parse_args(argv)
    with reach(arguments, "get") as robot:
        description = robot.describe()
        check_names("parameter", arguments.names, parameter_names(description))
        values = robot.read(*arguments.names).values
    if arguments.json:
        say_json({"values": values})
    else:
        infos = {info.name: info for info in description.parameters}
        rows = [_held_row(infos[name], held) for name, held in values.items()]
        say(table(("PARAMETER", "VALUE", "UNIT", "RANGE", ""), rows, right=(1,)))
    return 1 if any(held.value is None for held in values.values()) else 0


def _held_row(info: ParameterInfo, held: ParameterValue) -> tuple[str, ...]:
    read_only = f"read-only: {info.read_only}" if info.read_only else ""
    bounds = f"{exact(held.min)} … {exact(held.max)}"
    return info.name, exact(held.value), held.unit, bounds, held.problem or read_only


def set_(argv: list[str]) -> int:
    """Run `gwrms set`."""
    made = parser("set", "Change parameters: all or none, limit-checked, read back.", SET_EPILOG)
    made.add_argument(
        "changes", metavar="NAME=VALUE", nargs="+", type=_change, help="in the parameter's own unit"
    )
    made.add_argument(
        "--trial",
        metavar="S",
        type=trial_s,
        help="try it for S seconds (at most 300); exit status 0 if kept",
    )
    arguments = made.parse_args(argv)
    changes = dict(arguments.changes)
    if len(changes) != len(arguments.changes):
        made.error("a parameter is named twice")
    with reach(arguments, "set") as robot:
        description = robot.describe()
        check_names("parameter", changes, parameter_names(description))
        if arguments.trial is None:
            say_written(robot.write(changes), description, json=arguments.json)
            return 0
        with robot.trial(changes, arguments.trial) as written:
            say_written(written, description, json=arguments.json)
            return wait_for_decision(robot, written, json=arguments.json)


def say_written(written: Written, description: Description, *, json: bool) -> None:
    """What a write came to."""
    if json:
        say_json(written)
    else:
        say(_written_text(written, description))


def trial_s(text: str) -> float:
    """A time for a trial, as an argument."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds <= LONGEST_TRIAL_S:
        raise argparse.ArgumentTypeError(f"{text!r} is no time for a trial: more than 0, at most 300 seconds")
    return seconds


def _number(text: str) -> Number:
    """A whole number as such, so that none of its digits is lost; no number is NaN."""
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return math.nan


def _change(text: str) -> tuple[str, Number]:
    name, equals, number = text.partition("=")
    value = _number(number)
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
