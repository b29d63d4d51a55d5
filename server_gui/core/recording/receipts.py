"""Receipts: what of each batch was found in the store, kept for ever beside the spool.

A line of JSON a batch, synchronised before the spool lets go of the batch. Each begins with a CRC-32 of all
that follows in it and of the CRC before it, so a line that was altered, taken out or put in is found.
"""

import functools
import os
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

import msgspec

from ml.store import durable
from ml.store.private import opener
from server_gui.core.recording.errors import SpoolUnusable

RECEIPTS: Final = "receipts.jsonl"
LOST: Final = "lost"  # how the writer of events ends that tell of a batch which is lost
ANEW: Final = "anew"  # and of those that tell of a store which was begun anew
EVENT_WRITERS: Final = (LOST, ANEW)
_HEAD: Final = '{"crc":"%08x",'
_LENGTH: Final = len(_HEAD % 0)
_TAIL_BYTES: Final = 1 << 20  # of the file, that are read to find its last lines at first
_TAIL_LINES: Final = 2  # one, and the one that it follows


class Stream(msgspec.Struct, frozen=True):
    """Stream of telemetry: the common part of a batch's rows from notification `first` to `last`."""

    robot: str
    session: str
    connection: str
    stream: int
    first: int
    last: int


class Mark(msgspec.Struct, frozen=True, array_like=True):
    """So many rows of a part, with this sum, are from a time on; in µs since 1970."""

    from_us: int
    rows: int
    sum: str


class ReceiptPart(msgspec.Struct, frozen=True, omit_defaults=True):
    """Rows of a batch in one table; of telemetry, those of one stream. `sum` is by `ml.store.checksums`.

    Their times are from `begin_us` to `end_us`, in µs since 1970; None where they have none. Receipts from
    before have none of what follows `stream`.
    """

    location: str
    table: str  # its id, which a copy of the store has too
    rows: int
    sum: str
    begin_us: int | None = None
    end_us: int | None = None
    stream: Stream | None = None
    names: str = ""  # the sum of what names the rows alone
    marks: tuple[Mark, ...] = ()  # so that what retention has left can be counted
    units: dict[str, str | None] = {}  # of columns of its table, as no receipt before it has told them


class Receipt(msgspec.Struct, frozen=True):
    """Rows of a batch in the store `url`; `lost` is the loss by its own damage, in words."""

    writer: str
    batch: int
    url: str
    parts: tuple[ReceiptPart, ...]
    lost: tuple[str, ...] = ()

    @property
    def spool(self) -> str:
        """The id of the spool that it is of."""
        return self.writer.partition("/")[0]

    @property
    def is_of_batch(self) -> bool:
        """Whether it is of a batch itself, and not of an event that tells something of one."""
        return is_of_batch(self.writer)


def is_of_batch(writer: str) -> bool:
    """Return whether that is who brings batches to a store, and not events that tell something of them."""
    return writer.rpartition("/")[2] not in EVENT_WRITERS


@dataclass(frozen=True, slots=True)
class Altered:
    """A line that is not as it was written, or does not follow the one before it."""

    line: int
    text: str


_decoder = msgspec.json.Decoder(Receipt)


class Receipts:
    """The file of a spool's receipts; `add` is for the spool's owner, one thread at a time."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._known: _Known | None = None  # None: nobody has looked yet

    def add(self, receipt: Receipt) -> None:
        """Write it; on the disk when this returns.

        Raises:
            SpoolUnusable: it could not be written.

        """
        try:
            seen = self._seen()
            body = msgspec.json.encode(seen.briefly(receipt))[1:]
            known = self.file.exists()
            with open(self.file, "ab+", opener=opener) as out:
                whole, lines = _tail(out.fileno())
                out.truncate(whole)  # what follows was being written when the power went
                crc = zlib.crc32(body, _stated(lines[-1]))
                out.write((_HEAD % crc).encode() + body + b"\n")
                out.flush()
                os.fsync(out.fileno())
            if not known:
                durable.sync(self.file.parent)
            seen.add(receipt)
        except OSError as error:
            reason = error.strerror or error
            raise SpoolUnusable(f"the spool's receipts {self.file} cannot be written: {reason}") from error

    def begun_anew(self, url: str, parts: Iterable[ReceiptPart]) -> dict[str, str]:
        """Return location and name of another table that others went to than these parts."""
        known = self._seen().tables.get(canonical(url), {})
        now = ((part.location, part.table) for part in parts)
        return {where: known[where] for where, table in now if known.get(where, table) != table}

    def _seen(self) -> "_Known":
        if self._known is None:
            self._known = _Known()
            for receipt in self.whole():
                self._known.add(receipt)
        return self._known

    def whole(self) -> Iterator[Receipt]:
        """Yield those that are as they were written, oldest first."""
        return (each for each in self.all() if isinstance(each, Receipt))

    def newest(self) -> Receipt | None:
        """Return the last one of a batch that is as it was written and follows the line before it."""
        try:
            with self.file.open("rb") as opened:
                _, lines = _tail(opened.fileno())
        except OSError:
            return None
        pairs = zip(reversed(lines[1:]), reversed(lines[:-1]), strict=True)
        found = (_read(line, _stated(before)) for line, before in pairs)
        return next((each for each in found if isinstance(each, Receipt) and each.is_of_batch), None)

    def all(self) -> Iterator[Receipt | Altered]:
        """Yield each line, oldest first."""
        before = 0
        try:
            with self.file.open("rb") as lines:
                for number, line in enumerate(lines, 1):
                    found = _read(line, before)
                    before = _stated(line)
                    yield Altered(number, found) if isinstance(found, str) else found
        except FileNotFoundError:
            return


@functools.lru_cache(100)
def canonical(url: str) -> str:
    """Return a store's URL in one spelling."""
    parts = urlsplit(url)
    if parts.scheme == "file":
        return Path("/" + os.path.normpath(unquote(parts.path)).lstrip("/")).as_uri()
    return f"{parts.scheme}://{parts.netloc}{parts.path.rstrip('/')}"


