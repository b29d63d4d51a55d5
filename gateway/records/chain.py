"""Lines that hang together: each ends with a hash over itself and over the hash of the line before.

A line is one JSON object whose last two keys are `previous` and `hash` (SHA-256, hexadecimal). The hash is
over the line's bytes up to the key `hash`, so that any other byte, and any missing, moved or added line,
breaks the chain. That lines are missing at the end is seen by the head, which is kept apart.
"""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import msgspec

FIRST = "0" * 64  # what stands in place of the line before the first
# What msgspec raises for bytes that are no such JSON: bad UTF-8 and deep nesting are no `DecodeError`.
UNDECODABLE = (ValueError, RecursionError)
_HASH = b',"hash":"'
_END = b'"}'


class Head(msgspec.Struct, frozen=True):
    """The newest line: its number and hash."""

    n: int = 0
    hash: str = FIRST


class Broken(ValueError):
    """The chain does not hold; the message says where, and `at` the first line that is wrong."""

    def __init__(self, text: str, at: int | None = None) -> None:
        super().__init__(text)
        self.at = at


def line(head: Head, fields: Mapping[str, Any]) -> tuple[bytes, Head]:
    """Return the line that follows `head`, without its newline, and the new head."""
    body = msgspec.json.encode({"n": head.n + 1, **fields, "previous": head.hash})[:-1]
    digest = hashlib.sha256(body).hexdigest()
    return body + _HASH + digest.encode() + _END, Head(head.n + 1, digest)


def check(number: int, previous: str | None, data: bytes) -> tuple[Head, dict[str, Any]]:
    """One line's head and fields; `previous` `None` trusts that the lines before it hold.

    Raises:
        Broken: it is not what was written there.

    """
    body, found, rest = data.rpartition(_HASH)
    digest = hashlib.sha256(body).hexdigest()
    if not found or rest != digest.encode() + _END:
        raise Broken(f"line {number} was altered: its hash does not fit", number)
    try:
        fields = msgspec.json.decode(data, type=dict[str, Any])
        head, follows = Head(fields["n"], digest), (fields["n"], fields["previous"]) == (number, previous)
    except (*UNDECODABLE, KeyError) as error:
        raise Broken(f"line {number} is no entry: {error}", number) from error
    if previous is not None and not follows:
        text = f"line {number} does not follow the line before it: lines were removed, added or moved"
        raise Broken(text, number)
    return head, fields


def verify(lines: Iterable[bytes], head: Head | None, begin: Head | None = None) -> Iterator[dict[str, Any]]:
    """Every line's fields in order, each checked as it is given; `head` is where the lines must get to.

    They follow `begin`, or are the first ones.

    Raises:
        Broken: at the first line that does not hold.

    """
    now = begin or Head()
    reached = head is None or head.n == 0
    for number, data in enumerate(lines, now.n + 1):
        if not data.endswith(b"\n"):
            raise Broken(f"line {number} is cut: it has no end", number)
        now, fields = check(number, now.hash, data[:-1])
        if head is not None and now.n == head.n:
            if now.hash != head.hash:
                text = f"line {number} is not the one that was written there: the head says another"
                raise Broken(text, number)
            reached = True
        yield fields
    if not reached and head is not None:
        raise Broken(f"lines are missing at the end: {head.n} were written, {now.n} are there", now.n + 1)
