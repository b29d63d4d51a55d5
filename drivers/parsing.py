"""How every serial format is read: frames out of a byte stream that begins anywhere and may be damaged.

A parser does no I/O. `feed` takes bytes as they come and returns the frames they complete; the result does
not depend on where the stream was cut. The memory it keeps is bounded by its format's longest frame.
"""

from typing import Generic, Protocol, TypeVar

import msgspec

F = TypeVar("F")


class Counters(msgspec.Struct):
    """What a parser has seen since it was made."""

    frames: int = 0  # valid ones
    bytes_dropped: int = 0  # bytes that are part of no valid frame
    bad_checksums: int = 0
    malformed: int = 0  # checksum right (or none), contents impossible
    sequence_gaps: int = 0  # places where frames are missing
    frames_missed: int = 0  # frames missing at those places
    out_of_order: int = 0  # repeated, or older than one already seen
    saturated: int = 0  # frames in which a value is at the end of its range

    def as_dict(self) -> dict[str, int]:
        return msgspec.structs.asdict(self)


class Parser(Protocol[F]):
    """What a serial device needs of a format."""

    @property
    def counters(self) -> Counters: ...

    def feed(self, data: bytes) -> list[F]:
        """The frames that `data` completes, in the order of the stream."""
        ...

    def finish(self) -> list[F]:
        """The frames that only the end of the stream completes; what remains is dropped.

        What is fed next is another stream: the device may count anew.
        """
        ...


UNKNOWN = 0  # more bytes are needed to know the length
IMPOSSIBLE = -1  # no frame begins here


class FrameScanner(Generic[F]):
    """Base of formats whose frames begin with known bytes and tell their length.

    Every place where a frame could begin is followed at once, and the first one to end with a right
    checksum wins. So a damaged length never holds up the frames behind it.
    """

    sync = b""  # what every frame begins with
    constant_length = 0  # of every frame, where all are equally long
    idle = b""  # bytes between frames that mean nothing and are not counted as dropped

    def __init__(self) -> None:
        self.counters = Counters()
        self._buffer = bytearray()
        self.frame_end = 0  # where the last valid frame ended; a stream's start counts as one
        self._begin = 0  # everything before it is dealt with
        self._searched = 0  # everything before it is searched for beginnings
        self._candidates: list[int] = []

    def feed(self, data: bytes) -> list[F]:
        """The frames that `data` completes, in the order of the stream."""
        self._buffer += data
        frames: list[F] = []
        while (found := self._in_step() or self._first_complete()) is not None:
            start, end = found
            frame = self._decode(bytes(self._buffer[start:end]))
            if frame is None:
                self._candidates.remove(start)
                continue
            self._drop_until(start)
            self._begin = self._searched = self.frame_end = end
            self._candidates.clear()
            self.counters.frames += 1
            frames.append(frame)
        self._trim()
        return frames

    def finish(self) -> list[F]:
        """End of the stream: what remains is dropped."""
        self._drop_until(len(self._buffer))
        self._buffer.clear()
        self._candidates.clear()
        self._begin = self._searched = self.frame_end = 0
        self._restart()
        return []

    def _restart(self) -> None:
        """Another stream begins."""

    def _length(self, buffer: bytearray, start: int) -> int:
        """Length of the frame that begins at `start`, or UNKNOWN, or IMPOSSIBLE."""
        raise NotImplementedError

    def _decode(self, raw: bytes) -> F | None:
        """The frame in `raw`; `None`, with the reason counted, where it is not valid."""
        raise NotImplementedError

    def _find(self, buffer: bytearray, start: int, end: int) -> int:
        """Where the next frame could begin, from `start` and before `end`; −1 for nowhere."""
        return buffer.find(self.sync, start, end + len(self.sync) - 1)

    def _in_step(self) -> tuple[int, int] | None:
        """The frame that begins where the last one ended, if no other could end before it: the usual case."""
        start, buffer = self._begin, self._buffer
        if self._candidates or self._searched != start or not buffer.startswith(self.sync, start):
            return None
        end = start + (self.constant_length or self._length(buffer, start))
        if not start < end <= len(buffer):
            return None
        if not self.constant_length and self._find(buffer, start + 1, end) >= 0:
            return None
        self._candidates.append(start)
        self._searched = start + 1
        return start, end

    def _first_complete(self) -> tuple[int, int] | None:
        """Start and end of the candidate that ends first, if any has ended."""
        best: tuple[int, int] | None = None
        index = 0
        limit = len(self._buffer)  # what begins behind the best one's end cannot end before it
        while index < len(self._candidates) or self._discover(limit):
            start = self._candidates[index]
            if start >= limit:
                break
            length = self._length(self._buffer, start)
            if length == IMPOSSIBLE:
                del self._candidates[index]
                continue
            end = start + length
            if length != UNKNOWN and (end < limit or (best is None and end == limit)):
                best, limit = (start, end), end
            index += 1
        return best

    def _discover(self, limit: int) -> bool:
        """Follow the next place before `limit` where a frame could begin, if there is one."""
        start = self._find(self._buffer, self._searched, limit)
        if start < 0:
            self._searched = max(self._searched, limit - len(self.sync) + 1)
            return False
        self._candidates.append(start)
        self._searched = start + 1
        return True

    def _drop_until(self, end: int) -> None:
        if end > self._begin:
            skipped = bytes(self._buffer[self._begin : end])
            self.counters.bytes_dropped += len(skipped.strip(self.idle) if self.idle else skipped)
            self._begin = end

    def _trim(self) -> None:
        keep = self._candidates[0] if self._candidates else self._searched
        self._drop_until(keep)
        if keep:
            del self._buffer[:keep]
            self._candidates = [start - keep for start in self._candidates]
            self._searched -= keep
            self.frame_end -= keep
            self._begin = 0


