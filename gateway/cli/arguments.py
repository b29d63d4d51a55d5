"""Types of command-line options, which check values as they are parsed."""

import argparse
import math

MOST_S = 86_400.0


def number(text: str) -> float:
    """NaN, which lies in no range, where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def seconds(text: str) -> float:
    """Parse a duration."""
    value = number(text)
    if not 0.1 <= value <= MOST_S:
        raise argparse.ArgumentTypeError(f"{text!r} is no time from 0.1 to {MOST_S:.0f} s")
    return value


def lines(text: str) -> int:
    """Parse a number of lines."""
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of lines")
    return int(text)
