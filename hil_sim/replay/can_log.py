"""CAN logs as python-can reads them, strictly: candump -l (.log), Vector ASC (.asc) and BLF (.blf).

What cannot be believed is refused with file and line, where python-can would guess or leave it out.
"""

import heapq
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import can
from can.io.blf import BLFParseError

from hil_sim.bus.can_bus import Frame
from hil_sim.clock import SECOND_NS
from hil_sim.errors import SimulatorError

_MOST_BYTES = 8
_DISORDER_NS = (
    1 * SECOND_NS
)  # several sockets written to one file: so far a stamp may be behind a later line's
_PAUSE_NS = 3600 * SECOND_NS  # nobody waits for that: it was another clock, or another recording
_ERROR_FLAG = 0x2000_0000  # Linux can.h; python-can knows one class of error frames and takes others for data
_CANDUMP_LINE = re.compile(
    r"\(\d+\.\d+\) (\S+) ([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(R\d?|(?:[0-9A-Fa-f]{2})*|#.*)( [RT])?\s*"
)
_BROKEN = (ValueError, IndexError, TypeError, EOFError, struct.error, zlib.error, can.CanError, BLFParseError)


class ReplayError(SimulatorError):
    """A recording that cannot be played; the message names file and line."""


class Recorded(NamedTuple):
    """A frame, `None` for an error frame, and when it was recorded (ns; Unix time where the file says it)."""

    stamp_ns: int
    frame: Frame | None


class _Implausible(ValueError):
    """The reader's result cannot be right."""


class _Lines:
    """The lines of a text file, for a reader that does not say where it is."""

    def __init__(self, file: IO[str]) -> None:
        self._file = file
        self.number = 0
        self.text = ""

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        self.text = next(self._file)
        self.number += 1
        if not self.text.endswith("\n"):
            raise _Implausible("the file ends in the middle of this line: delete it")
        return self.text

    def close(self) -> None:
        self._file.close()


class _Source:
    """An open log: its messages, and the words for where it is."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.reader: can.io.generic.MessageReader
        self.read = 0

    @property
    def where(self) -> str:
        return f"{self.path}, after {self.read} frames"

    def look(self, message: can.Message) -> tuple[str, bool]:
        """Return the channel as the file calls it, and whether this is an error frame.

        Raises `_Implausible` where the message is not what the file says.
        """
        channel = message.channel
        return str(channel + 1 if isinstance(channel, int) else channel), message.is_error_frame


class _Text(_Source):
    def __init__(
        self, path: Path, reader: Callable[..., can.io.generic.MessageReader], **options: Any
    ) -> None:
        super().__init__(path)
        self.lines = _Lines(path.open(encoding="utf-8", errors="replace"))
        self.reader = reader(self.lines, **options)

    @property
    def where(self) -> str:
        return f"{self.path}, line {self.lines.number}"


class _Candump(_Text):
    def __init__(self, path: Path) -> None:
        super().__init__(path, can.CanutilsLogReader)

    def look(self, message: can.Message) -> tuple[str, bool]:
        line = _CANDUMP_LINE.fullmatch(self.lines.text.lstrip())
        if line is None:
            raise _Implausible("this is no line of candump -l")
        channel, identifier = line[1], line[2]
        return channel, message.is_error_frame or bool(int(identifier, 16) & _ERROR_FLAG)


class _Asc(_Text):
    def __init__(self, path: Path) -> None:
        super().__init__(path, can.ASCReader, relative_timestamp=False)

    def look(self, message: can.Message) -> tuple[str, bool]:
        if getattr(self.reader, "timestamps_format", None) == "relative":
            raise _Implausible("its stamps count from line to line: save it with absolute ones")
        return super().look(message)


class _Blf(_Source):
    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with ExitStack() as closing:
            self.reader = can.BLFReader(closing.enter_context(path.open("rb")))
            if path.stat().st_size < self.reader.file_size:
                raise _Implausible(f"the file is cut off: it was {self.reader.file_size} bytes long")
            closing.pop_all()  # closed with the reader


_FORMATS: dict[str, Callable[[Path], _Source]] = {".log": _Candump, ".asc": _Asc, ".blf": _Blf}


@dataclass(frozen=True, slots=True)
class CanLog:
    """One log; of several channels in it `channel` is the one that counts, as the file calls it.

    Iterating gives its frames in the order of their stamps, again and again.
    """

    path: Path
    channel: str | None = None

    def __iter__(self) -> Iterator[Recorded]:
        """Yield the frames; raises `ReplayError`."""
        waiting: list[tuple[int, int, Recorded]] = []
        newest_ns = None
        for number, (one, where) in enumerate(self._read()):
            newest_ns = one.stamp_ns if newest_ns is None else _follow(newest_ns, one.stamp_ns, where)
            heapq.heappush(waiting, (one.stamp_ns, number, one))
            while waiting[0][0] < newest_ns - _DISORDER_NS:
                yield heapq.heappop(waiting)[2]
        if newest_ns is None:
            of = "" if self.channel is None else f" of channel {self.channel}"
            raise ReplayError(f"{self.path} holds no CAN frame{of}")
        while waiting:
            yield heapq.heappop(waiting)[2]

    def _read(self) -> Iterator[tuple[Recorded, str]]:
        source, channel = self._open(), self.channel
        try:
            for message in source.reader:
                where = source.where
                source.read += 1
                name, is_error = source.look(message)
                channel = name if channel is None else channel
                if name == channel:
                    yield (
                        Recorded(round(message.timestamp * 1e9), None if is_error else _frame(message)),
                        where,
                    )
                elif self.channel is None:
                    raise _Implausible(
                        f"a frame of channel {name} beside those of {channel}: choose by --channel"
                    )
        except _BROKEN as error:
            raise ReplayError(f"{source.where}: {_words(error)}") from error
        finally:
            source.reader.stop()

    def _open(self) -> _Source:
        form = _FORMATS.get(self.path.suffix.lower())
        if form is None:
            raise ReplayError(
                f"{self.path} is no log that can be read by its name: give {', '.join(_FORMATS)}"
            )
        try:
            return form(self.path)
        except OSError as error:
            raise ReplayError(f"{self.path} cannot be read: {error.strerror}") from error
        except _BROKEN as error:
            raise ReplayError(f"{self.path}: {_words(error)}") from error


def _words(error: BaseException) -> str:
    if isinstance(error, _Implausible):
        return str(error)
    return f"this cannot be read as a log ({type(error).__name__}: {error!s})"


def _frame(message: can.Message) -> Frame:
    if message.is_fd or message.dlc > _MOST_BYTES:
        raise _Implausible("a CAN FD frame: the bus carries classic frames alone")
    data = b"" if message.is_remote_frame else bytes(message.data)
    if not message.is_remote_frame and len(data) != message.dlc:
        raise _Implausible(f"{len(data)} bytes where the length says {message.dlc}")
    if message.arbitration_id >= 1 << (29 if message.is_extended_id else 11):
        raise _Implausible(f"{message.arbitration_id:X} is no identifier")
    return Frame(message.arbitration_id, data, message.is_extended_id, message.is_remote_frame)


def _follow(newest_ns: int, stamp_ns: int, where: str) -> int:
    """Return the newest stamp now; raises `ReplayError` where another clock counts from here on."""
    step_ns = stamp_ns - newest_ns
    if step_ns > _PAUSE_NS or step_ns < -_DISORDER_NS:
        raise ReplayError(
            f"{where}: the stamps jump by {step_ns / SECOND_NS:+.3f} s; cut the file there and play one part"
        )
    return max(newest_ns, stamp_ns)
