"""Wearers of the recorded robots, and their consent, on the command line."""

import argparse

from server_gui.core.recording.records import Worn


def add_worn(parser: argparse.ArgumentParser) -> None:
    """Add `--wearer` and `--consent`."""
    parser.add_argument(
        "--wearer",
        default="",
        metavar="ID",
        help="who wears the robots, as a pseudonym of the study; gwrms cloud forget finds them by it",
    )
    parser.add_argument(
        "--consent",
        default="",
        metavar="TEXT",
        help="what the wearer has agreed to, and when or where that is",
    )


def worn(arguments: argparse.Namespace) -> Worn:
    """Return the same."""
    return Worn(arguments.wearer, arguments.consent)
