"""Folders that gateway and clients on one computer both know: of a user's settings, and of Unix sockets."""

import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

SYSTEM: Final = Path("/run/gwrms")  # root's, or a service's: systemd makes it
_SERVICE, _SESSION = "RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"
_OTHERS: Final = stat.S_IWGRP | stat.S_IWOTH
ROOT: Final = 0


def user_folder() -> Path:
    """Return the user's own configuration (XDG base directories)."""
    folder = os.environ.get("XDG_CONFIG_HOME")
    return (Path(folder) if folder else Path.home() / ".config") / "gwrms"


def given_for_socket(environ: Mapping[str, str]) -> Path | None:
    """Return the folder that systemd gives a service, or the login a user, for sockets."""
    folder = environ.get(_SERVICE) or environ.get(_SESSION)
    return Path(folder) if folder else None


def to_serve_in(environ: Mapping[str, str]) -> list[Path]:
    """Return the folders in which a gateway with keys tries to have its Unix socket, in this order."""
    if _SERVICE in environ:
        return [Path(environ[_SERVICE])]
    system = [SYSTEM] if os.geteuid() == ROOT or os.access(SYSTEM, os.W_OK) else []
    return [*system, *_of_user(environ, os.geteuid()), user_folder()]


def to_look_in(environ: Mapping[str, str]) -> list[Path]:
    """Return the folders in which a client finds them: none that other users may write to."""
    users = list(_of_user(environ, os.geteuid()))
    if os.geteuid() == ROOT and environ.get("SUDO_UID", "").isdecimal():
        users += _of_user({}, int(environ["SUDO_UID"]))
    folders = [SYSTEM, *(one if one.name == "gwrms" else one / "gwrms" for one in users), user_folder()]
    return [one for one in dict.fromkeys(folders) if _is_safe(one)]


def _of_user(environ: Mapping[str, str], uid: int) -> Iterator[Path]:
    """Yield the folder of a session; of `su`, ssh without a login and cron, which name none, too."""
    if environ.get(_SESSION):
        yield Path(environ[_SESSION])
    elif (folder := Path(f"/run/user/{uid}")).is_dir():
        yield folder


def _is_safe(folder: Path) -> bool:
    try:
        return not folder.stat().st_mode & _OTHERS
    except OSError:
        return False
