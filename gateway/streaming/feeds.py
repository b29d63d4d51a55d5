"""Feeds: samples become rows, rows become batches, a batch is encoded once for all who asked for the same.

A feed belongs to everybody with the same channels and rate.
"""

import itertools
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence

from drivers.samples import Sample
from gateway.process.loop import Loop, Timer
from gateway.streaming.outlets import Batch, Outlet, encode_batch
from gateway.streaming.sources import Selection
from gateway.wire.limits import OWN_RATE_HZ, ROW_VALUES

BATCH_S = 0.010  # ticks faster than this travel together
GATHER_S = 0.002  # how long a source's own samples wait for company
CATCH_UP_S = 1.0  # ticks missed for longer than this are lost, not made up
TURN_VALUES = 20_000  # of one feed in one turn of the loop: who is late catches up in several
TAP_SAMPLES = 10_000  # what one source may have waiting; the loop empties it every few milliseconds


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
        """Return the samples since the last call, oldest first, and how many more were lost."""
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
    """Common part of all feeds: taps in, batches out, closed with its last subscriber.

    Of what it is asked for, it gives one row of `shed`, as the gateway's budget allows.
    """

    def __init__(
        self, loop: Loop, selections: Sequence[Selection], rate_hz: float, filled: Callable[[], None]
    ) -> None:
        self.outlets: list[Outlet] = []
        self.rate_hz = rate_hz
        self.channels = sum(len(selection.indices) for selection in selections)
        self.values_a_second = values_a_second(rate_hz, self.channels)
        self.shed = 1
        self._late_ns = 0
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

    def shed_to(self, shed: int) -> None:
        """Give one row of so many from now on."""
        self.shed = shed

    def was_late_s(self) -> float:
        """Return its rows' largest delay since the last call, and forget it."""
        late_ns, self._late_ns = self._late_ns, 0
        return late_ns / 1e9

    def _spent(self, began_ns: int) -> None:
        """Put down what the thread has worked since then for all of them together."""
        share_ns = (time.thread_time_ns() - began_ns) // max(1, len(self.outlets))
        for outlet in self.outlets:
            outlet.session.cpu_ns += share_ns

    def _give(self, batch: Batch) -> None:
        for outlet in tuple(self.outlets):
            outlet.offer(batch)
            outlet.session.pump()

    def _lose(self, rows: int) -> None:
        for outlet in self.outlets:
            outlet.lose(rows)


def values_a_second(rate_hz: float, channels: int) -> float:
    """Return the cost of a stream: its values a second, and the overhead of its rows."""
    return (rate_hz or OWN_RATE_HZ) * (ROW_VALUES + channels)


class TickFeed(Feed):
    """Rows at a steady rate. Each cell is the newest sample at its tick, null once stale.

    Samples carry their stamps, so a row is right also when the loop comes to it late.
    """

    def __init__(self, loop: Loop, selections: Sequence[Selection], rate_hz: float) -> None:
        super().__init__(loop, selections, rate_hz, filled=lambda: None)
        self.shed_to(1)
        self._next_ns = time.monotonic_ns()
        self._early: list[tuple[int, Sample, dict[int, int]]] = []
        self._cells: list[tuple[int, float | None] | None] = []
        self._stale_after_ns: list[int] = []
        self._names: list[str] = []
        self._places: list[dict[int, int]] = []  # for each tap: index in its source → cell
        for selection in selections:
            self._add(selection)
        self._timer = loop.call_later(0.0, self._tick)

    def shed_to(self, shed: int) -> None:
        """Shed, but never below a row a second if more were asked for."""
        super().shed_to(min(shed, max(1, int(self.rate_hz))))
        self._period_ns = round(1e9 * self.shed / self.rate_hz)
        self._ticks_per_batch = max(1, round(BATCH_S * self.rate_hz / self.shed))

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
        began_ns, now_ns = time.thread_time_ns(), time.monotonic_ns()
        self._late_ns = max(self._late_ns, now_ns - self._next_ns)
        self._skip_what_is_too_old(now_ns)
        self._early = self._drained()
        self._forget_what_is_gone()
        rows: list[list[float | None]] = []
        stamps: list[int] = []
        updates = iter(self._early)
        update = next(updates, None)
        most_rows = 1 + TURN_VALUES // (1 + len(self._cells))
        until_ns = min(now_ns, self._next_ns + most_rows * self._period_ns)
        while self._next_ns <= until_ns:
            while update is not None and update[0] <= self._next_ns:
                self._apply(*update)
                update = next(updates, None)
            stamps.append(self._next_ns)
            rows.append(self._row(self._next_ns))
            self._next_ns += self._period_ns
        self._early = [] if update is None else [update, *updates]  # newer than the last tick: for the next
        if rows:
            columns = dict(zip(self._names, zip(*rows, strict=True), strict=True))
            batch = encode_batch(stamps, columns, self.shed)
            self._spent(began_ns)
            self._give(batch)
        last_of_batch_ns = self._next_ns + (self._ticks_per_batch - 1) * self._period_ns
        self._timer = self._loop.call_later((last_of_batch_ns - time.monotonic_ns()) / 1e9, self._tick)

    def _skip_what_is_too_old(self, now_ns: int) -> None:
        late = (now_ns - self._next_ns - round(CATCH_UP_S * 1e9)) // self._period_ns
        if late > 0:
            self._next_ns += late * self._period_ns
            self._lose(late)

    def _forget_what_is_gone(self) -> None:
        """Forget values that a source has cleared, as after a lost port, before they are stale."""
        for tap, places in zip(self._taps, self._places, strict=True):
            if tap.selection.source.latest.updated_ns is None:
                self._early = [update for update in self._early if update[2] is not places]
                for cell in places.values():
                    self._cells[cell] = None

    def _drained(self) -> list[tuple[int, Sample, dict[int, int]]]:
        updates = self._early + [
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
        super().__init__(loop, selections, 0.0, filled=lambda: loop.post(self._filled))
        self._came: Counter[tuple[int, ...]] = Counter()  # samples of each kind

    def _filled(self) -> None:
        if self._timer is None and not self._closed:
            self._timer = self._loop.call_later(GATHER_S, self._flush)

    def _flush(self) -> None:
        self._timer = None
        for number, tap in enumerate(self._taps):
            samples, lost = tap.drain()
            if lost:
                self._lose(lost)
            if self.shed > 1:
                samples = [sample for sample in samples if self._is_kept((number, *sample.indices))]
            for indices, group in itertools.groupby(samples, key=lambda sample: sample.indices):
                self._send(tap.selection, indices, list(group))

    def _is_kept(self, kind: tuple[int, ...]) -> bool:
        self._came[kind] += 1
        return self._came[kind] % self.shed == 0

    def _send(self, selection: Selection, indices: tuple[int, ...], samples: list[Sample]) -> None:
        began_ns, channels = time.thread_time_ns(), selection.source.channels
        columns: dict[str, Sequence[float | None]] = {
            channels[index].name: [sample.values[place] for sample in samples]
            for place, index in enumerate(indices)
            if index in selection.indices
        }
        if columns:
            batch = encode_batch([sample.stamp_ns for sample in samples], columns, self.shed)
            self._spent(began_ns)
            self._give(batch)
