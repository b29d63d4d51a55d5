"""The kind of a listening socket, from its address: plain TCP, TLS or Unix.

With keys, every TCP connection is TLS. Without keys, TCP serves this computer alone. A Unix socket serves the
accounts of this computer.

Whether a robot has keys is decided once, when its gateway starts; resting and waking is not a start
(`has_keys_at_start`). So every client that could stop the robot before the first desk was admitted still can,
until the gateway is started again. There are no keys before the first desk is admitted (`access/changes.py`,
`admit`).
"""

import socket
from enum import Enum
from pathlib import Path
from typing import Any, Final, Protocol

_LOOPBACK: Final = ("127.", "::ffff:127.")


class UnsafeListener(Exception):
    """A socket that must not be served; the message names the two commands to run instead."""


class ListenerKind(Enum):
    """Kind of a listening socket."""

    PLAIN = "plain"  # TCP, from this computer only
    TLS = "tls"
    UNIX = "unix"


class Stream(Protocol):
    """The part of a connection that is used here: a socket, or its TLS wrapper."""

    def fileno(self) -> int: ...

    def recv(self, most: int, /) -> bytes: ...

    def send(self, data: "bytes | memoryview", /) -> int: ...

    def close(self) -> None: ...


def has_keys_at_start(*, now: bool, rested_without: bool) -> bool:
    """Return whether a gateway serves with keys: as at its start, even if keys were made while it rested."""
    return now and not rested_without


def kind_of(listener: socket.socket, *, has_keys: bool, robot: Path) -> ListenerKind:
    """Return the kind of a listener, from its address, no matter who opened it; `robot` is the robot's file.

    Raises:
        UnsafeListener: it must not be served.

    """
    if listener.family == socket.AF_UNIX:
        return ListenerKind.UNIX
    if has_keys:
        return ListenerKind.TLS
    if not is_loopback(listener.getsockname()):
        raise UnsafeListener(without_keys(said(listener.getsockname()), robot))
    return ListenerKind.PLAIN


def check_classic(listener: socket.socket) -> None:
    """Refuse the paper's protocol, which has no keys, beyond this computer; raises `UnsafeListener`."""
    if not is_loopback(listener.getsockname()):
        raise UnsafeListener(
            f"classic_port would be served at {said(listener.getsockname())}: it has no keys, and is for "
            "this computer only; listen on 127.0.0.1, or leave it out"
        )


def without_keys(where: str, robot: Path) -> str:
    """Return why a robot without keys is not served to other computers, and the remedy."""
    return (
        f"this robot has no keys, and {where} is open to other computers: nothing is served now. To admit a "
        f"desk, run `gwrms keys pair {robot}` here, which shows a code, and `gwrms pair HOST:PORT` on the "
        'desk; then start the gateway again. To serve this computer alone, set host = "127.0.0.1"'
    )


def is_loopback(address: Any) -> bool:
    """Return whether a TCP address, as `getsockname` gives it, is reachable from this computer only."""
    host = str(address[0])
    return host.startswith(_LOOPBACK) or host.partition("%")[0] == "::1"


def said(address: Any) -> str:
    """Return a TCP address, as `getsockname` gives it, as HOST:PORT."""
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
