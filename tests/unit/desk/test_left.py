"""A robot that is removed while it may be enabled, or has not stopped, is an alarm of the window."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import pytest

from gateway.client import ConnectionState
from gateway.wire.stop import Stopped
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import LinkChanged
from tests.support.desk import JOINTS, Bench, described, looked, telemetry, walking

ALL: Final = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)
HOUR_NS: Final = 3_600_000_000_000  # so that rows are new however slow a test is
OFF, ENABLED = 6.0, 4.0


@pytest.fixture
def bench() -> Bench:
    made = Bench(Desk())
    made.add("exo-01").take([described("exo-01"), walking(10), looked()])
    return made


def seen(station: Station, states: Sequence[float | None]) -> None:
    columns = {f"{joint}.state": [state] for joint, state in zip(JOINTS, states, strict=True)}
    station.take([replace(telemetry([0], columns, time.monotonic_ns() + HOUR_NS), clock=None)])


def off(bench: Bench) -> None:
    seen(bench.station, [OFF] * 6)


def enabled(bench: Bench) -> None:
    seen(bench.station, [OFF] * 5 + [ENABLED])


def unknown(bench: Bench) -> None:
    seen(bench.station, [None] + [OFF] * 5)


def nameless(bench: Bench) -> None:
    seen(bench.station, [9.0] + [OFF] * 5)  # a state that the robot has no word for


def gone(bench: Bench) -> None:
    off(bench)
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])


def asked(bench: Bench) -> None:
    off(bench)
    bench.station.stop("test")


def failed(bench: Bench) -> None:
    asked(bench)
    bench.first.fail(RuntimeError("no answer"))


def stopped(bench: Bench) -> None:
    asked(bench)
    bench.first.answer(ALL)


@pytest.mark.parametrize(
    ("how", "kind", "words"),
    [
        (off, None, ""),
        (stopped, None, ""),
        (enabled, Kind.LEFT_RUNNING, "while its drives were enabled"),
        (unknown, Kind.LEFT_RUNNING, "while the state of left hip was not known"),
        (nameless, Kind.LEFT_RUNNING, "while the state of left hip was not known"),
        (gone, Kind.LEFT_RUNNING, "while it was not known whether its drives are enabled"),
        (asked, Kind.LEFT_UNSTOPPED, "while it was not known to have stopped"),
        (failed, Kind.LEFT_UNSTOPPED, "while it was not known to have stopped"),
    ],
)
def test_what_is_not_known_to_be_off_is_named_and_how_it_was(
    bench: Bench, how: Callable[[Bench], None], kind: Kind | None, words: str
) -> None:
    how(bench)
    bench.desk.remove(bench.station)
    alarms = [one.alarm for one in bench.desk.alarms.active]
    assert [one.kind for one in alarms] == ([] if kind is None else [kind])
    if kind is not None:
        assert alarms[0].line == f"{kind.value}: exo-01: {words}; this window cannot stop it any more"
    assert bench.desk.news.items[0].text == (
        f"removed {words}; this window cannot stop it any more" if words else "removed"
    )


def test_one_of_two_that_was_left_is_acknowledged_alone(bench: Bench) -> None:
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02"), walking(10), looked()])
    enabled(bench)
    bench.desk.remove(bench.station)
    bench.desk.remove(other)
    first, second = (one.alarm for one in bench.desk.alarms.active)
    bench.desk.acknowledge(None, first)
    assert [one.alarm for one in bench.desk.alarms.active] == [second]


def told(bench: Bench) -> list[Kind]:
    return [one.alarm.kind for one in bench.desk.alarms.active]


def test_one_that_is_in_the_list_twice_is_gone_only_where_nothing_is_seen_of_it(bench: Bench) -> None:
    twin = bench.add("again")
    enabled(bench)
    bench.desk.remove(bench.station)
    assert told(bench) == [Kind.LEFT_RUNNING], "there is no link to the other"
    twin.take([described("exo-01"), walking(10), looked()])
    assert told(bench) == []


@pytest.mark.parametrize("name", ["exo-01", "exo-77"])
def test_one_that_is_added_again_is_named_until_it_is_seen_and_is_the_same(bench: Bench, name: str) -> None:
    enabled(bench)
    bench.desk.remove(bench.station)
    again = bench.add("exo-01")
    assert told(bench) == [Kind.LEFT_RUNNING]
    again.take([described(name), walking(10), looked()])
    assert told(bench) == ([] if name == "exo-01" else [Kind.LEFT_RUNNING]), (
        "another robot says nothing of it"
    )


def test_a_stop_that_was_not_confirmed_is_not_forgotten_by_adding_its_robot_again(bench: Bench) -> None:
    failed(bench)
    bench.desk.remove(bench.station)
    bench.add("exo-01").take([described("exo-01"), walking(10), looked()])
    (one,) = bench.desk.alarms.active
    assert one.alarm.kind is Kind.LEFT_UNSTOPPED
    bench.desk.acknowledge(None, one.alarm)
    assert told(bench) == []


def test_a_stop_that_was_confirmed_and_is_not_held_by_the_robots_word_is_an_alarm(bench: Bench) -> None:
    """Header and drives were green and confirmed beside STOP ALL, which said that it is not held."""
    station = bench.station
    bench.desk.stop_all("test")
    bench.first.answer(ALL)
    gone(bench)
    station.take([LinkChanged(ConnectionState.CONNECTED, None, time.monotonic_ns()), described("exo-01")])
    seen(station, [ENABLED] * 6)
    assert station.alarms.active[0].alarm.kind is Kind.NOT_HELD
    assert (station.mark.word, station.mark.colour) == ("STOP NOT HELD", "bad")
    result = bench.desk.stopped_all
    assert result is not None
    assert "STOP NOT HELD" in result.wordings[0]
    station.stop("again")
    bench.commands[0].answer(ALL)
    assert station.alarms.active[0].alarm.kind is not Kind.NOT_HELD
