"""Takes new connections of a listening socket, and rests while the process has no descriptors for them."""

import errno
import logging
import socket
from collections.abc import Callable
from typing import Any

from gateway.process.loop import READ, Loop

log = logging.getLogger(__name__)

REST_S = 1.0
_FULL = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class Acceptor:
    """Calls `opened(connection, address)` for each; it belongs to the loop's thread."""

    def __init__(
        self, loop: Loop, listener: socket.socket, opened: Callable[[socket.socket, Any], None]
    ) -> None:
        self._loop = loop
        self._listener = listener
        self._opened = opened
        self._listening = False
        listener.setblocking(False)

    def start(self) -> None:
        self._listening = True
        self._watch()

    def end(self) -> None:
        """Accept nobody more, until `start`; the listening socket stays open."""
        self._listening = False
        self._watch()

    def _watch(self) -> None:
        self._loop.watch(self._listener, READ * self._listening, lambda _events: self._accept())

    def _accept(self) -> None:
        try:
            connection, address = self._listener.accept()
        except BlockingIOError:
            return
        except OSError as error:
            log.warning("a client could not be accepted: %s", error)
            if error.errno in _FULL:
                self._loop.watch(self._listener, 0, lambda _events: None)
                self._loop.call_later(REST_S, self._watch)
            return
        try:
            self._opened(connection, address)
        except OSError as error:  # it has gone already
            log.info("%s: %s", address, error)
            connection.close()
