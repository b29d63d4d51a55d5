"""Samples of single sources become rows that views can draw: held a while, none invented."""

import numpy as np
import pytest

from gateway.client import ConnectionState
from server_gui.core.cloud.tape import Rows
from server_gui.core.desk.ticks import HELD_NS, LATE_NS, PERIOD_NS, Ticks, at_ticks, drawable
from server_gui.core.follow.events import LinkChanged, Telemetry
from tests.gui.fakes import telemetry

MS = 1_000_000


def source(name: str, period_ns: int, phase_ns: int, until_ns: int) -> list[Telemetry]:
    """A source whose value is its stamp in ms, a sample a notification."""
    stamps = range(phase_ns, until_ns, period_ns)
    return [telemetry([stamp], {name: [stamp / MS]}) for stamp in stamps]


def mixed(until_ns: int) -> list[Telemetry]:
    found = [*source("knee.position", 1 * MS, 0, until_ns), *source("trunk.tilt", 25 * MS, 7 * MS, until_ns)]
    return sorted(found, key=lambda event: event.batch.stamps_ns[0])


def test_each_tick_has_the_newest_of_each_source_and_nothing_later() -> None:
    ticks, told = Ticks(), []
    events = mixed(1000 * MS)
    for begin in range(0, len(events), 7):
        told += [event for event in ticks.take(events[begin : begin + 7]) if isinstance(event, Telemetry)]
    stamps = [stamp for event in told for stamp in event.batch.stamps_ns]
    assert stamps == list(range(0, stamps[-1] + 1, PERIOD_NS))
    assert stamps[-1] >= 1000 * MS - LATE_NS - 2 * PERIOD_NS
    knee, trunk = (
        [value for event in told for value in event.batch.columns[name]]
        for name in ("knee.position", "trunk.tilt")
    )
    assert knee == [stamp / MS for stamp in stamps]
    assert trunk[0] is None
    assert trunk[1:5] == [7.0, 7.0, 7.0, 32.0]


def test_what_is_rare_goes_through_and_a_clock_that_begins_anew_begins_anew() -> None:
    ticks = Ticks()
    news = LinkChanged(ConnectionState.CONNECTED, None, 0)
    assert ticks.take([news]) == [news]
    later = [telemetry([stamp], {"a": [1.0]}) for stamp in range(10_000 * MS, 10_200 * MS, 10 * MS)]
    ticks.take(later)
    again = ticks.take([telemetry([stamp], {"a": [2.0]}) for stamp in range(0, 200 * MS, 10 * MS)])
    assert isinstance(again[-1], Telemetry)
    assert set(again[-1].batch.columns["a"]) == {2.0}


def test_a_source_that_has_gone_silent_is_missing_after_a_while() -> None:
    stamps = np.arange(0, 1000 * MS, PERIOD_NS, dtype=np.int64)
    silent = np.where(stamps < 300 * MS, 1.0, np.nan)
    rows = Rows(stamps, stamps, {"a": silent, "b": np.zeros(len(stamps))})
    held = at_ticks(rows, stamps).columns["a"]
    last = int(np.flatnonzero(~np.isnan(held))[-1]) * PERIOD_NS
    assert last == 290 * MS + HELD_NS


def test_recorded_rows_of_ticks_stay_as_they_are_and_those_of_single_sources_are_put_together() -> None:
    stamps = np.arange(0, 1000 * MS, PERIOD_NS, dtype=np.int64)
    dense = Rows(stamps, stamps, {"a": np.ones(len(stamps)), "b": np.ones(len(stamps))})
    assert drawable(dense) is dense
    events = mixed(1000 * MS)
    sparse = Rows.joined(
        [
            Rows(
                np.array(event.batch.stamps_ns),
                np.array(event.batch.stamps_ns),
                {name: np.array(column, np.float64) for name, column in event.batch.columns.items()},
            )
            for event in events[:200]
        ]
    )
    assert len(sparse) == 200
    thirds = Rows(sparse.utc_ns, sparse.stamps_ns, dict(sparse.columns) | {"c": np.full(200, np.nan)})
    found = drawable(thirds)
    assert np.diff(found.stamps_ns).tolist() == [PERIOD_NS] * (len(found) - 1)
    assert not np.isnan(found.columns["knee.position"]).any()


@pytest.mark.parametrize("copies", [1, 3])
def test_two_sources_may_have_one_stamp_but_no_row_is_there_twice(copies: int) -> None:
    stamps = np.array([10, 20], np.int64)
    one = Rows(stamps, stamps, {"a": np.array([1.0, 2.0])})
    other = Rows(stamps, stamps, {"b": np.array([3.0, 4.0])})
    joined = Rows.joined([one, other] * copies)
    assert len(joined) == 4
