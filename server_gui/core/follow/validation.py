"""The one door for what a robot sends: looked at before it is kept, shown, counted or predicted from.

What does not pass raises `Unfit` and is as if it had never come. A robot may lie; no other one notices.
"""

import contextlib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import msgspec

from gateway.client import Batch, ProtocolError
from gateway.plain_text import LONGEST_NAME, NAME_SIGNS, ROBOT_SIGNS, is_name, is_robot_name
from gateway.wire.control import SignedHead
from gateway.wire.robot import Description
from server_gui.core.follow.events import (
    Described,
    Event,
    Identified,
    Journalled,
    Looked,
    Resources,
    Telemetry,
)

MOST_ROWS: Final = 10_000  # of one notification: a gateway sends what came in milliseconds
IN_ENTRIES: Final = range(-(2**63), 2**64)  # what a device's object can hold; kept as text
NUMBERS: Final = range(-(2**62), 2**62)  # what is kept in 8 bytes, and may be added up in them
COUNTS: Final = range(2**53)  # that every reader of JSON takes
MOST_COLUMNS: Final = 4096  # that one robot may put into the store's table while this program runs
MOST_LAYOUTS: Final = 1024  # sets of columns that come together, of one description
MOST_ENTRIES: Final = 1000  # of a journal at once; as many as a gateway gives
LONGEST_UNIT: Final = 32
LONGEST_HASH: Final = 128
LONGEST_TEXT: Final = 1024  # who, what, boot id, version
MOST_BYTES: Final = {Described: 8 << 20, Resources: 4 << 20, Looked: 4 << 20}
ENTRY_BYTES: Final = 64 << 10
FAR_NS: Final = 366 * 86_400 * 1_000_000_000  # a row that is further from now has a wrong stamp
DEEPEST: Final = 16  # values within values


class Unfit(ProtocolError):
    """A robot's data cannot be recorded; with the field and the reason."""


class Validator:
    """Validation of one robot's data, against its earlier data; for the thread that follows it."""

    def __init__(self) -> None:
        self._channels: frozenset[str] = frozenset()
        self._columns: set[tuple[str, str]] = set()  # names and units, of all descriptions until now
        self._layouts: set[tuple[str, ...]] = set()

    def check(self, event: Event) -> None:
        """Look at what a feed is about to tell.

        Raises:
            Unfit: it is to be told to nobody.

        """
        match event:
            case Telemetry():
                self._telemetry(event)
            case Described():
                self._described(event.description)
                if event.hello is not None:
                    _text("who we are", event.hello.who, LONGEST_TEXT)
                    _sound("its greeting", event.hello, MOST_BYTES[Looked])
            case Resources():
                _sound("the look at its computer", event.snapshot, MOST_BYTES[Resources])
            case Looked():
                _sound("its parameters", event.parameters, MOST_BYTES[Looked])
                _sound("its components' quality", event.quality, MOST_BYTES[Looked])
            case Identified():
                _sound("what its devices are", event.devices, MOST_BYTES[Looked])
            case Journalled():
                journal(event.journal.entries)
                if event.head is not None:
                    _head(event.head, event.journal.entries)
            case _:
                pass

    def _described(self, description: Description) -> None:
        names = [
            *(("a component", part.name) for part in description.components),
            *(("a channel", channel.name) for channel in description.channels),
            *(("a parameter", parameter.name) for parameter in description.parameters),
        ]
        for what, given in names:
            name(what, given)
        if not is_robot_name(description.robot):
            raise _no_name("the robot", description.robot, ROBOT_SIGNS)
        for channel in description.channels:
            _text(f"the unit of {channel.name}", channel.unit, LONGEST_UNIT)
        _text("the boot id", description.boot_id, LONGEST_TEXT)
        _text("the version", description.version or "", LONGEST_TEXT)
        _sound("its description", description, MOST_BYTES[Described])
        columns = self._columns | {(channel.name, channel.unit) for channel in description.channels}
        if len(columns) > MOST_COLUMNS:
            raise Unfit(
                f"its descriptions name more than {MOST_COLUMNS} different channels, each a column of the "
                "store for ever; give it fewer, or the same ones at every start"
            )
        self._columns = columns
        self._channels = frozenset(channel.name for channel in description.channels)
        self._layouts.clear()

    def _telemetry(self, event: Telemetry) -> None:
        columns = tuple(event.batch.columns)
        batch(event.stream, event.batch)
        if columns not in self._layouts:
            self._layout(columns)
        offset_ns = 0 if event.clock is None else event.clock.offset_ns
        stamps_ns = event.batch.stamps_ns
        if event.clock is None or not stamps_ns:
            return
        earliest, latest = min(stamps_ns) - offset_ns, max(stamps_ns) - offset_ns
        if earliest < event.batch.received_ns - FAR_NS or latest > event.batch.received_ns + FAR_NS:
            raise Unfit("a row is stamped more than a year from now; is the robot's clock broken?")

    def _layout(self, columns: tuple[str, ...]) -> None:
        strange = [channel for channel in columns if channel not in self._channels]
        if strange:
            raise Unfit(
                f"rows have {len(strange)} channels that it never described, such as {strange[0]!r:.80}"
            )
        if len(self._layouts) >= MOST_LAYOUTS:
            raise Unfit(f"rows come with more than {MOST_LAYOUTS} different sets of channels")
        self._layouts.add(columns)


