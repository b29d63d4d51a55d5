"""Detection of stops: every line whose method can be read as `robot.stop`, whatever its form. Pure.

Where a line is JSON, its method counts, and never what stands in the parameters of another. Where it is none
(cut off, too long, not UTF-8), `"method": "robot.stop"` anywhere in it counts: rather a stop too many.
"""

import re
from collections.abc import Iterator
from typing import Any, Final

import msgspec
from msgspec import UNSET, Raw, UnsetType

from gateway.wire.framing import Id, Line, LineSplitter, StopRequest
from gateway.wire.limits import ID_LENGTH, REASON_LENGTH

STOP: Final = "robot.stop"

_BLANK = bytes(range(33))  # white space, and what no text should hold
_MARKS = (b"stop", b"\\", b"\0")  # one of these is in every line that asks for a stop: letters may be escaped
_SHORTEST = len("method:robot.stop")
_LONGEST_MARK = max(map(len, _MARKS))
_PIECE_BYTES = 16 * 1024  # of a long line, looked at without a pause
_KEPT_BYTES = 160  # of what was dropped: more than a method takes with every letter escaped
_ESCAPED = re.compile(rb"\\u00([2-7][0-9A-Fa-f])")
_METHOD = re.compile(rb"""(?<![\w.])method["']{0,2}:["']{0,2}robot\.stop(?=[^\w.])""")
# What could still be read; each of them ends after so many bytes.
_ID = re.compile(
    rb'"id"\s{0,64}:\s{0,64}("[^"\\]{0,200}"|-?\d{1,40}(?:\.\d{1,40})?(?:[eE][+-]?\d{1,3})?(?![\w.]))'
)
_REASON = re.compile(rb'"reason"\s{0,64}:\s{0,64}"((?:[^"\\]|\\.){0,800})', re.DOTALL)


def stop_in(line: bytes) -> StopRequest | None:
    """Return the stop that a line asks for, in time that grows with its length only."""
    if len(line) < _SHORTEST or not any(mark in line for mark in _MARKS):
        return None  # as nearly all are
    try:
        found = _decode(line)
        # Of a batch, which is refused, only its stop is done.
        return next((_request(one) for one in found if _is_stop(one)), None)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return _read(line) if StopSearch().is_in(line) else None


def _decode(line: bytes) -> list[dict[str, Raw]]:
    """Return the objects of a line, only as far as their keys: numbers by the thousand cost much to read."""
    begins = line.lstrip()[:1]
    each = (
        msgspec.json.decode(line, type=list[Raw]) if begins == b"[" else [msgspec.json.decode(line, type=Raw)]
    )
    objects = (one for one in each if bytes(one).lstrip().startswith(b"{"))
    return [msgspec.json.decode(one, type=dict[str, Raw]) for one in objects]


def _is_stop(found: dict[str, Raw]) -> bool:
    method = found.get("method")
    return method is not None and len(bytes(method)) < _KEPT_BYTES and msgspec.json.decode(method) == STOP


def _request(found: dict[str, Raw]) -> StopRequest:
    known: dict[str, Any] = {
        key: msgspec.json.decode(found[key]) for key in ("params", "id", "jsonrpc") if key in found
    }
    if len(bytes(found.get("id", b""))) > ID_LENGTH:
        known["id"] = None
    return StopRequest(_reason(known.get("params")), _id(known))


def _id(found: dict[str, Any]) -> Id | float | UnsetType:
    if "id" not in found and found.get("jsonrpc") == "2.0":
        return UNSET
    id_ = found.get("id")
    return id_ if isinstance(id_, int | float | str) and not isinstance(id_, bool) else None


def _reason(params: Any) -> str:
    """Return the reason: by name as it should be, or the first of a list, or what there is."""
    if isinstance(params, list):
        params = params[0] if params else None
    if isinstance(params, dict):
        params = params.get("reason")
    return _printable(str(params)) if isinstance(params, str | int | float) else ""


def _printable(text: str) -> str:
    return "".join(one if one.isprintable() else " " for one in text[:REASON_LENGTH])


