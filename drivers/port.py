"""One supervised serial port: opens, reads in its own thread, names what is wrong, and comes back.

The thread sleeps in one system call until bytes come or `stop` wakes it. A port that vanishes (unplugged, or
a pseudo-terminal whose other end closed) is opened again by the same path, so stable paths such as
`/dev/serial/by-id/…` survive any number of unplugs.
"""

import errno
import os
import select
import stat
import threading
import time
from collections.abc import Callable
from pathlib import Path

import serial

from drivers.errors import Unavailable
from drivers.realtime_priority import make_realtime

FIRST_RETRY_S = 0.1
LAST_RETRY_S = 2.0
READ_SIZE = 4096
STABLE_PATHS = Path("/dev/serial/by-id")

Received = Callable[[bytes, int], None]


def _nothing() -> None:
    """Do nothing at opening and closing."""


class SerialPort:
    """A serial port that is held open between `start` and `stop`.

    `received(data, stamp_ns)` gets every read, with the robot's monotonic clock right after it; `opened` and
    `closed` tell when the port came and went. All three run in the port's thread and must return at once.
    What `received` raises is told as `problem`, and reading goes on.
    """

    def __init__(
        self,
        path: str,
        baudrate: int,
        received: Received,
        opened: Callable[[], None] = _nothing,
        closed: Callable[[], None] = _nothing,
    ) -> None:
        self.path = path
        self.baudrate = baudrate
        self.problem: str | None = None  # why it is not open, or what failed since, in words
        self.opened_ns: int | None = None  # since when it is open
        self._received = received
        self._opened = opened
        self._closed = closed
        self._thread: threading.Thread | None = None
        self._wake = -1

    def start(self) -> None:
        """Open the port and keep it open; returns at once."""
        if self._thread is not None:
            return
        self._wake = os.eventfd(0)
        self._thread = threading.Thread(target=self._run, name=f"serial {self.path}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close the port and end its thread."""
        if self._thread is None:
            return
        os.eventfd_write(self._wake, 1)
        self._thread.join()
        os.close(self._wake)
        self._thread = None
        self.problem = None

    def _run(self) -> None:
        make_realtime()
        retry_s = FIRST_RETRY_S
        while True:
            try:
                with open_port(self.path, self.baudrate) as port:
                    retry_s = FIRST_RETRY_S
                    if self._serve(port.fileno()):
                        return
                self.problem = f"{self.path} went away: check its cable; it is opened again when it is back"
            except Unavailable as error:
                self.problem = str(error)
            if self._stopped_within(retry_s):
                return
            retry_s = min(2 * retry_s, LAST_RETRY_S)

    def _serve(self, descriptor: int) -> bool:
        """Hand out bytes; true when stopped, false when the port went away."""
        self.problem = None
        self.opened_ns = time.monotonic_ns()
        self._opened()
        try:
            return self._read(descriptor)
        finally:
            self.opened_ns = None
            self._closed()

    def _read(self, descriptor: int) -> bool:
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        poll.register(self._wake, select.POLLIN)
        while True:
            ready = poll.poll()
            if len(ready) > 1 or ready[0][0] == self._wake:  # of two, one is the order to stop
                return True
            try:
                data = os.read(descriptor, READ_SIZE)
            except BlockingIOError:
                continue
            except OSError:
                return False
            if not data:
                return False
            try:
                self._received(data, time.monotonic_ns())
            except Exception as error:  # noqa: BLE001 - one wrong frame must not silence the sensor
                self.problem = f"internal error at bytes of {self.path}: {type(error).__name__}: {error}"

    def _stopped_within(self, seconds: float) -> bool:
        poll = select.poll()
        poll.register(self._wake, select.POLLIN)
        return bool(poll.poll(seconds * 1e3))


def open_port(path: str, baudrate: int) -> serial.Serial:
    """Open `path` raw, 8N1, for this process alone, what waited in it thrown away.

    Raises:
        Unavailable: it does not exist, is not ours to open, is in use, or is no serial port; the message
            says which, and what to do.

    """
    try:
        return serial.Serial(path, baudrate, timeout=0, exclusive=True)
    except (OSError, ValueError) as error:  # SerialException is an OSError
        raise Unavailable(_explain(path, baudrate, error)) from error


def obstacle(path: str) -> str | None:
    """Return why the port could not be opened now, in words with what to do; it is only looked at."""
    try:
        kind = Path(path).stat().st_mode
    except OSError as error:
        return _explain(path, 0, error)
    if not stat.S_ISCHR(kind):
        return _no_port(path)
    if not os.access(path, os.R_OK | os.W_OK):
        return _explain(path, 0, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))
    return None


def _explain(path: str, baudrate: int, error: Exception) -> str:
    number = error.errno if isinstance(error, OSError) else None
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.EIO):
        return f"{path} does not exist: plug the device in, or correct the port's path{_ports_here()}"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {path}: add this user to its group "
            f"(sudo usermod -aG {_group(path)} USER) and log in again"
        )
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{path} is in use by another program: close it (lsof {path} names it)"
    if isinstance(error, ValueError):
        return f"{path} cannot run at {baudrate} baud: {error}"
    if not Path(path).is_char_device():
        return _no_port(path)
    return f"{path} cannot be opened as a serial port: {error}"


def _no_port(path: str) -> str:
    return f"{path} is no serial port: correct the port's path{_ports_here()}"


def _ports_here() -> str:
    try:
        names = sorted(str(entry) for entry in STABLE_PATHS.iterdir())
    except OSError:
        return ""
    return f"; connected now: {', '.join(names)}" if names else ""


def _group(path: str) -> str:
    try:
        return Path(path).group()
    except (OSError, KeyError):
        return "dialout"
