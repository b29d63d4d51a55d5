"""The common part of `gwrms store` and `gwrms restore`: the named device, and its result."""

import argparse

from gateway.cli.connect import parser
from gateway.cli.text import say, say_json
from gateway.wire.parameter import Stored


def device_parser(command: str, what: str, epilog: str) -> argparse.ArgumentParser:
    """Make the parser of a command for one device."""
    made = parser(command, what, epilog)
    add_component(made)
    return made


def add_component(made: argparse.ArgumentParser, nargs: str | None = None) -> None:
    """Add the argument that names the device."""
    made.add_argument(
        "component", metavar="COMPONENT", nargs=nargs, help="a joint or device, such as left_knee"
    )


def say_stored(stored: Stored, *, json: bool) -> None:
    """Print the device's result."""
    say_json(stored) if json else say(f"{stored.component}: {stored.result}\n")
