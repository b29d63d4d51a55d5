"""`gwrms params`: a robot's parameters saved as a file, compared with one, and set to one."""

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from gateway.amounts import counted
from gateway.cli.connect import ask, check_names, choose, connect, parameter_names, parser
from gateway.cli.text import exact, say, say_json, table, warn
from gateway.cli.writing import add_trial, write
from gateway.client import Robot
from gateway.coding import Number
from gateway.parameter_files.comparison import (
    CANNOT_CHANGE,
    REFUSED,
    UNLIKE,
    ComparisonVerdict,
    Row,
    compare,
    left_out,
)
from gateway.parameter_files.contents import FileProblem, Scope
from gateway.parameter_files.formats import format_of, read_file
from gateway.records import durable
from gateway.wire.framing import encode_request
from gateway.wire.limits import LINE_LIMIT
from gateway.wire.parameter import PARAMETER_WRITE, ParameterValue, ParameterWriteParams

USAGE = """\
usage: gwrms params COMMAND FILE …

  save FILE [GLOB ...]   save the present parameters of the devices
  compare FILE           compare the file with the robot's parameters
  apply FILE             set the robot's parameters to those of the file, all or none; asks first

A .toml file holds parameters of a whole robot, a .dcf file (CiA 306) all of one device.
gwrms params COMMAND --help says more.
"""

SAVE_EPILOG = """A .toml file contains the changeable parameters, by name, in the units of the robot's file.
A .dcf file is made from the device's EDS and contains all of its writable objects except commands.
Exit status 1 if a device did not give a value: the file is written without it.

examples:
  gwrms params save monday.toml
  gwrms params save gait.toml 'gait.*'
  gwrms params save left_knee.dcf --component left_knee --eds my_drive.eds"""

COMPARE_EPILOG = """Values are the same if the device would store the same bytes for both.
Parameters that the file does not name are ignored.

exit status, as of diff(1)
  0  the robot holds all values of the file
  1  something is different, or the robot does not have it
  2  nothing was compared: no gateway, a file that cannot be read, wrong usage

example:
  gwrms params compare monday.toml"""

APPLY_EPILOG = """Shows the differences, asks, and writes all of them or none, read back. If anything in the
file cannot be applied, nothing is written.

examples:
  gwrms params apply monday.toml
  gwrms params apply monday.toml --trial 60
  gwrms params apply left_knee.dcf --component right_knee --skip"""

_AT_ONCE = 16  # parameters asked in one request: a device that stops answering costs no more than these


def main(argv: list[str]) -> int:
    """Run `gwrms params`."""
    return choose(argv, {"save": save, "compare": compare_, "apply": apply}, USAGE)


def save(argv: list[str]) -> int:
    """Run `gwrms params save`."""
    made = _parser("save", "Save the present parameters of the devices.", SAVE_EPILOG)
    made.add_argument("globs", metavar="GLOB", nargs="*", help="names or globs of the parameters")
    made.add_argument("--eds", type=Path, metavar="EDS", help="the device's file, to make a DCF from")
    made.add_argument("--overwrite", action="store_true", help="replace an existing file")
    arguments = made.parse_args(argv)
    file: Path = arguments.file
    kind = format_of(file)
    if file.exists() and not arguments.overwrite:
        raise FileProblem(f"{file} is there already; say --overwrite, or give another name")
    with connect(arguments, "params") as robot:
        scope = Scope(robot.describe(), arguments.component, arguments.eds)
        check_names("parameter", arguments.globs, parameter_names(scope.robot))
        held = _read(robot, [info.name for info in kind.chosen(scope, arguments.globs)])
    values = {name: one.value for name, one in held.items() if one.value is not None}
    if not values:
        raise FileProblem(f"{file}: there is nothing to save; gwrms get shows what can be read")
    durable.write(file, kind.write(file, scope, values))
    problems = {name: one.problem or "not known" for name, one in held.items() if one.value is None}
    _say_saved(file, len(values), problems, json=arguments.json)
    return 1 if problems else 0


def compare_(argv: list[str]) -> int:
    """Run `gwrms params compare`."""
    made = _parser("compare", "Compare a file with the robot's parameters.", COMPARE_EPILOG)
    arguments = made.parse_args(argv)
    with connect(arguments, "params") as robot:
        rows = _rows(robot, Scope(robot.describe(), arguments.component), arguments.file)
    same = all(row.verdict not in UNLIKE for row in rows)
    if arguments.json:
        say_json({"same": same, "rows": rows})
    else:
        say(_table(rows) + _summary(rows))
    return 0 if same else 1


