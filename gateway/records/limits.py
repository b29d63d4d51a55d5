"""Limits of one client's share of the journal: its flood must not push out others' entries.

Each client has two accounts, of entries and of bytes: one for stops and resets, one for all else. Entries
that go beyond are counted, and one entry sums them up (ADR 13).
"""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

import msgspec

Entry = dict[str, Any]

ENTRIES_AT_ONCE: Final = 400  # of one client
ENTRIES_A_SECOND: Final = 20  # what it may write on and on
BYTES_AT_ONCE: Final = 4 * 1024 * 1024
BYTES_A_SECOND: Final = 2 * 1024
CLIENTS: Final = 512  # accounts at a time, two a client; who comes then shares one
NAMES_OF_ONE_ADDRESS: Final = 16  # clients of one address with accounts of their own; those beyond share one
FIELD_BYTES: Final = 16 * 1024  # of one field of an entry, as JSON
WHO_BYTES: Final = 256
LOOK_EVERY_NS: Final = 1_000_000_000 // ENTRIES_A_SECOND  # in less nobody has room for one entry more
SUM_UP_S: Final = 5.0  # what is left out is summed up so often
LEFT_OUT: Final = "not written out"
OWN: Final = frozenset(
    {"gateway", "guard"}
)  # who the gateway itself is called; these hold back by themselves
OTHERS: Final = "clients beyond the first"
_PORT: Final = re.compile(r":[0-9]+(\)?)$")


class Share(Enum):
    """Weight of an entry."""

    OUTCOME = "outcome"  # is written whatever there was before, and counts
    ACT = "act"  # has happened whether it is written or not: stops and resets
    ASKED = "asked"  # is left out; who may not act without it is refused


class TooMany(OSError):
    """An entry that was not written, because its client has written too many."""

    def __init__(self, text: str) -> None:
        super().__init__(None, text)

    def __str__(self) -> str:
        return str(self.strerror)


@dataclass(slots=True)
class _Account:
    """One client's remaining allowance; refilled with time."""

    stamp_ns: int
    entries: float = ENTRIES_AT_ONCE
    size: float = BYTES_AT_ONCE

    def refill(self, now_ns: int) -> None:
        passed_s, self.stamp_ns = (now_ns - self.stamp_ns) / 1e9, now_ns
        self.entries = min(ENTRIES_AT_ONCE, self.entries + passed_s * ENTRIES_A_SECOND)
        self.size = min(BYTES_AT_ONCE, self.size + passed_s * BYTES_A_SECOND)

    @property
    def full(self) -> bool:
        return self.entries >= ENTRIES_AT_ONCE and self.size >= BYTES_AT_ONCE

    def charge(self, size: int) -> None:
        self.entries -= 1
        self.size -= size

    def wait_s(self, size: int) -> float:
        """Return the time until there is room."""
        return max((1 - self.entries) / ENTRIES_A_SECOND, (size - self.size) / BYTES_A_SECOND, 0.0)


@dataclass(slots=True)
class _LeftOut:
    """Entries of one client that were not written."""

    due_ns: int
    counts: dict[str, int] = field(default_factory=dict)

    def entry(self, whose: str) -> Entry:
        """Return it as it is summed up."""
        count = sum(self.counts.values())
        said = f"{count} more of {whose}'s were not written out"
        said += "; what must be written before it is done was refused"
        return {"who": "gateway", "what": LEFT_OUT, "of": whose, "left_out": self.counts, "result": said}


