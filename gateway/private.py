"""What keeps a key or a code within one account: no dump of the process has it, no wider file is used."""

import os
import stat
import sys
from pathlib import Path
from typing import Final

from gateway.certificates import KeyProblem

_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


def forbid_core_dumps() -> None:
    """From now on this process leaves no dump of its memory: it holds a key, or a code that lets in."""
    if sys.platform == "win32":
        return  # nothing there writes one
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def check_private(file: Path) -> None:
    """A file and its folder are for their owner alone, as ssh demands it of its keys.

    Raises:
        KeyProblem: others may read it, or take its place; it says what closes it.
        OSError: nobody can say.

    """
    if os.name != "posix":
        return  # permissions are not told by a mode there
    for one, wanted in ((file.parent, "700"), (file, "600")):
        mode = stat.S_IMODE(one.stat().st_mode)
        if mode & _OTHERS:
            raise KeyProblem(
                f"{one} is open to others on this computer (mode {mode:04o}), and whoever has a key is its "
                f"owner: chmod {wanted} {one}"
            )
