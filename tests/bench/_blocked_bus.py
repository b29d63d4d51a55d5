"""A CAN adapter that takes nothing any more: slcan on a pseudo-terminal whose other end nobody reads."""

import os
import pty
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager

_OPENED = b"O\r"  # the last word of slcan's handshake


@contextmanager
def blocked_bus() -> Iterator[str]:
    """Its port. From when it has been opened, every write to it waits for ever."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    ending = threading.Event()
    thread = threading.Thread(target=_serve, args=(master, slave, ending), name="blocked bus")
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        ending.set()
        thread.join()
        os.close(master)
        os.close(slave)


def _serve(master: int, slave: int, ending: threading.Event) -> None:
    """Hear the handshake to its end; then fill, from our own side, all the room that there is."""
    os.set_blocking(master, False)
    os.set_blocking(slave, False)
    heard = b""
    while _OPENED not in heard:  # the first frames may come with it
        if ending.wait(0.001):
            return
        try:
            heard = heard[-len(_OPENED) :] + os.read(master, 100)  # it may come in two pieces
        except BlockingIOError:
            continue
    try:
        while True:
            os.write(slave, bytes(4096))
    except BlockingIOError:
        return
