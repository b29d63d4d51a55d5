"""The doors that clients come in by: which kind a listening socket is, by where it listens.

With keys every TCP connection is TLS. Without, TCP is for this computer alone. A Unix socket is for the
people on it.

Whether a robot has keys is asked once, when its gateway is started; to rest and to wake is no start
(`has_keys_at_start`). So whoever could stop the robot before a desk was let in still can, until somebody
starts its gateway again. And it has none before its first desk is let in (`access/changes.py`, `admit`).
"""

import socket
from enum import Enum
from typing import Any, Final, Protocol

_LOOPBACK: Final = ("127.", "::ffff:127.")


class DoorProblem(Exception):
    """A socket that must not be served; says which two commands lead on."""


class Kind(Enum):
    """Of a door."""

    PLAIN = "plain"  # TCP, from this computer only
    TLS = "tls"
    UNIX = "unix"


class Stream(Protocol):
    """A connection as far as one is used here: a socket, or what encrypts one."""

    def fileno(self) -> int: ...

    def recv(self, most: int, /) -> bytes: ...

    def send(self, data: "bytes | memoryview", /) -> int: ...

    def close(self) -> None: ...


def has_keys_at_start(*, now: bool, rested_without: bool) -> bool:
    """Whether a gateway serves with keys: as it began, also where its first one was made while it rested."""
    return now and not rested_without


def kind_of(listener: socket.socket, *, has_keys: bool) -> Kind:
    """Return what comes in there; by the address that it listens on, whoever has opened it.

    Raises:
        DoorProblem: nobody may come in there.

    """
    if listener.family == socket.AF_UNIX:
        return Kind.UNIX
    if has_keys:
        return Kind.TLS
    if not is_loopback(listener.getsockname()):
        raise DoorProblem(without_keys(_said(listener.getsockname())))
    return Kind.PLAIN


def check_classic(listener: socket.socket) -> None:
    """Refuse the paper's protocol, which has no keys, beyond this computer; raises `DoorProblem`."""
    if not is_loopback(listener.getsockname()):
        raise DoorProblem(
            f"classic_port would be served at {_said(listener.getsockname())}: it knows no keys, and is for "
            "this computer only; listen on 127.0.0.1, or leave it out"
        )


def without_keys(where: str) -> str:
    """Why a robot without keys is not served to other computers, and what to do."""
    return (
        f"this robot has no keys, and {where} is open to other computers: without keys it is served on "
        "127.0.0.1 and its Unix socket only. Two commands lead on: `gwrms keys pair ROBOT.toml` here, which "
        "shows a code, then `gwrms pair HOST:PORT` on the desk; the first desk gives it its key"
    )


def is_loopback(address: Any) -> bool:
    """Whether a TCP address, as `getsockname` gives it, can be reached from this computer only."""
    host = str(address[0])
    return host.startswith(_LOOPBACK) or host.partition("%")[0] == "::1"


def _said(address: Any) -> str:
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