class Limits:
    """All clients' accounts. For one thread at a time."""

    def __init__(self) -> None:
        self._accounts: dict[tuple[str, bool], _Account] = {}
        self._addresses: Counter[str] = Counter()  # how many accounts there are of each, two a client
        self._looked_ns: int | None = None  # when somebody was looked for who can be forgotten
        self._left_out: dict[str, _LeftOut] = {}

    def refusal(self, who: str, what: str, share: Share, size: int, now_ns: int) -> str | None:
        """Return why this entry is not written, in words; it is counted either way."""
        found = self._account(client(who), share, now_ns)
        if found is None:
            return None
        whose, account = found
        wait_s = account.wait_s(size)
        if share is Share.OUTCOME or wait_s == 0:
            account.charge(size)
            return None
        self._leave_out(whose, what, now_ns)
        return (
            f"{whose} has written more than the journal takes of one client ({ENTRIES_A_SECOND} entries and "
            f"{BYTES_A_SECOND} bytes a second on and on); try again in {wait_s:.1f} s"
        )

    def summaries(self, now_ns: int | None) -> list[Entry]:
        """Return the summaries due now; all of them if `now_ns` is `None`."""
        due = [one for one, left in self._left_out.items() if now_ns is None or left.due_ns <= now_ns]
        return [self._left_out.pop(whose).entry(whose) for whose in due]

    def patience_s(self, now_ns: int) -> float | None:
        """Return the time until the next summary; `None` without one."""
        due = min((left.due_ns for left in self._left_out.values()), default=None)
        return None if due is None else max(0, due - now_ns) / 1e9

    def _leave_out(self, whose: str, what: str, now_ns: int) -> None:
        left = self._left_out.setdefault(whose, _LeftOut(now_ns + round(SUM_UP_S * 1e9)))
        left.counts[what] = left.counts.get(what, 0) + 1

    def _account(self, whose: str, share: Share, now_ns: int) -> tuple[str, _Account] | None:
        """Return it with its name; `None` for a stop of who has none, which no stranger can crowd out."""
        key = whose, share is Share.ACT
        if key not in self._accounts and self._addresses[_address(whose)] >= 2 * NAMES_OF_ONE_ADDRESS:
            key = f"others of {_address(whose)}", share is Share.ACT
        if key not in self._accounts and len(self._accounts) >= CLIENTS:
            self._forget_full(now_ns)
            if len(self._accounts) >= CLIENTS and share is Share.ACT:
                return None
            key = key if len(self._accounts) < CLIENTS else (OTHERS, False)
        if key not in self._accounts:
            self._accounts[key] = _Account(now_ns)
            self._addresses[_address(key[0])] += 1
        account = self._accounts[key]
        account.refill(now_ns)
        return key[0], account

    def _forget_full(self, now_ns: int) -> None:
        """Forget who has written nothing for a while, and so has as much as who comes new.

        However many come, all accounts are not looked at for each of them.
        """
        if self._looked_ns is not None and now_ns - self._looked_ns < LOOK_EVERY_NS:
            return
        self._looked_ns = now_ns
        for account in self._accounts.values():
            account.refill(now_ns)
        self._accounts = {key: one for key, one in self._accounts.items() if not one.full}
        self._addresses = Counter(_address(whose) for whose, _is_act in self._accounts)


def client(who: str) -> str:
    """Return the client without its port, which changes with each connection."""
    return _PORT.sub(r"\1", who)


def _address(whose: str) -> str:
    return whose.rpartition("(")[2].rstrip(")")


def within_limits(fields: Entry) -> tuple[Entry, int]:
    """Return the entry with what is too long cut off, which the field `cut` then says.

    And its size as JSON.
    """
    size = _size(fields)
    if size <= WHO_BYTES:
        return fields, size
    cut: dict[str, str] = {}
    short: Entry = {}
    for name, value in fields.items():
        short[name], said = _within(value, WHO_BYTES if name == "who" else FIELD_BYTES)
        if said is not None:
            cut[name] = said
    if not cut:
        return fields, size
    short["cut"] = cut
    return short, _size(short)


def _within(value: Any, most: int) -> tuple[Any, str | None]:
    """As much of a value as has room, and what was cut off."""
    if _size(value) <= most:
        return value, None
    if isinstance(value, Mapping):
        kept = dict(_first(list(value.items()), most))
        return kept, f"{len(value) - len(kept)} of {len(value)} were cut off"
    if isinstance(value, (list, tuple)):
        some = _first(value, most)
        return some, f"{len(value) - len(some)} of {len(value)} were cut off"
    text = str(value)
    begin = _beginning(text, most)
    return begin, f"{len(text) - len(begin)} of {len(text)} characters were cut off"


def _first(items: "list[Any] | tuple[Any, ...]", most: int) -> list[Any]:
    """Return the first of them that have room."""
    left = most - 2
    for count, item in enumerate(items):
        left -= _size(item) + 1
        if left < 0:
            return list(items[:count])
    return list(items)


def _beginning(text: str, most: int) -> str:
    while (size := _size(text)) > most:
        text = text[: len(text) * most // size]
    return text


def _size(value: Any) -> int:
    return len(msgspec.json.encode(value))
