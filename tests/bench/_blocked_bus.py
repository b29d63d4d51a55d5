"""A CAN adapter that takes nothing any more: slcan on a pseudo-terminal whose other end nobody reads."""

import os
import pty
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager

_FRAME = b"t"  # begins a frame of slcan, and is in no word of its handshake


@contextmanager
def blocked_bus() -> Iterator[str]:
    """Its port. From the first frame on, every write to it waits for ever."""
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
    """Hear the handshake, and that a frame begins; then fill, from our own side, all the room that there is.

    Not before: pyserial returns from the last word of the handshake only once there is room again.
    """
    os.set_blocking(master, False)
    os.set_blocking(slave, False)
    heard = b""
    while _FRAME not in heard:
        if ending.wait(0.001):
            return
        try:
            heard = os.read(master, 100)
        except BlockingIOError:
            continue
    try:
        while True:
            os.write(slave, bytes(4096))
    except BlockingIOError:
        return
