"""A serial device's end of a pseudo-terminal: never waits for whoever reads it, and can be unplugged."""

import array
import fcntl
import os
import re
import termios
import tty
from pathlib import Path

_BACKLOG_BYTES = 2048  # what a reader that is absent or slow may find waiting; older bytes are dropped
_NAMES = [name for name in dir(termios) if re.fullmatch(r"B[1-9]\d*", name)]
BAUDRATES = {int(name[1:]): getattr(termios, name) for name in _NAMES}  # the code of each standard one
_BAUDRATE_OF = {code: baudrate for baudrate, code in BAUDRATES.items()}
_INPUT_SPEED, _OUTPUT_SPEED = 4, 5  # places in what tcgetattr gives


class SerialPort:
    """A pseudo-terminal behind a symbolic link with a stable path.

    Both ends stay open here, so that raw mode holds and nobody notices a reader that comes or goes.
    `baudrate` is a standard one (termios).
    """

    def __init__(self, link: Path, baudrate: int) -> None:
        self.link = link
        self.bytes_dropped = 0
        self._own_baudrate = baudrate
        self._master = self._slave = -1
        self.plug(True)

    @property
    def baudrate(self) -> int:
        """The reader's baud rate; the device's own until one is set, or if it is no standard rate."""
        speed = termios.tcgetattr(self._slave)[_OUTPUT_SPEED]
        return _BAUDRATE_OF.get(speed, self._own_baudrate)

    def plug(self, plugged: bool) -> None:
        """Make the port there, or hang up and take its link away; idempotent."""
        if not plugged:
            self.close()
        elif self._master < 0:
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            attributes = termios.tcgetattr(self._slave)
            attributes[_INPUT_SPEED] = attributes[_OUTPUT_SPEED] = BAUDRATES[self._own_baudrate]
            termios.tcsetattr(self._slave, termios.TCSANOW, attributes)
            os.set_blocking(self._master, False)
            _point(self.link, os.ttyname(self._slave))

    def write(self, data: bytes) -> None:
        """Send bytes; where nobody fetched the earlier ones, those are gone."""
        waiting = self._waiting()
        if waiting > _BACKLOG_BYTES:
            self.bytes_dropped += waiting
            termios.tcflush(self._slave, termios.TCIFLUSH)
        try:
            written = os.write(self._master, data)
        except BlockingIOError:
            written = 0
        self.bytes_dropped += len(data) - written

    def _waiting(self) -> int:
        count = array.array("i", [0])
        fcntl.ioctl(self._slave, termios.FIONREAD, count)
        return count[0]

    def close(self) -> None:
        """Take the link away and hang up; idempotent."""
        if self._master < 0:
            return
        if self.link.is_symlink() and str(self.link.readlink()) == os.ttyname(self._slave):
            self.link.unlink()
        os.close(self._slave)
        os.close(self._master)
        self._master = self._slave = -1


def _point(link: Path, target: str) -> None:
    """Make or replace the link in one step: no moment without it."""
    fresh = link.with_name(f".{link.name}.new")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(link)
