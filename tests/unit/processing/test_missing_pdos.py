"""PDOs of which one or two percent are missing now and then are one thing that lasts, or none."""

from msgspec.structs import replace

from gateway.wire.bus import BusInfo
from server_gui.core.follow.events import BusesSeen, Described
from server_gui.core.follow.missing_pdos import BEGINS_NS, LOST_NS, MissingPdos, told_percent
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.bus_health import BusHealthLevel as Level
from server_gui.core.processing.bus_health import findings, level
from tests.unit.processing.test_bus_health import BUS, NODE
from tests.unit.recording.robots import description

SECOND_NS = 1_000_000_000


def looks(
    *percents: float | None, cpu_percent: float = 20.0, nodes: int = 2, every_s: float = 1.0
) -> list[BusInfo]:
    """What is known after each look."""
    watched, found = MissingPdos(), list[BusInfo]()
    for look, percent in enumerate(percents):
        each = [replace(NODE, node_id=number, pdos_missing_percent=percent) for number in range(1, nodes + 1)]
        at_ns = round(look * every_s * SECOND_NS)
        (bus,) = watched.take((replace(BUS, nodes=each),), at_ns, cpu_percent)
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


def test_a_few_in_seldom_looks_are_told_after_enough_of_them() -> None:
    assert changes(looks(*[1.5] * 3, every_s=5.0)) == [Level.GOOD]
    assert changes(looks(*[1.5] * 4, every_s=5.0)) == [Level.GOOD, Level.WARNING]


def test_a_look_that_does_not_know_it_ends_nothing_until_it_has_lasted() -> None:
    """It counted as one that has found none: ten seconds of not knowing made a node well."""
    unknown = [None] * 15
    assert changes(looks(20.0, *unknown)) == [Level.WARNING]
    assert changes(looks(20.0, *unknown, *[0.0] * 10)) == [Level.WARNING, Level.GOOD]
    gone = looks(20.0, *unknown, *unknown, 2.0)
    assert (changes(gone), gone[-1].nodes[0].pdos_missing_percent) == ([Level.WARNING, Level.GOOD], 2.0)


def test_a_busy_computer_is_named_where_every_node_of_a_bus_misses_some() -> None:
    ((words, check),) = findings(looks(*[20.0] * 3, cpu_percent=97.0)[-1])
    assert words.endswith("20 % of their PDOs are missing; the robot's computer is overloaded")
    assert "gwrms blame" in check
    assert "busy" not in findings(looks(*[20.0] * 3, cpu_percent=40.0)[-1])[0][0]
    assert "busy" not in findings(looks(*[20.0] * 3, cpu_percent=97.0, nodes=1)[-1])[0][0]


def test_a_node_that_sends_no_pdos_does_not_hide_that_the_computer_is_busy() -> None:
    each = [replace(NODE, node_id=number, pdos_missing_percent=one) for number, one in ((1, 9.0), (2, 8.0))]
    without = replace(NODE, node_id=16, pdos_missing_percent=None)
    (bus,) = MissingPdos().take((replace(BUS, nodes=[*each, without]),), 0, 97.0)
    assert "overloaded" in findings(bus)[0][0]


def test_the_cause_does_not_change_with_each_look() -> None:
    """The remedy was cables while the computer's load was a few percent lower, or a node was fine."""
    each = [replace(NODE, node_id=number, pdos_missing_percent=9.0) for number in range(1, 7)]
    watched, bus = (
        MissingPdos(),
        replace(BUS, nodes=[*each, replace(NODE, node_id=16, pdos_missing_percent=0.0)]),
    )
    for second, percent in enumerate((97.0, 70.0, None, 95.0, 80.0)):
        (told,) = watched.take((bus,), second * 2 * SECOND_NS, percent)
        assert "overloaded" in findings(told)[0][0], second
    (told,) = watched.take((bus,), 40 * SECOND_NS, 60.0)
    assert "busy" not in findings(told)[0][0]


