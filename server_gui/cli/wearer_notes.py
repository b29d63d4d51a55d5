"""Wearers of the recorded robots, and their consent, on the command line."""

import argparse

from server_gui.core.recording.records import Worn


def add_worn(parser: argparse.ArgumentParser) -> None:
    """Add `--wearer` and `--consent`."""
    parser.add_argument(
        "--wearer",
        default="",
        metavar="ID",
        help="the wearer's pseudonym in the study, by which gwrms cloud forget finds the data",
    )
    parser.add_argument(
        "--consent",
        default="",
        metavar="TEXT",
        help="the wearer's consent, with its date or reference",
    )


def worn(arguments: argparse.Namespace) -> Worn:
    """Return the same."""
    return Worn(arguments.wearer, arguments.consent)
