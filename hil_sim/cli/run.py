"""`gwrms sim run`: scenario files as tests."""

import argparse
import signal
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from hil_sim.cli.arguments import speed
from hil_sim.scenario import report
from hil_sim.scenario.runner import run
from hil_sim.scenario.script import Script, load
from hil_sim.scenario.shipped import locate, shipped
from hil_sim.scenario.table import ScenarioError

_DESCRIPTION = """\
Runs scenario files: each with a simulated robot and a gateway of its own, as a process. What the files say
happens to the robot, and what they expect of the gateway and of the robot is checked at the end.
"""

_EPILOG = f"""\
exit codes: 0 all that was expected is so; 1 something is not, or it could not be run; 2 wrong usage, or a
file that is no scenario. gwrms docs bench tells how to write one.

scenarios that ship, found by their names
  {", ".join(shipped())}

example
  gwrms sim run node_lost
"""


_TERMINATED = 128 + signal.SIGTERM  # as a shell says it; robot and gateway are ended on the way


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms sim run",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="a scenario, or one that ships, by name"
    )
    parser.add_argument(
        "--dir",
        type=Path,
        metavar="DIR",
        help="of the robot and of gateway.log; a robot.toml there is used (default: a new one)",
    )
    parser.add_argument(
        "--speed",
        type=speed,
        default=1.0,
        metavar="N",
        help="of the robot; the gateway's own patience stays in real time (default: 1)",
    )
    return parser


def main(argv: list[str]) -> int:
    """Run every file; returns the exit code."""
    try:
        arguments = _parser().parse_args(argv)
    except SystemExit as leave:
        return 2 if leave.code else 0
    try:
        scripts = [load(locate(file)) for file in arguments.files]
    except ScenarioError as error:
        sys.stderr.write(f"gwrms sim run: {error}\n")
        return 2
    before = signal.signal(signal.SIGTERM, lambda _signal, _frame: sys.exit(_TERMINATED))
    try:
        held = [_holds(script, arguments) for script in scripts]
    finally:
        signal.signal(signal.SIGTERM, before)
    return 0 if all(held) else 1


def _holds(script: Script, arguments: argparse.Namespace) -> bool:
    """Run one, and print what came of it."""
    with ExitStack() as stack:
        folder = arguments.dir or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="gwrms-")))
        outcome = run(script, folder, arguments.speed)
    sys.stdout.write(report.text(script, outcome))
    sys.stdout.flush()
    return outcome.ok