def test_where_one_node_is_told_no_other_with_as_many_looks_fine() -> None:
    watched, of_look = MissingPdos(), ((20.0, 2.3, 0.4), (0.0, 0.0, 0.0))
    told = []
    for second, percents in enumerate(of_look):
        each = [
            replace(NODE, node_id=number, pdos_missing_percent=one) for number, one in enumerate(percents)
        ]
        (bus,) = watched.take((replace(BUS, nodes=each),), second * SECOND_NS)
        told.append([told_percent(node) for node in bus.nodes])
    assert told == [[20.0, 2.3, 0.0]] * 2, "and both last as long"


def test_what_was_seen_before_a_time_without_a_look_lasts_no_longer() -> None:
    watched = MissingPdos()
    lost = replace(BUS, nodes=[replace(NODE, pdos_missing_percent=20.0)])
    fine = replace(BUS, nodes=[replace(NODE, pdos_missing_percent=0.0)])
    assert level(watched.take((lost,), 0)[0]) is Level.WARNING
    assert level(watched.take((fine,), LOST_NS)[0]) is Level.WARNING
    assert level(watched.take((lost,), LOST_NS + SECOND_NS)[0]) is Level.WARNING
    assert level(watched.take((fine,), 2 * LOST_NS + 2 * SECOND_NS)[0]) is Level.GOOD


def test_a_clock_that_goes_back_begins_anew() -> None:
    """What was seen at a later time lasted until the clock was there again, and a busy computer with it."""
    watched, hour_ns = MissingPdos(), 3600 * SECOND_NS
    bus = replace(BUS, nodes=[replace(NODE, node_id=number, pdos_missing_percent=20.0) for number in (1, 2)])
    (before,) = watched.take((bus,), hour_ns, 99.0)
    assert "computer is overloaded" in findings(before)[0][0]
    (after,) = watched.take((bus,), 0, 20.0)
    assert "20 % of their PDOs are missing" in findings(after)[0][0], "many are told at once"
    assert "overloaded" not in findings(after)[0][0]
    fine = replace(BUS, nodes=[replace(node, pdos_missing_percent=0.0) for node in bus.nodes])
    (none,) = MissingPdos().take((fine,), 0)
    watched = MissingPdos()
    watched.take((bus,), hour_ns)
    assert watched.take((fine,), 0) == (none,)


def test_a_few_that_last_are_told_however_far_apart_looks_are() -> None:
    assert LOST_NS >= BEGINS_NS
    for every_s in (0.5, 1.0, 5.5, LOST_NS / SECOND_NS):
        assert changes(looks(*[1.5] * 40, every_s=every_s)) == [Level.GOOD, Level.WARNING], every_s
    slow = looks(*[1.4, 0.4, 0.0] * 10, *[0.0] * 10, every_s=5.5)
    assert changes(slow) == [Level.GOOD, Level.WARNING, Level.GOOD]


def test_single_looks_with_a_few_do_not_last() -> None:
    for apart in (9, 11, 12):
        one = [1.0, *[0.0] * (apart - 1)]
        assert changes(looks(0.0, *one * 2, *[0.0] * 10)) == [Level.GOOD], apart
        assert changes(looks(0.0, *one * 10)) == [Level.GOOD], apart


def test_the_newest_share_is_told_and_not_the_highest() -> None:
    found = looks(40.0, 1.2, 0.0)
    told = [findings(bus)[0][0] for bus in found]
    assert ["40 %" in words for words in told] == [True, False, False]
    assert all("1 % of their PDOs are missing" in words for words in told[1:])


def test_a_node_that_was_gone_and_a_robot_that_has_started_anew_begin_without_a_past() -> None:
    lost, fine = (replace(BUS, nodes=[replace(NODE, pdos_missing_percent=each)]) for each in (20.0, 0.0))
    watched = MissingPdos()
    levels = [
        level(watched.take((bus,), look * SECOND_NS)[0])
        for look, bus in enumerate((lost, fine, replace(BUS, nodes=[]), fine))
    ]
    assert levels == [Level.WARNING, Level.WARNING, Level.GOOD, Level.GOOD]

    robot, found = Robot(), list[Level]()
    for look, (boot, bus) in enumerate((("a", lost), ("a", fine), ("b", fine))):
        described = description("exo-01")
        robot.apply(Described(replace(described, boot_id=boot)))
        robot.apply(BusesSeen((bus,), look * SECOND_NS))
        found += [level(one) for one in robot.buses or ()]
    assert found == [Level.WARNING, Level.WARNING, Level.GOOD]
