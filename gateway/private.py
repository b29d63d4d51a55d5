"""What keeps a key or a code within one account: no dump of the process has it, no wider file is used."""

import os
import stat
import sys
from pathlib import Path
from typing import Final

from gateway.certificates import KeyProblem

_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO
_WRITING: Final = stat.S_IWGRP | stat.S_IWOTH


def forbid_core_dumps() -> None:
    """Leave no dump of this process's memory from now on: it holds a key, or a code that lets in."""
    if sys.platform == "win32":
        return  # nothing there writes one
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def check_private(file: Path) -> None:
    """Check that file and folder belong to their owner alone, as ssh requires for its keys.

    Where it is a link, nobody else may change the folder that it leads to.

    Raises:
        KeyProblem: others may read it, or take its place; it says what closes it.
        OSError: nobody can say.

    """
    if os.name != "posix":
        return  # permissions are not told by a mode there
    real = file.resolve()
    for one, closed, wanted in (
        (file.parent, _OTHERS, "700"),
        (real.parent, _WRITING, "go-w"),
        (real, _OTHERS, "600"),
    ):
        mode = stat.S_IMODE(one.stat().st_mode)
        if mode & closed:
            raise KeyProblem(
                f"{one} is open to others on this computer (mode {mode:04o}), and whoever has a key is its "
                f"owner: chmod {wanted} {one}"
            )