def name(what: str, given: str) -> None:
    """Refuse what is no name."""
    if not is_name(given):
        raise _no_name(what, given, NAME_SIGNS)


def _no_name(what: str, given: str, signs: str) -> Unfit:
    return Unfit(f"{given!r:.80} is no name of {what}: {signs} only, at most {LONGEST_NAME} of them")


def batch(stream: int, given: Batch) -> None:
    """Refuse rows that are not whole, or have numbers that 8 bytes do not hold, or values that are none."""
    rows = len(given.stamps_ns)
    if rows > MOST_ROWS:
        raise Unfit(f"{rows} rows in one notification; {MOST_ROWS} are the most that are taken at once")
    for length in set(map(len, given.columns.values())) - {rows}:
        raise Unfit(f"{rows} stamps, but {length} values of a channel")
    if not all(number in NUMBERS for number in (stream, given.seq, *given.stamps_ns)):
        raise Unfit("a stamp, or another number, is larger than 8 bytes hold")
    if given.seq < 0 or not all(count in COUNTS for count in (given.dropped, given.missed, given.shed)):
        raise Unfit("a count of notifications or rows is negative, or larger than can be")
    for channel, values in given.columns.items():
        if not _are_numbers(values):
            raise Unfit(f"a value of {channel!r:.80} is no number, or infinite")


def _are_numbers(values: Sequence[float | None]) -> bool:
    """Return whether each is finite or missing."""
    with contextlib.suppress(TypeError, OverflowError):
        quickly = math.isfinite(sum(filter(None, values)))  # large ones may add up to what is not
        return quickly or all(value is None or math.isfinite(value) for value in values)
    return False


def journal(entries: Sequence[Mapping[str, Any]]) -> None:
    """Refuse entries of a robot's journal that no journal has."""
    if len(entries) > MOST_ENTRIES:
        raise Unfit(f"{len(entries)} entries of its journal at once; at most {MOST_ENTRIES} are asked for")
    before = 0
    for entry in entries:
        before = _entry(entry, before)


def _head(head: SignedHead, entries: Sequence[Mapping[str, Any]]) -> None:
    """Refuse what a robot has signed where it has just shown another entry in that place."""
    found = next((entry["hash"] for entry in entries if entry["n"] == head.n), head.hash)
    if found != head.hash:
        raise Unfit(f"it has signed another entry {head.n} of its journal than it shows")
    _sound("what it has signed of its journal", head, ENTRY_BYTES)


def _entry(entry: Mapping[str, Any], before: int) -> int:
    """Look at an entry that comes after number `before`; its own number."""
    number, digest = entry.get("n"), entry.get("hash")
    if number is None or digest is None:
        raise Unfit("the robot's journal has entries without a number or a hash")
    if type(number) is not int or number not in NUMBERS or number <= before:
        raise Unfit(f"its journal has an entry with the number {number!r:.80} after {before}")
    where = f"entry {number} of its journal"
    if not isinstance(digest, str) or not digest:
        raise Unfit(f"the hash of {where} is no text")
    _text(f"the hash of {where}", digest, LONGEST_HASH)
    if entry.get("utc_ns") is not None and type(entry["utc_ns"]) is not int:
        raise Unfit(f"the time of {where} is no whole number of nanoseconds")
    for key in ("who", "what"):
        said = entry.get(key)
        if said is not None and not isinstance(said, str):
            raise Unfit(f"`{key}` of {where} is no text")
        if said is not None and len(said) > LONGEST_TEXT:
            raise Unfit(f"`{key}` of {where} is longer than {LONGEST_TEXT} letters")
    _sound(where, entry, ENTRY_BYTES, IN_ENTRIES)
    return number


def _text(what: str, given: str, longest: int) -> None:
    if len(given) > longest or not (given.isprintable()):
        raise Unfit(
            f"{what} is longer than {longest} letters, or has letters that cannot be printed: {given!r:.80}"
        )


def _sound(what: str, given: object, most_bytes: int, numbers: range = NUMBERS) -> None:
    """Refuse what is too large, too deep, or has numbers that are not finite or need more than 8 bytes."""
    try:
        plain = msgspec.to_builtins(given)
        _numbers(what, (plain,), DEEPEST, numbers)
        size = len(msgspec.json.encode(plain))
    except (RecursionError, ValueError, TypeError, OverflowError, msgspec.MsgspecError) as error:
        raise Unfit(f"{what} cannot be written down: {error}") from error
    if size > most_bytes:
        raise Unfit(f"{what} takes {size} bytes; at most {most_bytes} are kept")


def _numbers(what: str, values: Iterable[object], deeper: int, numbers: range) -> None:
    for value in values:
        kind = type(value)
        if kind is str or value is None or kind is bool:
            continue
        if isinstance(value, float):
            if not math.isfinite(value):
                raise Unfit(f"{what} has a number that is not finite")
        elif kind is int:
            if value not in numbers:
                raise Unfit(f"{what} has a number that is larger than 8 bytes hold")
        elif not deeper:
            raise Unfit(f"{what} has values within values, more than {DEEPEST} deep")
        else:
            _numbers(what, value.values() if isinstance(value, dict) else _all(value), deeper - 1, numbers)


def _all(values: object) -> Iterable[object]:
    return values if isinstance(values, Iterable) else ()
