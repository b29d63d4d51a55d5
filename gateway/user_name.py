"""The account that this process runs as."""

import getpass
import os


def user_name() -> str:
    """Return the user's name; the account's number where it has none, as in containers."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())
