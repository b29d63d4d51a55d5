"""The load of buses over the last minutes: of those that are there, with gaps where nobody knows it."""

import numpy as np
from msgspec.structs import replace

from server_gui.core.processing.bus_loads import BusLoads
from server_gui.core.processing.history import FINE_ROWS
from tests.unit.processing.test_bus_health import BUS

S = 1_000_000_000
FEET = replace(BUS, name="feet", load_percent=7.0)


def test_what_is_not_known_is_a_gap() -> None:
    loads = BusLoads()
    looks = [[BUS, FEET], None, [BUS], [replace(BUS, load_percent=None), FEET]]
    for look, buses in enumerate(looks):
        loads.take(buses, look * S)
    np.testing.assert_equal(loads.recent("main"), [[0, 41.2], [1, np.nan], [2, 41.2], [3, np.nan]])
    np.testing.assert_equal(loads.recent("feet"), [[0, 7.0], [1, np.nan], [2, np.nan], [3, 7.0]])
    assert loads.recent("another").shape == (0, 2)


def test_a_bus_that_is_gone_is_forgotten_with_its_last_load_and_none_that_is_there() -> None:
    loads = BusLoads()
    silent = replace(BUS, name="silent", load_percent=None)
    loads.take([FEET, silent], 0)
    for look in range(1, FINE_ROWS):
        loads.take([silent], look * S)
    assert len(loads.recent("feet")) == FINE_ROWS, "its last load is within the minutes that are shown"
    for look in range(FINE_ROWS, FINE_ROWS + 2):
        loads.take([silent], look * S)
    assert len(loads.recent("feet")) == 0
    assert len(loads.recent("silent")) == FINE_ROWS


def test_names_that_come_and_go_are_not_kept_for_ever() -> None:
    loads = BusLoads()
    for look in range(3 * FINE_ROWS):
        loads.take([replace(BUS, name=f"bus {look // 100}")], look * S)
    known = [number for number in range(3 * FINE_ROWS // 100) if len(loads.recent(f"bus {number}"))]
    assert known == list(range(2 * FINE_ROWS // 100, 3 * FINE_ROWS // 100))


def test_nobody_knowing_forgets_nothing() -> None:
    loads = BusLoads()
    loads.take([FEET], 0)
    for look in range(1, FINE_ROWS + 2):
        loads.take(None, look * S)
    assert len(loads.recent("feet")) == FINE_ROWS
