"""The sockets that clients come to: opened here, or handed over by whoever has held them until now.

They are handed over as systemd does it (sd_listen_fds(3)): from descriptor 3 on, their number and names in
the environment. A gateway that nobody needs hands them to `resting.py` in the same way, and gets them back.
"""

import contextlib
import fcntl
import os
import re
import socket
import sys
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from gateway.own_folders import is_served
from gateway.process import resting

BACKLOG = 1024  # who comes while it wakes up; where there is no room, TCP tries again a second later
PORT, CLASSIC, LOCAL = "port", "classic_port", "socket"  # how they are named; the last by what it is
_NUMBER, _PROCESS, _NAMES, _RESTING = "LISTEN_FDS", "LISTEN_PID", "LISTEN_FDNAMES", "GWRMS_RESTING"
_KEYED, _KEYLESS = "1", "without keys"  # how it rests
_SPARE = 64  # above every number that sockets are handed over with


class HandoverError(Exception):
    """The handed-over sockets cannot be served."""


@dataclass(frozen=True, slots=True)
class Listeners:
    """The gateway's own port, the paper's and the Unix socket where it has them.

    `woken` where it has rested with them, and `without_keys` where it did so before the robot had any.
    """

    port: socket.socket
    classic: socket.socket | None = None
    local: socket.socket | None = None
    woken: bool = False
    without_keys: bool = False

    @property
    def named(self) -> dict[str, socket.socket]:
        given = {PORT: self.port, CLASSIC: self.classic, LOCAL: self.local}
        return {name: one for name, one in given.items() if one is not None}

    @property
    def all(self) -> list[socket.socket]:
        return list(self.named.values())

    def close(self) -> None:
        for one in self.all:
            one.close()


def listen(host: str, port: int, setting: str = "--host or --port") -> socket.socket:
    """Return a listening TCP socket; port 0 picks one. `setting` is what an error tells to change.

    Raises:
        OSError: the address is not ours, or the port is in use; the message names both.

    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        return socket.create_server(address[:2], family=family, backlog=BACKLOG)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror or str(error)
        raise OSError(f"cannot listen on {host}:{port}: {reason}; choose another with {setting}") from error


def listen_locally(path: Path) -> socket.socket:
    """Return a listening Unix socket. What a gateway that has gone has left there is taken away.

    Raises:
        OSError: another gateway serves there, or the path cannot be used; the message names it.

    """
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        path.parent.mkdir(parents=True, mode=0o755, exist_ok=True)
        if path.is_socket() and not is_served(path):
            path.unlink()
        made.bind(str(path))
        path.chmod(0o666)  # who may come in is judged by who they are
        made.listen(BACKLOG)
    except OSError as error:
        made.close()
        reason = error.strerror or str(error)
        raise OSError(f"cannot listen on {path}: {reason}; choose another with [gateway] socket") from error
    return made


def default_socket(folder: Path, robot: str) -> Path:
    """Return where one robot's is in a folder for such."""
    return folder / f"{re.sub('[^A-Za-z0-9_.-]', '-', robot)}.sock"


def inherited(environ: MutableMapping[str, str]) -> Listeners | None:
    """Return the sockets passed to this process, `None` for none; they are taken only once.

    Raises:
        HandoverError: what was handed over is no listening TCP socket, or more than one has the same name.

    """
    number, process = environ.pop(_NUMBER, "0"), environ.pop(_PROCESS, "")
    names, resting_as = environ.pop(_NAMES, "").split(":"), environ.pop(_RESTING, "")
    if process != str(os.getpid()) or not number.isdecimal() or not int(number):
        return None
    found: dict[str, socket.socket] = {}
    for place in range(int(number)):
        adopted = _adopted(resting.FIRST + place)
        name = CLASSIC if names[place : place + 1] == [CLASSIC] else PORT
        if adopted.family == socket.AF_UNIX:
            name = LOCAL
        if name in found:
            raise HandoverError(
                f"two sockets were handed over as {name}; name one FileDescriptorName={CLASSIC}"
            )
        found[name] = adopted
    if PORT not in found:
        raise HandoverError(f"no socket was handed over as {PORT}; give one ListenStream= that name")
    return Listeners(
        found[PORT], found.get(CLASSIC), found.get(LOCAL), resting_as != "", resting_as == _KEYLESS
    )


def _adopted(descriptor: int) -> socket.socket:
    try:
        adopted = socket.socket(fileno=descriptor)
        listening = adopted.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
    except OSError as error:
        raise HandoverError(f"descriptor {descriptor} was handed over and is no socket: {error}") from error
    if not listening or adopted.type != socket.SOCK_STREAM:
        adopted.detach()
        raise HandoverError(f"descriptor {descriptor} was handed over and does not listen for streams")
    adopted.set_inheritable(False)
    return adopted


def rest(listeners: Listeners, kept: Mapping[str, str] = MappingProxyType({})) -> None:
    """Become a small process that waits at the sockets, and this program again when somebody comes.

    That finds what is `kept` in its environment, as far as there is room. Never returns; what is not
    inheritable is closed. Signals are to be blocked before: what comes meanwhile is then met by the one
    who waits.

    Raises:
        OSError: the interpreter cannot be started.

    """
    # First to high numbers: none of them may stand where another goes to.
    spare = [fcntl.fcntl(one.fileno(), fcntl.F_DUPFD_CLOEXEC, _SPARE) for one in listeners.all]
    for place, descriptor in enumerate(spare):
        os.dup2(descriptor, resting.FIRST + place)
    environ = {
        "MALLOC_ARENA_MAX": "1",  # of glibc: the threads of so small a process need no memory of their own
        **os.environ,
        _NUMBER: str(len(spare)),
        _PROCESS: str(os.getpid()),
        _NAMES: ":".join(listeners.named),
        _RESTING: _KEYLESS if listeners.without_keys else _KEYED,
    }
    ourselves = [sys.executable, *sys.orig_argv[1:]]
    sys.stdout.flush()
    command = [sys.executable, "-I", "-S", resting.__file__, *ourselves]
    if kept:
        with contextlib.suppress(OSError):  # too much of it, where the stack is small: then without
            os.execve(sys.executable, command, {**environ, **kept})
    os.execve(sys.executable, command, environ)
