"""A pseudo-terminal behind a stable path, that can be unplugged and plugged in again."""

import os
import pty
import tty
from collections.abc import Callable
from pathlib import Path

from tests.support.waiting import until


class Terminal:
    """The device's end of a serial line; `path` is what the driver opens."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._master: int | None = None

    def plug_in(self) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.path.symlink_to(os.ttyname(slave))
        os.close(slave)

    def unplug(self) -> None:
        if self._master is None:
            return
        self.path.unlink()
        os.close(self._master)
        self._master = None

    def send(self, data: bytes) -> None:
        if self._master is None:
            raise RuntimeError("the terminal is not plugged in")
        os.write(self._master, data)


def send_until(
    terminal: Terminal, data: bytes | Callable[[], bytes], condition: Callable[[], bool], what: str
) -> None:
    """Send `data` (or what it gives) again and again, as a sensor does, until `condition` holds."""

    def sent() -> bool:
        terminal.send(data if isinstance(data, bytes) else data())
        return condition()

    until(sent, what)
