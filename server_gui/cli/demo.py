"""The server's commands. What needs rich is imported only when a command runs."""

import argparse
import math
import sys
from pathlib import Path

from server_gui.qt_needs import can_open

EPILOG = """If there is a display, the view is the window (gwrms gui --help); otherwise it is in the terminal.

keys in the terminal
  s, space     STOP: quick stop on every drive (software, not safety-rated)
  r r          end a held stop, pressed twice: every drive is switched off, none is enabled
  ↑ ↓          choose a parameter
  ← →          lower or raise it; the lease is held only while it is written
  q            end the view, the gateway and the simulator

From another terminal, with the address in the title line:
  gwrms set --robot HOST:PORT gait.step_length=0.5

exit status
  0 done; 1 a part failed, or (headless) the robot did not walk; 2 usage; 130, 143 ended by Ctrl-C, SIGTERM"""


def demo(argv: list[str]) -> int:
    """Run `gwrms demo`."""
    arguments = _parser().parse_args(argv)
    from server_gui.terminal.demo import Options, run

    window = not (arguments.headless or arguments.terminal or arguments.picture) and can_open()
    screen = sys.stdout.isatty() and sys.stdin.isatty()
    if not (screen or window or arguments.headless):
        sys.stderr.write("gwrms demo: this is no terminal, so the run is headless\n")
    return run(
        Options(
            window=window,
            headless=arguments.headless or not screen,
            seconds=arguments.seconds,
            folder=arguments.dir,
            scenario=arguments.scenario,
            picture=arguments.picture,
        )
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms demo",
        description="Start a simulated exoskeleton, its gateway and a live view.\n"
        "Simulator and gateway are processes of their own; all three end together.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--headless",
        action="store_true",
        help="no screen: print a line per second, and a summary table at the end",
    )
    parser.add_argument("--terminal", action="store_true", help="use the terminal even with a display")
    parser.add_argument("--seconds", type=_seconds, metavar="N", help="end after N seconds")
    parser.add_argument(
        "--dir", type=Path, help="keep the simulated robot's files here (default: a temporary folder)"
    )
    parser.add_argument("--scenario", choices=("walk", "stand", "sit"), default="walk", help="default: walk")
    parser.add_argument("--picture", type=Path, metavar="FILE.svg", help="save the last frame of the view")
    return parser


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not (math.isfinite(seconds) and seconds > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds above 0")
    return seconds
