"""Framing of serial formats: frames out of a byte stream that begins anywhere and may be damaged.

A parser does no I/O. `feed` takes bytes as they come and returns the frames they complete; the result does
not depend on where the stream was cut. The memory it keeps is bounded by its format's longest frame.
"""

from collections import deque
from heapq import heappop, heappush
from typing import Generic, Protocol, TypeVar

import msgspec

F = TypeVar("F")


class Counters(msgspec.Struct):
    """Counters of a parser since it was made."""

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
    """Interface of a format's parser for a serial device."""

    @property
    def counters(self) -> Counters: ...

    def feed(self, data: bytes) -> list[F]:
        """Return the frames that `data` completes, in the order of the stream."""
        ...

    def finish(self) -> list[F]:
        """Return the frames that only the end of the stream completes; what remains is dropped.

        What is fed next is another stream: the device may count anew.
        """
        ...


IMPOSSIBLE = 0  # no frame begins here
_ASK, _END = 0, 1  # what is due at a place: a beginning's length is asked for (first), or its frame ends
GRANT = 64  # bytes that may be looked at again for each that comes
SAVED = 1 << 18  # of those, the most that are kept for later


def needs(count: int) -> int:
    """Return the code for a length that needs `count` bytes of the frame to be known."""
    return -count


class FrameScanner(Generic[F]):
    """Base of formats whose frames begin with known bytes and tell their length.

    Every place where a frame could begin is followed at once, and the first one to end with a right
    checksum wins. So a damaged length never holds up the frames behind it.

    Bytes that are made to look like many beginnings cost no more than others: what could be a frame is due
    where it ends, and is looked at as long as all that was looked at is at most `GRANT` times what came.
    Streams of real devices stay far below that.
    """

    sync = b""  # what every frame begins with
    constant_length = 0  # of every frame, where all are equally long
    idle = b""  # bytes between frames that mean nothing and are not counted as dropped

    def __init__(self) -> None:
        self.counters = Counters()
        self.looked_at = 0  # bytes of what could have been frames; a measure of the work
        self._buffer = bytearray()
        self._cut = 0  # bytes that came before the buffer; places are counted from the stream's start
        self._begin_anew()

    def _begin_anew(self) -> None:
        self._ended = self._cut  # where the last valid frame ended; a stream's start counts as one
        self._begin = self._cut  # everything before it is dealt with
        self._searched = self._cut  # everything before it is searched for beginnings
        # A heap: place, what is due there, the frame's beginning, its end.
        self._due: list[tuple[int, int, int, int]] = []
        self._open: deque[int] = deque()  # beginnings in their order, ...
        self._closed: set[int] = set()  # ... those of them that are none after all
        self._granted, self._paid_to = SAVED, self._cut

    def feed(self, data: bytes) -> list[F]:
        """Return the frames that `data` completes, in the order of the stream."""
        self._buffer += data
        frames: list[F] = []
        while (frame := self._in_step()) is not None or (frame := self._next()) is not None:
            frames.append(frame)
        self.counters.frames += len(frames)
        self._trim()
        return frames

    def finish(self) -> list[F]:
        """End of the stream: what remains is dropped."""
        self._drop_until(self._cut + len(self._buffer))
        self._buffer.clear()
        self._cut = 0
        self._begin_anew()
        self._restart()
        return []

    def _restart(self) -> None:
        """Begin another stream."""

    def _length(self, buffer: bytearray, start: int) -> int:
        """Length of the frame that begins at `start` in `buffer`, or `needs(…)`, or IMPOSSIBLE."""
        raise NotImplementedError

    def _looks_behind(self, start: int) -> int:  # noqa: ARG002 - most do not
        """Return the bytes after its end on which the length of the frame at `start` depends."""
        return 0

    def _decode(self, raw: bytes) -> F | None:
        """Return the frame in `raw`; `None`, with the reason counted, where it is not valid."""
        raise NotImplementedError

    def _find(self, buffer: bytearray, start: int, end: int) -> int:
        """Return where the next frame could begin, from `start` and before `end`; −1 for nowhere."""
        return buffer.find(self.sync, start, end + len(self.sync) - 1)

    @property
    def frame_end(self) -> int:
        """Where in the buffer the last valid frame ended."""
        return self._ended - self._cut

    def _in_step(self) -> F | None:
        """Return the frame that begins where the last one ended, if no other could end before it.

        The usual case.
        """
        start, buffer = self._begin - self._cut, self._buffer
        if self._open or self._searched != self._begin or not buffer.startswith(self.sync, start):
            return None
        end = start + (self.constant_length or self._length(buffer, start))
        if not start < end <= len(buffer):
            return None
        if not self.constant_length and self._find(buffer, start + 1, end) >= 0:
            return None
        end += self._cut
        frame = self._look_at(self._begin, end)
        if frame is None:
            self._searched += 1
        else:
            self._begin = self._searched = self._ended = end
        return frame

    def _next(self) -> F | None:
        """Return the valid frame that ends first, if one has ended."""
        end_of_data = self._cut + len(self._buffer)
        while True:
            place = self._due[0][0] if self._due else end_of_data
            if self._discover(min(place, end_of_data)):
                continue  # what begins before the place may be due before it
            if not self._due or place > end_of_data:
                return None
            _, what, start, end = heappop(self._due)
            if what == _ASK:
                self._ask(start)
            elif (frame := self._look_at(start, end)) is not None:
                self._go_on_behind(start, end)
                return frame
            else:
                self._close(start)

    def _discover(self, limit: int) -> bool:
        """Follow the next place before `limit` where a frame could begin, if there is one."""
        if self._searched >= limit:
            return False
        found = self._find(self._buffer, self._searched - self._cut, limit - self._cut)
        if found < 0:
            self._searched = max(self._searched, limit - len(self.sync) + 1)
            return False
        start = self._cut + found
        self._searched = start + 1
        self._open.append(start)
        self._ask(start)
        return True

    def _ask(self, start: int) -> None:
        """Determine the length of the frame at `start`."""
        length = self._length(self._buffer, start - self._cut)
        if length == IMPOSSIBLE:
            self._close(start)
        elif length < 0:
            heappush(self._due, (start - length, _ASK, start, 0))
        else:
            behind = self._looks_behind(start - self._cut)
            heappush(self._due, (start + length + behind, _END, start, start + length))

    def _may_look_at(self, start: int, end: int) -> bool:
        """Return whether what was looked at leaves room for it."""
        if end > self._paid_to:
            self._granted = min(SAVED, self._granted + GRANT * (end - self._paid_to))
            self._paid_to = end
        if end - start > self._granted:
            return False
        self._granted -= end - start
        return True

    def _look_at(self, start: int, end: int) -> F | None:
        if not self._may_look_at(start, end):
            return None
        self.looked_at += end - start
        return self._decode(bytes(self._buffer[start - self._cut : end - self._cut]))

    def _go_on_behind(self, start: int, end: int) -> None:
        """Skip a valid frame: nothing that begins before its end is one."""
        self._drop_until(start)
        self._begin = self._searched = self._ended = end
        self._due.clear()
        self._open.clear()
        self._closed.clear()

    def _close(self, start: int) -> None:
        self._closed.add(start)
        while self._open and self._open[0] in self._closed:
            self._closed.remove(self._open.popleft())

    def _drop_until(self, end: int) -> None:
        if end > self._begin:
            skipped = self._buffer[self._begin - self._cut : end - self._cut]
            self.counters.bytes_dropped += len(skipped.translate(None, self.idle))
            self._begin = end

    def _trim(self) -> None:
        keep = self._open[0] if self._open else self._searched
        self._drop_until(keep)
        if keep > self._cut:
            del self._buffer[: keep - self._cut]
            self._cut = keep


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
        """Begin another stream: any number may come first."""
        self._newest: int | None = None
        self._late = 0
        self._late_run = 0

    def is_late(self, number: int) -> bool:
        """Return whether the frame is a repetition, or older than one before; counts what `number` shows."""
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
        """Return the steps from `before` to `number`; 0 or negative for a repeated or older one."""
        step = (number - before) % self._modulus
        return step if step <= self._modulus // 2 else step - self._modulus

    def _begins_anew(self, number: int) -> bool:
        rising = self._late_run > 0 and self._step(self._late, number) > 0
        self._late, self._late_run = number, self._late_run + 1 if rising else 1
        return self._late_run >= self.LATE_RUN


