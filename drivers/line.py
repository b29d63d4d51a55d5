"""One serial port with one format on it, shared by every component whose frames come over it."""

from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from drivers.parsing import Parser
from drivers.port import SerialPort
from drivers.reader_stalls import ReaderStalls

F = TypeVar("F")
Listening = TypeVar("Listening", contravariant=True)
Recognise = Callable[[bytes], str | None]  # the name of the format that some bytes are in

TAIL = 2048  # bytes that are kept to tell what speaks there instead
UNREAD = 256  # bytes without a frame that are no beginning of one any more
SILENCE_S = 1.0  # a sensor that streams says something within this time


def unrecognised(_data: bytes) -> None:
    """Recognise nothing: for who does not know other formats."""


class User(Protocol[Listening]):
    """A component that takes frames; called in the port's thread."""

    def received(self, frames: Sequence[Listening], stamp_ns: int) -> None:
        """Take the frames, one or more, completed by one read."""
        ...

    def disconnected(self) -> None: ...


class Line(Generic[F]):
    """A port and a parser; open while at least one user is started.

    `recognise` is asked about bytes without a frame, so that the problem can name what speaks there instead.

    `start` and `stop` belong to one thread. Everything else may be read from any.
    """

    def __init__(
        self,
        path: str,
        baudrate: int,
        format_name: str,
        make_parser: Callable[[], Parser[F]],
        recognise: Recognise = unrecognised,
        standstill: ReaderStalls | None = None,
    ) -> None:
        """`standstill` is that of a bus which the same computer reads: a port's thread only waits."""
        self.path = path
        self.standstill = standstill or ReaderStalls()
        self.format_name = format_name
        self.parser = make_parser()
        self.reconnects = 0
        self._make_parser = make_parser
        self._recognise = recognise
        self._port = SerialPort(path, baudrate, self._received, self._opened, self._closed)
        self._users: tuple[User[F], ...] = ()
        self._unread = 0  # bytes since the last frame, or since the port was opened
        self._unread_tail = b""
        self._last_byte_ns: int | None = None

    def start(self, user: User[F]) -> None:
        if user in self._users:
            return
        self._users = (*self._users, user)
        if len(self._users) == 1:
            self.parser = self._make_parser()
            self.reconnects = -1
            self._port.start()

    def stop(self, user: User[F]) -> None:
        self._users = tuple(known for known in self._users if known is not user)
        if not self._users:
            self._port.stop()

    def problem(self, now_ns: int) -> str | None:
        """Return the line's problem, in words with what to check; `None` while frames come."""
        if self._port.problem is not None:
            return self._port.problem
        opened_ns = self._port.opened_ns
        if opened_ns is None:
            return f"{self.path} is being opened"
        since_ns = max(opened_ns, self._last_byte_ns or 0)
        silent_s = (now_ns - since_ns) / 1e9
        if (stood_still := self.standstill.words(now_ns, since_ns, SILENCE_S)) is not None:
            return stood_still
        if silent_s > SILENCE_S:
            return f"no byte from {self.path} for {silent_s:.1f} s: check the sensor's power and its TX wire"
        if self._unread < UNREAD:
            return None
        spoken = self._recognise(self._unread_tail)
        why = f"wrong baud rate or wrong format (gwrms sensor {self.path} finds out)"
        if spoken is not None and spoken != self.format_name:
            why = f"another device is there, which speaks {spoken}"
        return (
            f"{self._unread} bytes came from {self.path} at {self._port.baudrate} baud "
            f"and no {self.format_name} frame among them: {why}"
        )

    def _opened(self) -> None:
        self.reconnects += 1
        self._unread, self._unread_tail = 0, b""
        self._last_byte_ns = None
        self.parser.finish()

    def _closed(self) -> None:
        for user in self._users:
            user.disconnected()

    def _received(self, data: bytes, stamp_ns: int) -> None:
        self._last_byte_ns = stamp_ns
        frames = self.parser.feed(data)
        if not frames:
            self._unread += len(data)
            self._unread_tail = (self._unread_tail + data)[-TAIL:]
            return
        self._unread, self._unread_tail = 0, b""
        for user in self._users:
            user.received(frames, stamp_ns)
