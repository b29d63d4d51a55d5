"""`gwrms sim run`: scenario files as tests."""

import argparse
import json
import signal
import sys
import tempfile
import time
from collections.abc import Collection
from contextlib import ExitStack
from pathlib import Path

from hil_sim.cli.arguments import speed
from hil_sim.errors import SimulatorError
from hil_sim.scenario import records, report
from hil_sim.scenario.expectation import ScenarioResult
from hil_sim.scenario.records import Ran
from hil_sim.scenario.runner import run
from hil_sim.scenario.script import Script, load
from hil_sim.scenario.shipped import locate, shipped
from hil_sim.scenario.table import ScenarioError

_DESCRIPTION = """\
Run scenario files: each with a simulated robot and a gateway of its own, as a process. The files' events
happen to the robot, and their expectations of the gateway and of the robot are checked at the end.
"""

_EPILOG = f"""\
A failed expectation is inconclusive if this computer was too slow to judge it: if, since the last event, the
simulator was late and the gateway waited for a processor by more than a tenth of the expectation's window, or
0.2 s. An expectation that was met stays met.

exit status: 0 all expectations are met; 1 one is not, or it could not be run; 2 wrong usage, or a file that
is no scenario; 3 nothing failed, but something is inconclusive. gwrms docs scenarios explains how to write
one.

shipped scenarios, found by their names
  {", ".join(shipped())}

examples
  gwrms sim run node_lost
  gwrms sim run --junit results.xml *.toml
  pytest --gwrms .
"""

_INCONCLUSIVE = 3
_TERMINATED = 128 + signal.SIGTERM  # as a shell says it; robot and gateway are ended on the way


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms sim run",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="a scenario file, or the name of a shipped one"
    )
    parser.add_argument(
        "--dir",
        type=Path,
        metavar="DIR",
        help="folder for the robot and gateway.log; an existing robot.toml is used (default: a new folder)",
    )
    parser.add_argument(
        "--speed",
        type=speed,
        default=1.0,
        metavar="N",
        help="speed of the robot; the gateway stays in real time (default: 1)",
    )
    parser.add_argument(
        "--junit",
        type=Path,
        metavar="FILE.xml",
        help="write the results as JUnit XML, for CI systems",
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object per scenario, a line each, and a total"
    )
    return parser


def main(argv: list[str]) -> int:
    """Run every file; returns the exit status."""
    try:
        arguments = _parser().parse_args(argv)
    except SystemExit as leave:
        return 2 if leave.code else 0
    try:
        scripts = [(file, load(locate(file))) for file in arguments.files]
    except ScenarioError as error:
        sys.stderr.write(f"gwrms sim run: {error}\n")
        return 2
    if arguments.junit is not None:
        _try_to_write(arguments.junit)
    before = signal.signal(signal.SIGTERM, lambda _signal, _frame: sys.exit(_TERMINATED))
    try:
        runs = [_run(file, script, arguments) for file, script in scripts]
    finally:
        signal.signal(signal.SIGTERM, before)
    results = [ran.outcome.result for ran in runs]
    sys.stdout.write(
        json.dumps(records.total_as_json(results)) + "\n" if arguments.json else report.total(results)
    )
    if arguments.junit is not None:
        _write(arguments.junit, records.junit(runs))
    return _status(results)


def _run(file: Path, script: Script, arguments: argparse.Namespace) -> Ran:
    """Run one, and print what came of it; at once which, for it takes its time."""
    began_s = time.time()
    if not arguments.json:
        _say(report.head(file, script))
    with ExitStack() as stack:
        folder = arguments.dir or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="gwrms-")))
        ran = Ran(file, script, run(script, folder, arguments.speed), began_s)
    if ran.outcome.problem:
        sys.stderr.write(f"gwrms sim run: {file}: {ran.outcome.problem}\n")
    told = json.dumps(records.as_json(ran), ensure_ascii=False) + "\n"
    _say(told if arguments.json else report.result(ran.outcome))
    return ran


def _say(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


def _try_to_write(file: Path) -> None:
    """Minutes before there is something to write; what is there stays until then."""
    was_there = file.exists()
    try:
        with file.open("ab"):
            pass
        if not was_there:
            file.unlink()
    except OSError as error:
        raise SimulatorError(
            f"{file} cannot be written, so nothing was run: {error.strerror}; name another file for --junit"
        ) from error


def _write(file: Path, content: bytes) -> None:
    try:
        file.write_bytes(content)
    except OSError as error:
        raise SimulatorError(f"{file} cannot be written: {error.strerror}") from error


def _status(results: Collection[ScenarioResult]) -> int:
    if {ScenarioResult.FAILED, ScenarioResult.NOT_RUN} & set(results):
        return 1
    return _INCONCLUSIVE if ScenarioResult.INCONCLUSIVE in results else 0
