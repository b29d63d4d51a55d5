"""`gwrms set --trial`: the wait between trying a change and keeping it."""

import select
import sys
import time

from gateway.cli.text import exact, say, say_json
from gateway.client import RemoteError, Robot
from gateway.wire.framing import ErrorKind
from gateway.wire.parameter import Written

_CHOICE = "Enter keeps it, Ctrl-C takes it back; nobody else can write meanwhile"
LOOK_S = 1.0  # how often the robot is asked whether the trial still stands


def wait_for_decision(robot: Robot, written: Written, *, json: bool) -> int:
    """Keep the trial when a line comes on standard input; 0 when it was kept, 1 when it was taken back."""
    interactive = sys.stdin.isatty() and not json
    if not json:
        say(f"on trial for {exact(written.trial_s)} s: {_CHOICE}\n")
    ends = time.monotonic() + (written.trial_s or 0.0)
    try:
        kept = _wait(robot, written.write, ends, countdown=interactive)
    except KeyboardInterrupt:
        kept = False
    said = _keep(robot, written) if kept else _take_back(robot, written)
    if json:
        say_json({"write": written.write, "kept": kept, "result": said})
    else:
        say(f"{said}\n")
    return 0 if kept else 1


def _keep(robot: Robot, written: Written) -> str:
    values = robot.confirm(written.write).values
    return "kept: " + ", ".join(f"{name} = {exact(value)}" for name, value in values.items())


def _take_back(robot: Robot, written: Written) -> str:
    """Ask for it, so that it is confirmed; the robot may have come first."""
    try:
        outcome = robot.revert(written.write).outcome
    except RemoteError as error:
        if error.kind != ErrorKind.UNKNOWN_NAME:
            raise
        return _ended(error, written)
    before = written.before
    return "; ".join(f"{name} = {exact(before.get(name))}: {what}" for name, what in outcome.items())


def _ended(error: RemoteError, written: Written) -> str:
    """Return how the robot ended it, by parameters' names: a write's number says nothing to a person."""
    how = str(error).partition(" is not on trial: ")[2] or str(error)
    return f"{', '.join(written.before)}: {how}"


def _wait(robot: Robot, write: int, ends: float, *, countdown: bool) -> bool:
    """Return whether it is to be kept. Without anybody to ask, its time runs out."""
    asking = [sys.stdin]
    while (left := ends - time.monotonic()) > 0:
        if countdown:
            sys.stdout.write(f"\r{left:4.0f} s left \r")
            sys.stdout.flush()
        ready, _, _ = select.select(asking, [], [], min(LOOK_S, left))
        if ready:
            if sys.stdin.readline():
                return True
            asking = []  # standard input has ended: nobody is there to keep it
        elif all(trial.write != write for trial in robot.describe().trials):
            return False  # the robot has ended it
    return False
