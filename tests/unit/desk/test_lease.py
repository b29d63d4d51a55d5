"""Control: who may write and how long, and what goes with it."""

import time

from gateway.client import RemoteError
from gateway.units import Units
from gateway.wire.control import Lease
from gateway.wire.parameter import Written
from server_gui.core.follow.news import NewsKind
from tests.support.desk import Bench

STEP = "gait.step_length"


def held_s(bench: Bench, later_s: float = 0.0) -> float | None:
    return bench.station.control.left_s(time.monotonic_ns() + round(later_s * 1e9))


def test_it_is_ours_from_the_answer_until_its_time_is_over(bench: Bench) -> None:
    bench.station.take_control()
    assert bench.station.control.asking
    assert held_s(bench) is None
    bench.first.answer(Lease("lease", 300.0))
    assert not bench.station.control.asking
    left_s = held_s(bench)
    assert left_s is not None
    assert 0 < left_s <= 300
    assert held_s(bench, later_s=300.0) is None


def test_who_has_it_is_told_in_the_robots_words(bench: Bench) -> None:
    bench.station.take_control()
    bench.first.fail(RemoteError(-32003, "ada at 10.0.0.3 has control", {"kind": "lease_held"}))
    assert bench.station.control.problem == "ada at 10.0.0.3 has control"
    assert held_s(bench) is None
    bench.station.take_control()
    bench.first.answer(Lease("lease", 300.0))
    assert bench.station.control.problem is None


def test_a_write_takes_it_anew(bench: Bench) -> None:
    bench.station.edits.stage(STEP, 0.43, bench.station.robot.parameters[STEP])
    bench.station.write(bench.station.difference(Units()))
    assert held_s(bench) is None
    bench.first.answer(Written(1, {STEP: 0.4}, {STEP: 0.43}))
    assert held_s(bench) is not None


def test_given_back_it_takes_a_trial_along(bench: Bench) -> None:
    bench.station.control.taken(Lease("lease", 300.0))
    bench.station.writing.done(Written(7, {STEP: 0.4}, {STEP: 0.43}, trial_s=20.0))
    bench.station.release_control()
    assert held_s(bench) is not None, "the robot has not said so yet"
    bench.first.answer(None)
    assert held_s(bench) is None
    assert bench.station.writing.trial is None
    assert "went back with control" in bench.station.writing.text


def test_lost_with_its_link_it_is_told_and_where_there_was_none_nothing_is(bench: Bench) -> None:
    def told() -> list[str]:
        return [item.text for item in bench.desk.news.items if item.kind is NewsKind.CONTROL]

    bench.station.lost_control()
    assert told() == []
    bench.station.control.taken(Lease("lease", 300.0))
    bench.station.lost_control()
    assert told() == ["control lost with the link"]
    assert held_s(bench) is None
