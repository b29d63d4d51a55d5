"""Private files, for data about a wearer's body: mode 0600, in folders 0700."""

import os
import stat
from pathlib import Path
from typing import Final

FOLDER: Final = 0o700
FILE: Final = 0o600
_OTHERS: Final = 0o077


def private_files() -> None:
    """Whatever this process makes from now on is its user's alone, also what libraries make."""
    os.umask(_OTHERS)


def private_folder(folder: Path) -> None:
    """Make a folder, and those above it that are missing, for its owner alone; one that is there stays."""
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    for each in reversed(missing):
        each.mkdir(FOLDER, exist_ok=True)


def closed_folder(folder: Path) -> None:
    """Make the folder, and close an existing one of ours to others."""
    private_folder(folder)
    found = folder.stat()
    if found.st_uid == os.geteuid() and stat.S_IMODE(found.st_mode) & _OTHERS:
        folder.chmod(FOLDER)


def opener(name: str, flags: int) -> int:
    """Open a file for `open`: a new one is its owner's alone, and a link is not followed."""
    return os.open(name, flags | os.O_NOFOLLOW | os.O_CLOEXEC, FILE)