class Sequence:
    """Follows a device's wrapping frame counter, and tells late frames from missing ones.

    `LATE_RUN` late frames in rising order mean that the device counts anew: the last of them is not late.
    """

    LATE_RUN = 8

    def __init__(self, counters: Counters, modulus: int, gaps: bool = True) -> None:
        self._counters = counters
        self._modulus = modulus
        self._gaps = gaps  # a time has none: only its order tells anything
        self.restart()

    def restart(self) -> None:
        """Another stream begins: any number may come first."""
        self._newest: int | None = None
        self._late = 0
        self._late_run = 0

    def is_late(self, number: int) -> bool:
        """Whether the frame is a repetition or older than one before it; counts what `number` shows."""
        if self._newest is None or number == (self._newest + 1) % self._modulus:  # as it mostly is
            self._newest, self._late_run = number, 0
            return False
        step = self._step(self._newest, number)
        if step <= 0 and not self._begins_anew(number):
            self._counters.out_of_order += 1
            return True
        if step > 1 and self._gaps:
            self._counters.sequence_gaps += 1
            self._counters.frames_missed += step - 1
        self._newest, self._late_run = number, 0
        return False

    def _step(self, before: int, number: int) -> int:
        """How far `number` is ahead of `before`; 0 or negative for a repeated or older one."""
        step = (number - before) % self._modulus
        return step if step <= self._modulus // 2 else step - self._modulus

    def _begins_anew(self, number: int) -> bool:
        rising = self._late_run > 0 and self._step(self._late, number) > 0
        self._late, self._late_run = number, self._late_run + 1 if rising else 1
        return self._late_run >= self.LATE_RUN


class DelimitedParser(Generic[F]):
    """Base of formats whose frames end with a delimiter that occurs nowhere else."""

    delimiter = b"\0"
    longest = 4096  # bytes of a frame without its delimiter; longer ones are dropped

    def __init__(self) -> None:
        self.counters = Counters()
        self._buffer = bytearray()
        self._overlong = False  # the frame that is arriving is too long already

    def feed(self, data: bytes) -> list[F]:
        """The frames that `data` completes, in the order of the stream."""
        self._buffer += data
        *complete, rest = bytes(self._buffer).split(self.delimiter)
        frames = [frame for raw in complete for frame in self._take(raw)]
        if len(rest) > self.longest:
            self.counters.bytes_dropped += len(rest)
            self._overlong, rest = True, b""
        self._buffer[:] = rest
        return frames

    def finish(self) -> list[F]:
        """End of the stream: what remains is a frame whose delimiter is missing, or nothing."""
        frames = self.feed(self.delimiter) if self._buffer else []
        self._restart()
        return frames

    def _restart(self) -> None:
        """Another stream begins."""

    def _decode(self, raw: bytes) -> list[F] | None:
        """The frames in `raw`, none for a comment; `None`, with the reason counted, where it is not valid."""
        raise NotImplementedError

    def _take(self, raw: bytes) -> list[F]:
        frames = [] if not raw else None if self._overlong else self._decode(raw)
        self._overlong = False
        if frames is None:
            self.counters.bytes_dropped += len(raw)
            return []
        self.counters.frames += len(frames)
        return frames
