"""Streams: samples become rows, rows become batches, a batch is encoded once for all who asked for the same.

A feed belongs to everybody with the same channels and rate. Each subscriber has an outlet that numbers its
notifications and, when its client is slow, drops the oldest rows and counts them.
"""

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import msgspec

from drivers.samples import Sample
from gateway import wire
from gateway.loop import Loop, Timer
from gateway.messages import STREAM_DATA
from gateway.session import Session
from gateway.sources import Selection

BATCH_S = 0.010  # ticks faster than this travel together
GATHER_S = 0.002  # how long a source's own samples wait for company
OUTLET_BYTES = 1024 * 1024  # what waits for one slow subscriber
CATCH_UP_S = 1.0  # ticks missed for longer than this are lost, not made up
TAP_SAMPLES = 10_000  # what one source may have waiting; the loop empties it every few milliseconds

_encoder = msgspec.json.Encoder()


class _Notification(msgspec.Struct, frozen=True):
    stream: int
    seq: int
    dropped: int
    stamp_ns: msgspec.Raw
    columns: msgspec.Raw


@dataclass(frozen=True, slots=True)
class Batch:
    """Encoded rows that any number of subscribers share."""

    rows: int
    stamps: msgspec.Raw
    columns: msgspec.Raw
    size: int


def encode_batch(stamps: Sequence[int], columns: dict[str, Sequence[float | None]]) -> Batch:
    """Rows as they go on the wire; NaN becomes null."""
    stamp_bytes, column_bytes = _encoder.encode(stamps), _encoder.encode(columns)
    size = len(stamp_bytes) + len(column_bytes)
    return Batch(len(stamps), msgspec.Raw(stamp_bytes), msgspec.Raw(column_bytes), size)


class Outlet:
    """One subscriber of a feed."""

    def __init__(self, number: int, session: Session) -> None:
        self.number = number
        self.session = session
        self._seq = itertools.count()
        self._dropped = 0
        self._batches: deque[Batch] = deque()
        self._bytes = 0

    def offer(self, batch: Batch) -> None:
        """Take a batch for the client; the oldest make room for it."""
        self._batches.append(batch)
        self._bytes += batch.size
        while self._bytes > OUTLET_BYTES and len(self._batches) > 1:
            self.lose(self._take().rows)

    def lose(self, rows: int) -> None:
        """Count rows that this subscriber never gets."""
        self._dropped += rows

    def next_line(self) -> bytes | None:
        if not self._batches:
            return None
        batch = self._take()
        data = _Notification(self.number, next(self._seq), self._dropped, batch.stamps, batch.columns)
        return wire.encode_notification(STREAM_DATA, data)

    def _take(self) -> Batch:
        batch = self._batches.popleft()
        self._bytes -= batch.size
        return batch


class Tap:
    """The samples of one source on their way from its thread to the loop."""

    def __init__(self, selection: Selection, filled: Callable[[], None]) -> None:
        self.selection = selection
        self._filled = filled
        self._samples: list[Sample] = []
        self._lost = 0
        self._lock = threading.Lock()
        self._end = selection.source.subscribe(self._receive)

    def close(self) -> None:
        self._end()

    def drain(self) -> tuple[list[Sample], int]:
        """The samples since the last call, oldest first, and how many more were lost."""
        with self._lock:
            samples, self._samples = self._samples, []
            lost, self._lost = self._lost, 0
        return samples, lost

    def _receive(self, sample: Sample) -> None:
        with self._lock:
            first = not self._samples
            if len(self._samples) < TAP_SAMPLES:
                self._samples.append(sample)
            else:
                self._lost += 1
        if first:
            self._filled()


class Feed:
    """What every feed does: taps in, batches out, closed with its last subscriber."""

    def __init__(self, loop: Loop, selections: Sequence[Selection], filled: Callable[[], None]) -> None:
        self.outlets: list[Outlet] = []
        self._loop = loop
        self._closed = False
        self._timer: Timer | None = None
        self._taps = [Tap(selection, filled) for selection in selections]

    def close(self) -> None:
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        for tap in self._taps:
            tap.close()

    def _give(self, batch: Batch) -> None:
        for outlet in tuple(self.outlets):
            outlet.offer(batch)
            outlet.session.pump()

    def _lose(self, rows: int) -> None:
        for outlet in self.outlets:
            outlet.lose(rows)


