"""Plain text on standard output, unbuffered."""

import sys

from gateway.plain_text import plain


def print_line(text: str) -> None:
    """Print a line and flush it, also into a pipe."""
    sys.stdout.write(plain(text, "\n") + "\n")
    sys.stdout.flush()
