"""Arguments that several of the commands take."""

import argparse
import math


def speed(text: str) -> float | None:
    """Simulated over real time; `None` for `max`, as fast as it goes."""
    if text == "max":
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.01 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text} is no speed: give a number from 0.01 to 100, or max")
    return value


def seconds(text: str) -> float:
    """A time greater than 0."""
    value = float(text)
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text} is no time: give seconds greater than 0")
    return value
