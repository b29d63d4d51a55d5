"""Clients' connections in memory: what a socket does, as far as the gateway asks it."""

import errno
import os
import socket
from collections import deque
from collections.abc import Callable
from typing import Any

from tests.explore.system import READ, WRITE, Channel, System


class Connection(Channel):
    """The gateway's end of one; `told` is the client, and hears whatever is sent to it, `cut` its end."""

    family = socket.AF_INET

    def __init__(
        self, system: System, told: Callable[[bytes], object], cut: Callable[[], object] = bool
    ) -> None:
        super().__init__(system)
        self._cut = cut
        self.closed = False
        self.ended = False  # the client says nothing more
        self.gone = False  # nobody is there any more
        self._told = told
        self._chunks: deque[bytes] = deque()

    # The client's side

    def say(self, line: bytes) -> None:
        self._chunks.append(line)
        self.changed()

    def end(self, *, gone: bool) -> None:
        """Say nothing more; where the client has `gone`, what is sent to it fails."""
        self.ended, self.gone = True, gone
        self.changed()

    # The gateway's side

    @property
    def events(self) -> int:
        return WRITE | (READ if self._chunks or self.ended else 0)

    def recv(self, _size: int) -> bytes:
        if self._chunks:
            return self._chunks.popleft()
        if not self.ended:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        return b""

    def send(self, data: Any) -> int:
        if self.gone:
            raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))
        self._told(bytes(data))
        return len(data)

    def close(self) -> None:
        if not self.closed:
            self.closed = True
            self._cut()

    def setblocking(self, _blocking: bool) -> None:
        """It never blocks."""

    def setsockopt(self, *_option: int) -> None:
        """It has none."""


class Listener(Channel):
    """Where clients come in."""

    family = socket.AF_INET

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self._waiting: deque[Connection] = deque()
        self._port = 40_000

    def connect(self, connection: Connection) -> None:
        self._waiting.append(connection)
        self.changed()

    @property
    def events(self) -> int:
        return READ if self._waiting else 0

    def accept(self) -> tuple[Connection, tuple[str, int]]:
        if not self._waiting:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        self._port += 1
        return self._waiting.popleft(), ("127.0.0.1", self._port)

    def setblocking(self, _blocking: bool) -> None:
        """It never blocks."""

    def getsockname(self) -> tuple[str, int]:
        return "127.0.0.1", 7420

    def close(self) -> None:
        """Nobody comes any more."""
