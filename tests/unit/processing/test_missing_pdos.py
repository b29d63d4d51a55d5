"""PDOs of which one or two percent are missing now and then are one thing that lasts, or none."""

from msgspec.structs import replace

from gateway.wire.bus import BusInfo
from server_gui.core.follow.missing_pdos import MissingPdos
from server_gui.core.processing.bus_health import BusHealthLevel as Level
from server_gui.core.processing.bus_health import findings, level
from tests.unit.processing.test_bus_health import BUS, NODE

SECOND_NS = 1_000_000_000


def looks(*percents: float, cpu_percent: float = 20.0, nodes: int = 2) -> list[BusInfo]:
    """What is known after each look, one a second."""
    watched, found = MissingPdos(), list[BusInfo]()
    for second, percent in enumerate(percents):
        each = [replace(NODE, node_id=number, pdos_missing_percent=percent) for number in range(1, nodes + 1)]
        (bus,) = watched.take((replace(BUS, nodes=each),), second * SECOND_NS, cpu_percent)
        found.append(bus)
    return found


def changes(found: list[BusInfo]) -> list[Level]:
    """How bad it is said to be, each as often as that changes."""
    levels = [level(bus) for bus in found]
    return [one for place, one in enumerate(levels) if place == 0 or one is not levels[place - 1]]


def test_a_share_that_comes_and_goes_around_one_percent_is_one_warning_that_lasts() -> None:
    found = looks(*[1.4, 0.4, 0.0] * 20, *[0.0] * 15)
    assert changes(found) == [Level.GOOD, Level.WARNING, Level.GOOD]
    assert "1 % of their PDOs are missing" in findings(found[40])[0][0], "also in a look that has found none"
    assert found[40].nodes[0].pdos_missing_percent == 0.4, "the figure is the look's own"


def test_one_look_that_misses_two_percent_is_nothing_and_twenty_are_told_at_once() -> None:
    assert changes(looks(0.0, 2.0, *[0.0] * 20)) == [Level.GOOD]
    assert changes(looks(0.0, 20.0, *[0.0] * 20)) == [
        Level.GOOD,
        Level.WARNING,
        Level.GOOD,
    ]


def test_a_busy_computer_is_named_where_every_node_of_a_bus_misses_some() -> None:
    ((words, check),) = findings(looks(*[20.0] * 3, cpu_percent=97.0)[-1])
    assert words.endswith("20 % of their PDOs are missing; the robot's computer is busy")
    assert "gwrms blame" in check
    assert "busy" not in findings(looks(*[20.0] * 3, cpu_percent=40.0)[-1])[0][0]
    assert "busy" not in findings(looks(*[20.0] * 3, cpu_percent=97.0, nodes=1)[-1])[0][0]


def test_what_was_seen_before_a_time_without_a_look_lasts_no_longer() -> None:
    watched = MissingPdos()
    lost = replace(BUS, nodes=[replace(NODE, pdos_missing_percent=20.0)])
    fine = replace(BUS, nodes=[replace(NODE, pdos_missing_percent=0.0)])
    assert level(watched.take((lost,), 0)[0]) is Level.WARNING
    assert level(watched.take((fine,), 6 * SECOND_NS)[0]) is Level.GOOD
