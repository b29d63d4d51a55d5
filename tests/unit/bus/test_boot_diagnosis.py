"""Why a node is silent, in words: on an overloaded bus it is the bus, and not its power or cable."""

import pytest

from drivers.bus.boot_diagnosis import why_silent
from drivers.bus.liveness import NodeLife


@pytest.mark.parametrize(
    ("load_percent", "expected"),
    [
        (101.0, "nothing comes through from node 1: the bus main is overloaded, 101 % of its time is taken"),
        (40.0, "no frame at all from node 1, others are heard on bus main: check its power, cable"),
        (None, "no frame at all from node 1, others are heard on bus main: check its power, cable"),
    ],
)
def test_a_node_that_is_not_heard_on_a_full_bus_points_to_the_bus(
    load_percent: float | None, expected: str
) -> None:
    said = why_silent(NodeLife(1.0, None), 1, 0x601, "main", 7000, {0x100}, load_percent)
    assert said is not None
    assert said.startswith(expected)
