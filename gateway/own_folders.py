"""Folders that gateway and clients on one computer both know: of a user's settings, and of Unix sockets."""

import contextlib
import os
import socket
import stat
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
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
    """Return the folder for sockets that systemd gives a service, or the login a user."""
    folder = environ.get(_SERVICE) or environ.get(_SESSION)
    return _ours(Path(folder)) if folder else None


def to_serve_in(environ: Mapping[str, str]) -> list[Path]:
    """Return the folders in which a gateway with keys tries to have its Unix socket, in this order.

    That of a session comes last: it goes with the logout, and the gateway may stay.
    """
    if _SERVICE in environ:
        return [_ours(Path(environ[_SERVICE]))]
    user = os.geteuid()
    system = [SYSTEM] if user == ROOT or os.access(SYSTEM, os.W_OK) else []
    return [*system, user_folder(), *_of_session(environ, user)]


def make_safe(folder: Path) -> None:
    """Let nobody else write to a folder to serve in; raise `OSError` where somebody else has made it."""
    if folder.exists() and not _is_safe(folder, {ROOT, os.geteuid()}):
        if folder.stat().st_uid != os.geteuid():
            raise OSError(f"{folder} is another user's")
        folder.chmod(stat.S_IMODE(folder.stat().st_mode) & ~_OTHERS)  # made with a umask of 002


def is_served(path: str | Path) -> bool:
    """Return whether somebody listens at a Unix socket: a gateway that was killed leaves its own."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as trying:
        trying.setblocking(False)
        try:
            trying.connect(str(path))
        except BlockingIOError:  # it is there, and busy
            return True
        except OSError:
            return False
    return True


def to_look_in(environ: Mapping[str, str]) -> list[Path]:
    """Return the folders in which a client finds them: none that other users may write to, or have made."""
    user = os.geteuid()
    folders, owners = [SYSTEM, *_of_session(environ, user), user_folder()], {ROOT, user}
    if user == ROOT and (behind := environ.get("SUDO_UID", "")).isdecimal():
        owners.add(int(behind))
        folders += [*_of_session({}, int(behind)), *_settings_of(int(behind))]
    return [one for one in dict.fromkeys(folders) if _is_safe(one, owners)]


def _of_session(environ: Mapping[str, str], uid: int) -> Iterator[Path]:
    """Yield the folder of a session; of `su`, ssh without a login and cron, which name none, too."""
    if environ.get(_SESSION):
        yield _ours(Path(environ[_SESSION]))
    elif (folder := Path(f"/run/user/{uid}")).is_dir():
        yield _ours(folder)


def _settings_of(uid: int) -> Iterator[Path]:
    import pwd  # Windows has none, and no sudo

    with contextlib.suppress(KeyError):
        yield Path(pwd.getpwuid(uid).pw_dir, ".config", "gwrms")


def _ours(folder: Path) -> Path:
    return folder if folder.name == "gwrms" else folder / "gwrms"


def _is_safe(folder: Path, owners: AbstractSet[int]) -> bool:
    """Return whether nobody but these users made it or may write to it (the system's is a service's)."""
    try:
        found = folder.stat()
    except OSError:
        return False
    return not found.st_mode & _OTHERS and (folder == SYSTEM or found.st_uid in owners)
