"""A line of plain text on standard output, at once."""

import sys

from gateway.plain import plain


def say(text: str) -> None:
    """Print a line at once, also into a pipe."""
    sys.stdout.write(plain(text, "\n") + "\n")
    sys.stdout.flush()
