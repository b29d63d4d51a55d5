"""The past of the channels: bounded, in order, with gaps as gaps."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from server_gui.core.desk.rings import Rings

MS = 1_000_000


@given(st.lists(st.integers(1, 7), min_size=1, max_size=30), st.integers(3, 20))
def test_the_newest_rows_come_out_as_they_went_in(batches: list[int], rows: int) -> None:
    rings, taken = Rings(rows), 0
    for count in batches:
        numbers = list(range(taken, taken + count))
        rings.take([number * 10 * MS for number in numbers], {"a": [float(number) for number in numbers]})
        taken += count
    expected = list(range(taken))[-rows:]
    assert rings.values("a", rows).tolist() == expected
    assert len(rings.times(math.inf if taken == 1 else 1e9)) == len(expected)


def test_missing_values_and_unknown_channels_are_not_a_number() -> None:
    rings = Rings(10)
    rings.take([0, 10 * MS], {"a": [1.0, None]})
    assert np.isnan(rings.values("a", 2)[1])
    assert np.isnan(rings.values("b", 2)).all()


def test_a_gap_in_time_breaks_the_line() -> None:
    rings = Rings(10)
    rings.take([0], {"a": [1.0]})
    rings.take([2_000 * MS], {"a": [2.0]})
    values = rings.values("a", 10)
    assert values[0] == 1.0
    assert np.isnan(values[1])
    assert values[2] == 2.0


def test_a_clock_that_begins_anew_forgets_the_past() -> None:
    rings = Rings(10)
    rings.take([5_000 * MS], {"a": [1.0]})
    rings.take([10 * MS], {"a": [2.0]})
    assert rings.values("a", 10).tolist() == [2.0]


def test_times_end_at_the_newest_and_begin_where_asked() -> None:
    rings = Rings(1000)
    rings.take([number * 10 * MS for number in range(500)], {"a": [0.0] * 500})
    times = rings.times(1.0)
    assert times[-1] == 4.99
    assert 3.99 <= times[0] <= 4.01


def test_what_comes_after_a_new_beginning_is_of_another_source() -> None:
    rings = Rings(10)
    rings.take([5_000 * MS], {"a": [1.0]})
    first = rings.source
    rings.take([5_010 * MS], {"a": [1.0]})
    assert rings.source is first
    rings.take([10 * MS], {"a": [2.0]})
    assert rings.source is not first


def test_memory_does_not_grow_with_time() -> None:
    rings = Rings(100)
    rings.take([0], {"a": [0.0]})
    size = rings._values.nbytes
    for number in range(1, 2000):
        rings.take([number * 10 * MS], {"a": [0.0]})
    assert rings._values.nbytes == size
