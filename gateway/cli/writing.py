"""The common part of `gwrms set` and `gwrms params apply`: a write, permanent or on trial, and its result."""

import argparse
from collections.abc import Mapping

from gateway.cli.arguments import number
from gateway.cli.text import exact, say, say_json, table
from gateway.cli.trial import wait_for_decision
from gateway.client import Robot
from gateway.coding import Number
from gateway.wire.parameter import Written
from gateway.wire.robot import Description

LONGEST_TRIAL_S = 300.0


def add_trial(made: argparse.ArgumentParser) -> None:
    """Add the option `--trial`, which `write` heeds."""
    made.add_argument(
        "--trial",
        metavar="S",
        type=_trial_s,
        help="write on trial for S seconds (at most 300); exit status 0 if kept",
    )


def write(
    robot: Robot, changes: Mapping[str, Number], description: Description, arguments: argparse.Namespace
) -> int:
    """Write all or none, and say what came of it; 1 where it was on trial and was not kept."""
    if arguments.trial is None:
        _say_written(robot.write(changes), description, json=arguments.json)
        return 0
    with robot.trial(changes, arguments.trial) as written:
        _say_written(written, description, json=arguments.json)
        return wait_for_decision(robot, written, json=arguments.json)


def _trial_s(text: str) -> float:
    seconds = number(text)
    if not 0 < seconds <= LONGEST_TRIAL_S:
        raise argparse.ArgumentTypeError(f"{text!r} is no time for a trial: more than 0, at most 300 seconds")
    return seconds


def _say_written(written: Written, description: Description, *, json: bool) -> None:
    if json:
        say_json(written)
    else:
        say(_written_text(written, description))


def _written_text(written: Written, description: Description) -> str:
    units = {parameter.name: parameter.unit for parameter in description.parameters}
    rows = [
        (name, exact(written.before.get(name)), "→", exact(after), units.get(name, ""), "read back")
        for name, after in written.after.items()
    ]
    return table(("PARAMETER", "BEFORE", "", "AFTER", "UNIT", ""), rows, right=(1, 3))
