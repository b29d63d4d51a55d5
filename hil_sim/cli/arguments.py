"""Arguments that several of the commands take."""

import argparse
import math

from hil_sim.exoskeleton import SIDES
from hil_sim.gait.walks import NAMES, ORDINARY


def add_wearer(parser: argparse.ArgumentParser) -> None:
    """Add how the wearer walks, and which legs the robot is on."""
    parser.add_argument(
        "--walks",
        choices=NAMES,
        default=ORDINARY,
        metavar="NAME",
        help=f"how they walk: {', '.join(NAMES)} (default: %(default)s)",
    )
    parser.add_argument(
        "--assists", choices=SIDES, metavar="SIDE", help="the only leg with a robot, left or right"
    )


def speed(text: str) -> float | None:
    """Parse the speed, simulated over real time; `None` for `max`, as fast as possible."""
    if text == "max":
        return None
    value = number(text)
    if not 0.01 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text} is no speed: give a number from 0.01 to 100, or max")
    return value


def seconds(text: str) -> float:
    """Return a time greater than 0."""
    value = number(text)
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text} is no time: give seconds greater than 0")
    return value


def number(text: str) -> float:
    """NaN, which lies in no range, where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