class DelimitedParser(Generic[F]):
    """Base of formats whose frames end with a delimiter, one byte that occurs nowhere else."""

    delimiter = b"\0"
    longest = 4096  # bytes of a frame without its delimiter; longer ones are dropped

    def __init__(self) -> None:
        self.counters = Counters()
        self._buffer = bytearray()
        self._overlong = False  # the frame that is arriving is too long already

    def feed(self, data: bytes) -> list[F]:
        """Return the frames that `data` completes, in the order of the stream."""
        *ended, rest = data.split(self.delimiter)
        frames: list[F] = []
        for piece in ended:
            self._buffer += piece
            frames += self._take(bytes(self._buffer))
            self._buffer.clear()
        self._buffer += rest
        if len(self._buffer) > self.longest:
            self.counters.bytes_dropped += len(self._buffer)
            self._overlong = True
            self._buffer.clear()
        return frames

    def finish(self) -> list[F]:
        """End of the stream: what remains is a frame whose delimiter is missing, or nothing."""
        frames = self.feed(self.delimiter) if self._buffer else []
        self._overlong = False
        self._restart()
        return frames

    def _restart(self) -> None:
        """Begin another stream."""

    def _decode(self, raw: bytes) -> list[F] | None:
        """Return the frames in `raw`, none for a comment.

        `None`, with the reason counted, where it is not valid.
        """
        raise NotImplementedError

    def _take(self, raw: bytes) -> list[F]:
        overlong = self._overlong or len(raw) > self.longest
        frames = [] if not raw else None if overlong else self._decode(raw)
        self._overlong = False
        if frames is None:
            self.counters.bytes_dropped += len(raw)
            return []
        self.counters.frames += len(frames)
        return frames
