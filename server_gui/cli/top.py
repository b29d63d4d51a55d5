"""`gwrms top`: one robot in the terminal, live; its parameters changed, stopped, reset."""

import argparse
import contextlib
import math
import sys
import time
from typing import TYPE_CHECKING, Final

from gateway.cli.arguments import seconds
from gateway.cli.connect import add_robot
from gateway.cli.text import warn
from server_gui.core.tuning.stop import StopProgress, StopState

if TYPE_CHECKING:
    from server_gui.core.settings.server_file import ServerSettings

EPILOG: Final = """keys
  s, space     STOP: quick stop on every drive (software, not safety-rated)
  r r          end a held stop and clear faults, pressed twice: every drive is switched off, none
               is enabled
  ↑ ↓          choose a parameter
  ← →          lower or raise it; the lease is held only while it is written
  q            end

Actions that your role does not permit are grey, with the reason below; everybody may STOP.
Angles are in degrees and lengths in millimetres, as in the window. Old values are grey, with their
age. q waits for the outcome of a STOP.
If a window on this computer records the robot, and a model learned from its wearer serves or is
being tried, a line says so, and since when.
With danger = true in [prediction] of the server's file, danger is foreseen as in the window.
Without a terminal, use gwrms watch and gwrms describe.

exit status
  0 ended by q or after --seconds; 1 it cannot be shown, or the last STOP is NOT CONFIRMED;
  130, 143 ended by Ctrl-C, SIGTERM"""


def main(argv: list[str]) -> int:
    """Run `gwrms top`."""
    arguments = _parser().parse_args(argv)
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        sys.stderr.write("gwrms top: this is no terminal; gwrms watch and gwrms describe need none\n")
        return 1
    from server_gui.processes.shutdown_signals import ShutdownRequested, ShutdownSignals
    from server_gui.terminal.adapted_models import Learned
    from server_gui.terminal.controls import Controls
    from server_gui.terminal.dashboard import Dashboard
    from server_gui.terminal.followed_robot import EVERY_PARAMETER, FollowedRobot

    settings = _settings()
    ends_s = math.inf if arguments.seconds is None else time.monotonic() + arguments.seconds
    followed_robot = FollowedRobot(arguments.robot, EVERY_PARAMETER, foresees=_foresees(settings))
    learned = None if settings is None else Learned(settings.recorder.spool)
    with ShutdownSignals() as ending, followed_robot as followed, learned or contextlib.nullcontext():

        def tick() -> bool:
            ending.check()
            followed.update()
            if learned is not None:
                learned.look(followed.station)
            return time.monotonic() < ends_s

        try:
            Dashboard(followed.station, Controls(followed.station), str(arguments.robot)).run(tick)
        except ShutdownRequested as ended:
            _tell(followed.station.stopping)
            return ended.status
        return _tell(followed.station.stopping)


def _settings() -> "ServerSettings | None":
    """Return the settings of the server's file; None, with a warning, if it cannot be read."""
    from server_gui.core.settings.server_file import SettingsError, load

    try:
        return load()
    except SettingsError as error:
        warn("top", f"danger is not foreseen: {error}")
        return None


def _foresees(settings: "ServerSettings | None") -> bool:
    """Return whether the server's file wants danger foreseen."""
    return settings is not None and settings.prediction.enabled and settings.prediction.danger


def _tell(stopping: StopProgress) -> int:
    """Say it where nothing has confirmed the last STOP: the screen that did is gone. Return 1 then."""
    if stopping.state is StopState.SENT:
        warn("top", "STOP NOT CONFIRMED: nobody has answered yet. Use the hardware stop")
    elif stopping.state is StopState.NOT_CONFIRMED:
        warn("top", stopping.text)
    return int(stopping.state in (StopState.SENT, StopState.NOT_CONFIRMED))


def _parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="gwrms top",
        description="Show one robot live in the terminal: joints, feet, trunk, parameters and computer.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_robot(made)
    made.add_argument("--seconds", type=seconds, metavar="N", help="end after N seconds")
    return made