def _read(line: bytes) -> StopRequest:
    """Return the readable parts of a line that is no JSON."""
    id_, reason = _ID.search(line), _REASON.search(line)
    return StopRequest(
        reason="" if reason is None else _printable(reason[1].decode(errors="replace")),
        id=None if id_ is None else _decoded(id_[1]),
    )


def _decoded(id_: bytes) -> Id | float:
    try:
        found: Id | float = msgspec.json.decode(id_, type=int | float | str)
        return found
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return None


class StopSearch:
    """Looks for a stop in a line that comes in pieces and is not kept."""

    def __init__(self) -> None:
        self._tail = b""

    def is_in(self, line: bytes) -> bool:
        """Return whether a stop is in a whole line."""
        return self.feed(line) or self.end()

    def feed(self, piece: bytes) -> bool:
        """Return whether it is there, with this piece."""
        bare = self._tail + piece.translate(None, _BLANK)
        self._tail = bare[-_KEPT_BYTES:]
        return _METHOD.search(_ESCAPED.sub(_unescape, bare).replace(b"\\", b"")) is not None

    def end(self) -> bool:
        """Return whether it is there, now that the line has ended."""
        return self.feed(b"}")


def _unescape(escaped: "re.Match[bytes]") -> bytes:
    return bytes([int(escaped[1], 16)])


class StopSplitter(LineSplitter):
    """Cuts as `LineSplitter` does; stops come out as such, also one in a line that is too long.

    Such a line is answered once: with its stop as soon as it is found, else at its end, with what is wrong.
    """

    def __init__(self) -> None:
        super().__init__()
        self._suspect = True  # whether there may be a stop in what comes
        self._search: StopSearch | None = None

    def feed(self, data: bytes) -> list[Line]:
        self._suspect = self._may_stop(data)
        return super().feed(data)

    def _may_stop(self, data: bytes) -> bool:
        """Return whether there may be a stop in what these bytes end or hold; costs little."""
        seam = bytes(self._rest[-_LONGEST_MARK:]) + data
        return self._search is not None or any(mark in seam or mark in self._rest for mark in _MARKS)

    def newest_first(self, data: bytes) -> Iterator[StopRequest | None]:
        """Yield the stops in the last that comes, from its end on.

        In between `None`, so often that one can end.
        """
        begin = data.find(b"\n") + 1
        for line in _suspects(data, begin):
            yield from _last_stop(StopSplitter(), line)
        first = data[:begin] or data
        if self._may_stop(first):
            yield from _last_stop(self, first)

    def _take(self, line: bytes, lines: list[Line]) -> None:
        lines.append((stop_in(line) if self._suspect else None) or line)

    def _begin_dropping(self, lines: list[Line]) -> None:  # noqa: ARG002 - it is reported at its end
        self._search = StopSearch()

    def _drop(self, piece: bytes, lines: list[Line]) -> None:
        if self._search is not None and self._search.feed(piece):
            self._search = None
            lines.append(_read(piece))

    def _end_dropping(self, lines: list[Line]) -> None:
        search, self._search = self._search, None
        if search is not None and search.end():
            lines.append(StopRequest())
        elif search is not None:
            super()._begin_dropping(lines)


def _suspects(data: bytes, begin: int) -> Iterator[bytes]:
    """Yield the lines from `begin` on with a mark, the last first; all others cost next to nothing."""
    end = len(data)
    marks = dict.fromkeys(_MARKS, end)
    while begin:
        marks = {mark: at if at < end else data.rfind(mark, begin, end) for mark, at in marks.items()}
        if (found := max(marks.values())) < begin:
            return
        newline = data.find(b"\n", found, end)
        start = data.rfind(b"\n", 0, found) + 1
        yield data[start : end if newline < 0 else newline]
        end = start


def _last_stop(splitter: StopSplitter, line: bytes) -> Iterator[StopRequest | None]:
    """Yield the stop in the last line that this one cuts."""
    *pieces, rest = [line[at : at + _PIECE_BYTES] for at in range(0, len(line), _PIECE_BYTES)] or [b""]
    for piece in pieces:
        yield _newest(splitter.feed(piece))
    yield _newest(splitter.feed(rest) + splitter.end())


def _newest(lines: list[Line]) -> StopRequest | None:
    return next((one for one in reversed(lines) if isinstance(one, StopRequest)), None)