def went_to(receipts: Iterable[Receipt], url: str) -> list[Receipt]:
    """Return those of what went to this store; however its URL is spelled, and before it was moved there."""
    all_, wanted = list(receipts), canonical(url)
    tables = {part.table for each in all_ if canonical(each.url) == wanted for part in each.parts}
    return [
        each
        for each in all_
        if canonical(each.url) == wanted or not tables.isdisjoint(part.table for part in each.parts)
    ]


def units_told(receipts: Iterable[Receipt]) -> dict[str, dict[str, str | None]]:
    """Return the units of each table's columns, by its id, from the newest receipt with them."""
    known = _Known()
    for receipt in receipts:
        known.add(receipt)
    return known.units


class _Known:
    """Receipts' knowledge of stores and tables, together."""

    def __init__(self) -> None:
        self.tables: dict[str, dict[str, str]] = {}  # of a store: location → id
        self.units: dict[str, dict[str, str | None]] = {}  # of a table's id: column → unit

    def add(self, receipt: Receipt) -> None:
        """Take the tables' present ids; if one was recreated, others may be, too."""
        now = {part.location: part.table for part in receipt.parts if part.rows}
        known = self.tables.setdefault(canonical(receipt.url), {})
        if any(known.get(where, table) != table for where, table in now.items()):
            known.clear()
        known |= now
        for part in receipt.parts:
            if part.units:
                self.units.setdefault(part.table, {}).update(part.units)

    def briefly(self, receipt: Receipt) -> Receipt:
        """Return the receipt without units that were told already."""
        parts = [
            msgspec.structs.replace(part, units=self._new(part)) if part.units else part
            for part in receipt.parts
        ]
        return msgspec.structs.replace(receipt, parts=tuple(parts))

    def _new(self, part: ReceiptPart) -> dict[str, str | None]:
        known = self.units.get(part.table, {})
        return {name: unit for name, unit in part.units.items() if known.get(name, ...) != unit}


def _read(line: bytes, before: int) -> Receipt | str:
    """Return the receipt on a line after one with CRC `before`, or its problem in words."""
    body = line[_LENGTH:].removesuffix(b"\n")
    if not line.endswith(b"\n"):
        return "is cut off"
    if zlib.crc32(body, before) != _stated(line):
        return "is not as it was written, or lines before it are missing"
    try:
        return _decoder.decode(b"{" + body)
    except (msgspec.MsgspecError, ValueError):
        return "is no receipt"


def _stated(line: bytes) -> int:
    """Return the CRC that a line gives; 0 before the first."""
    try:
        return int(line[_LENGTH - 10 : _LENGTH - 2], 16)
    except ValueError:
        return 0


def _tail(descriptor: int) -> tuple[int, list[bytes]]:
    """Return up to where the file has whole lines, and the last of them; before the first one stands b""."""
    size = os.fstat(descriptor).st_size
    begin, rest = size, b""
    lines: list[bytes] = []
    while begin and len(lines) <= _TAIL_LINES:
        begin = max(0, size - 2 * (size - begin) - _TAIL_BYTES)
        *lines, rest = os.pread(descriptor, size - begin, begin).split(b"\n")
    whole = [line + b"\n" for line in (lines[1:] if begin else lines)]
    return size - len(rest), whole if begin else [b"", *whole]
