"""What `gwrms store` and `gwrms restore` share: the device that is named, and what it has done."""

import argparse

from gateway.cli.connect import parser
from gateway.cli.text import say, say_json
from gateway.wire.parameter import Stored


def device_parser(command: str, what: str, epilog: str) -> argparse.ArgumentParser:
    """Make the parser of a command for one device."""
    made = parser(command, what, epilog)
    made.add_argument("component", metavar="COMPONENT", help="a joint or device, such as left_knee")
    return made


def say_stored(stored: Stored, *, json: bool) -> None:
    """Print what the device has done."""
    say_json(stored) if json else say(f"{stored.component}: {stored.result}\n")
