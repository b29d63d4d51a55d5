"""Samples of single sources, each with a stamp of its own, as rows at regular ticks: what views can draw."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from server_gui.core.cloud.tape import Rows
from server_gui.core.follow.events import Event, Telemetry, replaced
from server_gui.core.recording.rows import Floats, Ints

PERIOD_NS: Final = 10_000_000
HELD_NS: Final = 100_000_000  # a sample stands for its channel no longer
LATE_NS: Final = 30_000_000  # sources come one after another: a tick is made when all of them may have come
SPARSE: Final = 0.5  # of the values there: fewer, and a row is one source's sample


def at_ticks(rows: Rows, ticks_ns: Ints) -> Rows:
    """Return a row a tick: of each channel the newest value that is not after it, and not too old."""
    here = np.searchsorted(rows.stamps_ns, ticks_ns, "right") - 1
    columns = {name: _held(rows.stamps_ns, column, ticks_ns, here) for name, column in rows.columns.items()}
    return Rows(rows.utc_ns[np.maximum(here, 0)], ticks_ns, columns)


def drawable(rows: Rows) -> Rows:
    """Return recorded rows as they are, or at ticks if they are samples of single sources."""
    there = sum(int(np.count_nonzero(~np.isnan(column))) for column in rows.columns.values())
    if not len(rows) or there >= SPARSE * len(rows) * len(rows.columns):
        return rows
    return at_ticks(rows, _ticks(int(rows.stamps_ns[0]), int(rows.stamps_ns[-1])))


class Ticks:
    """One robot's samples, live. A clock that begins anew begins everything anew."""

    def __init__(self) -> None:
        self._waiting: list[Rows] = []
        self._newest_ns = 0
        self._told_ns: int | None = None

    def take(self, events: Iterable[Event]) -> list[Event]:
        """Return the same events, with one of telemetry at their end that has the ticks that are whole."""
        telemetry: Telemetry | None = None
        others: list[Event] = []
        for event in events:
            if isinstance(event, Telemetry) and event.batch.stamps_ns:
                telemetry = event
                self._add(event)
            else:
                others.append(event)
        return others if telemetry is None else [*others, *self._whole(telemetry)]

    def _add(self, event: Telemetry) -> None:
        stamps_ns = np.array(event.batch.stamps_ns, np.int64)
        if stamps_ns[-1] < self._newest_ns - 1_000_000_000:
            self._waiting, self._newest_ns, self._told_ns = [], 0, None
        columns = {name: np.array(column, np.float64) for name, column in event.batch.columns.items()}
        self._waiting.append(Rows(stamps_ns, stamps_ns, columns))
        self._newest_ns = max(self._newest_ns, int(stamps_ns[-1]))

    def _whole(self, event: Telemetry) -> list[Event]:
        rows = Rows.joined(self._waiting)
        first_ns = int(rows.stamps_ns[0]) if self._told_ns is None else self._told_ns + 1
        ticks_ns = _ticks(first_ns, self._newest_ns - LATE_NS)
        if not len(ticks_ns):
            return []
        self._told_ns = int(ticks_ns[-1])
        self._waiting = [rows.between(self._told_ns - HELD_NS, self._newest_ns + 1)]
        found = at_ticks(rows, ticks_ns)
        columns = {name: nullable(column) for name, column in found.columns.items()}
        return [replaced(event, ticks_ns.tolist(), columns)]


def nullable(column: Floats) -> list[float | None]:
    """Return them as batches have them: None for what is missing."""
    return [None if value != value else value for value in column.tolist()]


def _ticks(first_ns: int, last_ns: int) -> Ints:
    """Return the multiples of the period from one to the other."""
    begin = -(-first_ns // PERIOD_NS) * PERIOD_NS
    return np.arange(begin, last_ns + 1, PERIOD_NS, dtype=np.int64)


def _held(stamps_ns: Ints, column: Floats, ticks_ns: Ints, here: Ints) -> Floats:
    known = np.flatnonzero(~np.isnan(column))
    if not len(known):
        return np.full(len(ticks_ns), np.nan)
    place = np.searchsorted(known, here, "right") - 1
    row = known[np.maximum(place, 0)]
    held = (place >= 0) & (ticks_ns - stamps_ns[row] <= HELD_NS)
    return np.where(held, column[row], np.nan)
