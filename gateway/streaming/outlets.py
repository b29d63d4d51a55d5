"""Output of a feed: encoded batches, and each subscriber's queue.

An outlet numbers its notifications and, when its client is slow, drops the oldest rows and counts them.
"""

import itertools
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import msgspec

from gateway.connections.session import Session
from gateway.wire import framing
from gateway.wire.stream import STREAM_DATA

_encoder = msgspec.json.Encoder()


class _Notification(msgspec.Struct, frozen=True, omit_defaults=True):
    stream: int
    seq: int
    dropped: int
    stamp_ns: msgspec.Raw
    columns: msgspec.Raw
    shed: int = 1


@dataclass(frozen=True, slots=True)
class Batch:
    """Encoded rows that any number of subscribers share; where `shed` is n, they are one row of n."""

    rows: int
    stamps: msgspec.Raw
    columns: msgspec.Raw
    size: int
    shed: int = 1


def encode_batch(
    stamps: Sequence[int], columns: Mapping[str, Sequence[float | None]], shed: int = 1
) -> Batch:
    """Return rows as they go on the wire; NaN becomes null."""
    stamp_bytes, column_bytes = _encoder.encode(stamps), _encoder.encode(columns)
    size = len(stamp_bytes) + len(column_bytes)
    return Batch(len(stamps), msgspec.Raw(stamp_bytes), msgspec.Raw(column_bytes), size, shed)


class Rate(Protocol):
    """Rate of a feed: of the requested rows, one of `shed`."""

    rate_hz: float
    channels: int
    values_a_second: float
    shed: int


class Outlet:
    """One subscriber of a feed; `most_bytes` is what may wait for it."""

    def __init__(self, number: int, session: Session, feed: Rate, most_bytes: int) -> None:
        self.number = number
        self.session = session
        self.feed = feed
        self.most_bytes = most_bytes
        self.rows = 0  # taken by the client
        self.dropped = 0
        self._seq = itertools.count()
        self._batches: deque[Batch] = deque()
        self._bytes = 0

    def offer(self, batch: Batch) -> None:
        """Take a batch for the client; the oldest make room for it."""
        self._batches.append(batch)
        self._bytes += batch.size
        while self._bytes > self.most_bytes and len(self._batches) > 1:
            self.lose(self._take().rows)

    def lose(self, rows: int) -> None:
        """Count rows that this subscriber never gets."""
        self.dropped += rows

    def next_line(self) -> bytes | None:
        if not self._batches:
            return None
        batch = self._take()
        self.rows += batch.rows
        data = _Notification(
            self.number, next(self._seq), self.dropped, batch.stamps, batch.columns, batch.shed
        )
        return framing.encode_notification(STREAM_DATA, data)

    @property
    def waiting_bytes(self) -> int:
        return self._bytes

    def _take(self) -> Batch:
        batch = self._batches.popleft()
        self._bytes -= batch.size
        return batch