class TickFeed(Feed):
    """Rows at a steady rate. Each cell is the newest sample at its tick, null once stale.

    Samples carry their stamps, so a row is right also when the loop comes to it late.
    """

    def __init__(self, loop: Loop, selections: Sequence[Selection], rate_hz: float) -> None:
        super().__init__(loop, selections, filled=lambda: None)
        self._period_ns = round(1e9 / rate_hz)
        self._ticks_per_batch = max(1, round(BATCH_S * rate_hz))
        self._next_ns = time.monotonic_ns()
        self._cells: list[tuple[int, float | None] | None] = []
        self._stale_after_ns: list[int] = []
        self._names: list[str] = []
        self._places: list[dict[int, int]] = []  # for each tap: index in its source → cell
        for selection in selections:
            self._add(selection)
        self._timer = loop.call_later(0.0, self._tick)

    def _add(self, selection: Selection) -> None:
        latest = selection.source.latest
        self._places.append({index: len(self._cells) + i for i, index in enumerate(selection.indices)})
        for index in selection.indices:
            value, stamp_ns = latest.read(index, self._next_ns)
            self._cells.append(None if stamp_ns is None else (stamp_ns, value))
            self._stale_after_ns.append(latest.stale_after_ns)
        self._names += selection.names

    def _tick(self) -> None:
        if self._closed:
            return
        now_ns = time.monotonic_ns()
        self._skip_what_is_too_old(now_ns)
        self._forget_what_is_gone()
        rows: list[list[float | None]] = []
        stamps: list[int] = []
        updates = iter(self._drained())
        update = next(updates, None)
        while self._next_ns <= now_ns:
            while update is not None and update[0] <= self._next_ns:
                self._apply(*update)
                update = next(updates, None)
            stamps.append(self._next_ns)
            rows.append(self._row(self._next_ns))
            self._next_ns += self._period_ns
        while update is not None:  # newer than the last tick: for the next one
            self._apply(*update)
            update = next(updates, None)
        if rows:
            self._give(encode_batch(stamps, dict(zip(self._names, zip(*rows, strict=True), strict=True))))
        last_of_batch_ns = self._next_ns + (self._ticks_per_batch - 1) * self._period_ns
        self._timer = self._loop.call_later((last_of_batch_ns - time.monotonic_ns()) / 1e9, self._tick)

    def _skip_what_is_too_old(self, now_ns: int) -> None:
        late = (now_ns - self._next_ns - round(CATCH_UP_S * 1e9)) // self._period_ns
        if late > 0:
            self._next_ns += late * self._period_ns
            self._lose(late)

    def _forget_what_is_gone(self) -> None:
        """What a source has cleared, as after a lost port, is not shown until it is stale."""
        for tap, places in zip(self._taps, self._places, strict=True):
            if tap.selection.source.latest.updated_ns is None:
                for cell in places.values():
                    self._cells[cell] = None

    def _drained(self) -> list[tuple[int, Sample, dict[int, int]]]:
        updates = [
            (sample.stamp_ns, sample, places)
            for tap, places in zip(self._taps, self._places, strict=True)
            for sample in tap.drain()[0]
        ]
        updates.sort(key=lambda update: update[0])
        return updates

    def _apply(self, stamp_ns: int, sample: Sample, places: dict[int, int]) -> None:
        for index, value in zip(sample.indices, sample.values, strict=True):
            cell = places.get(index)
            if cell is not None:
                self._cells[cell] = (stamp_ns, value)

    def _row(self, tick_ns: int) -> list[float | None]:
        return [
            None if cell is None or tick_ns - cell[0] > stale_after_ns else cell[1]
            for cell, stale_after_ns in zip(self._cells, self._stale_after_ns, strict=True)
        ]


class SampleFeed(Feed):
    """Every source's own samples, one source a notification, as they come.

    Samples with different channels travel apart, so that no null means "not in this sample".
    """

    def __init__(self, loop: Loop, selections: Sequence[Selection]) -> None:
        super().__init__(loop, selections, filled=lambda: loop.post(self._filled))

    def _filled(self) -> None:
        if self._timer is None and not self._closed:
            self._timer = self._loop.call_later(GATHER_S, self._flush)

    def _flush(self) -> None:
        self._timer = None
        for tap in self._taps:
            samples, lost = tap.drain()
            if lost:
                self._lose(lost)
            for indices, group in itertools.groupby(samples, key=lambda sample: sample.indices):
                self._send(tap.selection, indices, list(group))

    def _send(self, selection: Selection, indices: tuple[int, ...], samples: list[Sample]) -> None:
        channels = selection.source.channels
        columns: dict[str, Sequence[float | None]] = {
            channels[index].name: [sample.values[place] for sample in samples]
            for place, index in enumerate(indices)
            if index in selection.indices
        }
        if columns:
            self._give(encode_batch([sample.stamp_ns for sample in samples], columns))


class Streams:
    """All streams of the gateway."""

    def __init__(self, loop: Loop) -> None:
        self._loop = loop
        self._numbers = itertools.count(1)
        self._feeds: dict[tuple[float, tuple[str, ...]], Feed] = {}

    def start(self, session: Session, selections: Iterable[Selection], rate_hz: float) -> int:
        """Subscribe a session; its connection's end ends the stream. Returns the stream's number."""
        chosen = list(selections)
        key = (rate_hz, tuple(name for selection in chosen for name in selection.names))
        feed = self._feeds.get(key)
        if feed is None:
            feed = TickFeed(self._loop, chosen, rate_hz) if rate_hz else SampleFeed(self._loop, chosen)
            self._feeds[key] = feed
        outlet = Outlet(next(self._numbers), session)
        feed.outlets.append(outlet)
        if not session.outlets:
            session.on_close(lambda: self._forget(session))
        session.outlets[outlet.number] = outlet
        return outlet.number

    def stop(self, session: Session, number: int) -> bool:
        """End one stream of a session; false where it has no such stream."""
        if number not in session.outlets:
            return False
        del session.outlets[number]
        self._remove(lambda outlet: outlet.number == number)
        return True

    def _forget(self, session: Session) -> None:
        self._remove(lambda outlet: outlet.session is session)

    def _remove(self, leaving: Callable[[Outlet], bool]) -> None:
        for key, feed in tuple(self._feeds.items()):
            feed.outlets = [outlet for outlet in feed.outlets if not leaving(outlet)]
            if not feed.outlets:
                del self._feeds[key]
                feed.close()