def apply(argv: list[str]) -> int:
    """Run `gwrms params apply`."""
    made = _parser("apply", "Set a robot's parameters to those of a file, all or none.", APPLY_EPILOG)
    made.add_argument("--yes", action="store_true", help="do not ask for confirmation")
    made.add_argument("--skip", action="store_true", help="skip parameters that cannot be changed")
    add_trial(made)
    arguments = made.parse_args(argv)
    with connect(arguments, "params") as robot:
        scope = Scope(robot.describe(), arguments.component)
        rows = _rows(robot, scope, arguments.file)
        _say_unlike(rows, json=arguments.json)
        changes = _changes(rows, arguments.file, skip=arguments.skip)
        if not changes:
            return 0
        if not ask(f"Write {counted(len(changes), 'parameter')}?", yes=arguments.yes):
            warn("params", "nothing was written")
            return 1
        return write(robot, changes, scope.robot, arguments)


def _parser(command: str, what: str, epilog: str) -> argparse.ArgumentParser:
    made = parser(f"params {command}", what, epilog)
    made.add_argument("file", metavar="FILE", type=Path, help="a .toml or .dcf file")
    made.add_argument("--component", metavar="NAME", help="one joint or device, such as left_knee")
    return made


def _read(robot: Robot, names: Sequence[str]) -> dict[str, ParameterValue]:
    """Return it as the devices hold them now, a few at a time."""
    held: dict[str, ParameterValue] = {}
    for start in range(0, len(names), _AT_ONCE):
        held |= robot.read(*names[start : start + _AT_ONCE]).values
    return held


def _rows(robot: Robot, scope: Scope, file: Path) -> list[Row]:
    saved = read_file(file, scope)
    for remark in saved.remarks:
        warn("params", f"{file}: {remark}")
    infos = {info.name: info for info in scope.robot.parameters}
    asked = [infos[name] for name in saved.values if name in infos] + left_out(saved.values, infos.values())
    held = _read(robot, [info.name for info in asked if info.problem is None])
    return compare(saved.values, infos, held)


def _changes(rows: Iterable[Row], file: Path, *, skip: bool) -> dict[str, Number]:
    """Return the values to be written; raises `FileProblem` if the robot cannot be made equal to the file."""
    found = Counter(row.verdict for row in rows)
    refused = sum(found[verdict] for verdict in REFUSED)
    if refused:
        raise FileProblem(f"{file}: nothing was sent, the robot would refuse {counted(refused, 'value')}")
    fixed = sum(found[verdict] for verdict in CANNOT_CHANGE)
    if fixed and not skip:
        raise FileProblem(
            f"{file}: nothing was sent, {counted(fixed, 'value')} cannot be changed; --skip leaves them out"
        )
    changes = {
        row.name: row.file
        for row in rows
        if row.verdict is ComparisonVerdict.DIFFERENT and row.file is not None
    }
    size = len(encode_request(0, PARAMETER_WRITE.name, ParameterWriteParams(changes))) if changes else 0
    if size > LINE_LIMIT:
        raise FileProblem(
            f"{file}: nothing was sent, {counted(len(changes), 'change')} are too many for one request "
            f"({size / 1024:.0f} of {LINE_LIMIT // 1024} KiB): divide the file"
        )
    return changes


# What is printed


def _say_saved(file: Path, count: int, problems: Mapping[str, str], *, json: bool) -> None:
    for name, problem in problems.items():
        warn("params", f"{name} is not in {file}: {problem}")
    if json:
        say_json({"file": str(file), "saved": count, "problems": problems})
    else:
        say(f"{file}: {counted(count, 'parameter')}\n")


def _say_unlike(rows: Sequence[Row], *, json: bool) -> None:
    unlike = [row for row in rows if row.verdict in UNLIKE]
    if json:
        say_json({"rows": unlike})
    elif unlike:
        say(_table(unlike) + _summary(rows))
    else:
        say("the robot holds all values of the file\n")


def _table(rows: Iterable[Row]) -> str:
    lines = [
        (row.name, exact(row.robot), exact(row.file), row.unit, f"{row.verdict}{row.why and f': {row.why}'}")
        for row in rows
    ]
    return table(("PARAMETER", "ROBOT", "FILE", "UNIT", ""), lines, right=(1, 2))


def _summary(rows: Iterable[Row]) -> str:
    found = Counter(row.verdict for row in rows)
    return ", ".join(f"{found[verdict]} {verdict}" for verdict in ComparisonVerdict if found[verdict]) + "\n"
