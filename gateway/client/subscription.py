"""A stream that outlives its link: batches in order, every loss counted."""

import asyncio
import collections
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from gateway.client.errors import ClientError
from gateway.wire.stream import StreamData, StreamStartParams


@dataclass(frozen=True, slots=True)
class Batch:
    """One notification of a stream: rows in time order, one column a channel.

    `columns[name][i]` belongs to `stamps_ns[i]` on the robot's monotonic clock, in the channel's unit; None
    where the value was missing or stale.
    """

    stamps_ns: list[int]
    columns: dict[str, list[float | None]]
    seq: int
    dropped: int  # rows that the robot threw away on this link until now
    missed: int  # notifications that are missing just before this one
    link: int  # connections made until now: when it grows, time has passed unseen
    received_ns: int  # our monotonic clock
    shed: int = 1  # the robot sends one row of so many, because it keeps to its budget

    def rows(self) -> Iterator[tuple[int, dict[str, float | None]]]:
        """Yield each row as its stamp and its values by channel."""
        for index, stamp_ns in enumerate(self.stamps_ns):
            yield stamp_ns, {name: column[index] for name, column in self.columns.items()}


@dataclass(slots=True)
class StreamCounters:
    """Counters of received and missing data since the subscription began."""

    notifications: int = 0
    rows: int = 0
    missed: int = 0  # notifications that never came (holes in `seq`)
    dropped: int = 0  # rows that the robot threw away because we read too slowly
    overflowed: int = 0  # notifications thrown away here because nobody took them
    restarts: int = 0  # times that the stream was started again on a new link


class Subscription:
    """An asynchronous iterator over `Batch`es; use it as `async with client.subscribe(…) as stream`.

    Order is kept within a link. When the link drops the iterator waits, the stream is started again on the
    next link, and `Batch.link` tells that time may have passed in between. At most `depth` batches wait
    here; then the oldest are thrown away and counted in `counters.overflowed`. Iteration ends when the
    subscription or its client is closed, and raises what ended it otherwise: a `RemoteError` when the robot
    refuses the stream.
    """

    def __init__(self, request: StreamStartParams, depth: int) -> None:
        self.request = request
        self.counters = StreamCounters()
        self.newest_stamp_ns: int | None = None
        self.received_ns: int | None = None
        self.stream: int | None = None
        self._waiting: collections.deque[Batch] = collections.deque(maxlen=depth)
        self._wake = asyncio.Event()
        self._ended: ClientError | StopAsyncIteration | None = None
        self._link = 0
        self._last_seq: int | None = None
        self._dropped_before = 0

    @property
    def age_s(self) -> float | None:
        """Seconds since something came, None before the first time."""
        return None if self.received_ns is None else (time.monotonic_ns() - self.received_ns) / 1e9

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Batch:
        while not self._waiting:
            if self._ended is not None:
                raise self._ended
            self._wake.clear()
            await self._wake.wait()
        return self._waiting.popleft()

    async def next_within(self, idle_s: float | None) -> Batch:
        """Return the next batch, or one without rows where none comes within `idle_s`."""
        try:
            async with asyncio.timeout(idle_s):
                return await self.__anext__()
        except TimeoutError:
            return Batch([], {}, self._last_seq or 0, 0, 0, self._link, time.monotonic_ns())

    # --- what the link calls

    def restarted(self, stream: int, link: int) -> None:
        """Continue the stream on a new link under a new name; `seq` and `dropped` restart."""
        self.stream = stream
        self.counters.restarts += self._link != 0
        self._link = link
        self._last_seq = None
        self._dropped_before = self.counters.dropped

    def feed(self, data: StreamData, received_ns: int) -> None:
        """Take one notification: count what is missing before it, then queue it."""
        missed = 0 if self._last_seq is None else max(0, data.seq - self._last_seq - 1)
        self._last_seq = data.seq
        self.received_ns = received_ns
        if data.stamp_ns:
            self.newest_stamp_ns = data.stamp_ns[-1]
        counters = self.counters
        counters.notifications += 1
        counters.rows += len(data.stamp_ns)
        counters.missed += missed
        counters.dropped = self._dropped_before + data.dropped
        counters.overflowed += len(self._waiting) == self._waiting.maxlen
        self._waiting.append(
            Batch(
                data.stamp_ns,
                data.columns,
                data.seq,
                data.dropped,
                missed,
                self._link,
                received_ns,
                data.shed,
            )
        )
        self._wake.set()

    def end(self, reason: ClientError | None = None) -> None:
        """Let the iterator finish, with `reason` as its exception if there is one."""
        if self._ended is None:
            self._ended = reason or StopAsyncIteration()
            self._wake.set()
