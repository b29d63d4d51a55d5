"""STOP ALL has one result of all robots together: who is stopped, how soon, and who is not, and why."""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, NoReturn

import pytest

from gateway.client import NOTHING_SENT, ConnectionState, NotConnected
from gateway.wire.stop import Reset, Stopped
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import LinkChanged
from tests.support.desk import JOINTS, Bench, described, looked, telemetry, walking

ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)
HOUR_NS: Final = 3_600_000_000_000  # so that rows are new however slow a test is
OFF = Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False)


@pytest.fixture
def two() -> Bench:
    """Two robots that walk."""
    bench = Bench(Desk())
    for place, name in enumerate(("exo-01", "exo-02")):
        bench.add(name, 7420 + place).take([described(name), walking(10), looked()])
    return bench


def said(bench: Bench) -> str:
    result = bench.desk.stopped_all
    return "" if result is None else result.wordings[0]


def timed(station: Station, after_ms: float) -> None:
    station.stopping.answered_ms = after_ms


def gone(station: Station) -> None:
    station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])


def seen(station: Station, state: float | None = 6.0, *, joints: Sequence[str] = JOINTS) -> None:
    """Its drives are seen in this state, from now on; 6: off. Without a clock that proves no time."""
    columns: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    columns |= {f"{joint}.state": [state] for joint in joints}
    station.take([replace(telemetry([0], columns, time.monotonic_ns() + HOUR_NS), clock=None)])


def confirmed(two: Bench) -> Station:
    """Both are enabled, and stop; return the second."""
    for station in two.desk.stations:
        seen(station, 4.0)
    two.desk.stop_all("test")
    for station, commands in zip(two.desk.stations, two.commands, strict=True):
        commands.answer(ALL)
        seen(station)
        timed(station, 34.0)
    assert said(two) == "STOP ALL: 2 of 2 robots stopped, 12/12 drives confirmed in 34 ms"
    return two.desk.stations[1]


def mark(bench: Bench) -> str:
    result = bench.desk.stopped_all
    return "" if result is None else result.mark.colour


def test_every_robot_that_confirms_is_one_result_with_its_drives_and_the_slowest_time(two: Bench) -> None:
    two.desk.stop_all("test")
    assert said(two).startswith("STOP ALL sent: 0 of 2 robots stopped; no answer yet from exo-01, exo-02")
    two.commands[0].answer(ALL)
    seen(two.desk.stations[0])
    assert "1 of 2 robots stopped" in said(two)
    assert said(two).endswith("no answer yet from exo-02")
    two.commands[1].answer(ALL)
    seen(two.desk.stations[1])
    timed(two.desk.stations[0], 34.0)
    timed(two.desk.stations[1], 84.0)
    assert said(two) == "STOP ALL: 2 of 2 robots stopped, 12/12 drives confirmed in 84 ms"


def test_a_robot_without_a_link_is_not_confirmed_with_its_reason_and_what_to_do(two: Bench) -> None:
    gone(two.desk.stations[1])
    two.desk.stop_all("test")
    two.commands[0].answer(ALL)
    seen(two.desk.stations[0])
    two.commands[1].fail(NotConnected(f"{NOTHING_SENT}: there is no link"))
    timed(two.desk.stations[0], 34.0)
    result = two.desk.stopped_all
    assert result is not None
    assert (result.mark.shape, result.mark.colour) == ("square", "bad")
    assert result.wordings[0] == (
        "STOP ALL: 1 of 2 robots stopped, 6/12 drives confirmed in 34 ms; "
        f"exo-02 STOP NOT CONFIRMED: {NOTHING_SENT}: there is no link → use the hardware stop"
    )
    assert result.wordings[-2] == "STOP ALL: 1 of 2 robots stopped; exo-02 STOP NOT CONFIRMED"


def test_drives_of_a_robot_that_was_never_reached_are_not_counted_as_none(two: Bench) -> None:
    two.add("exo-03", 7422)
    two.desk.stop_all("test")
    for station, commands in zip(two.desk.stations, two.commands[:2], strict=False):
        commands.answer(ALL)
        seen(station)
    two.commands[2].fail(NotConnected("there is no link"))
    assert "2 of 3 robots stopped, 12 drives confirmed in" in said(two)
    assert "12/12" not in said(two), "nobody knows how many there are"


def test_where_nothing_is_known_of_any_drive_none_is_counted(two: Bench) -> None:
    two.desk.stop_all("test")
    two.commands[0].answer(ALL)
    two.commands[1].fail(NotConnected("no gateway there; is it running?"))
    two.desk.stations[0].reset()
    two.commands[0].answer(OFF)
    assert said(two).startswith("STOP ALL: 0 of 2 robots stopped; exo-01 reset; exo-02 STILL MOVING")
    assert two.desk.stations[1].stopping.text.endswith("is it running? Use the hardware stop")


def test_one_drive_that_does_not_confirm_is_named_with_its_robot(two: Bench) -> None:
    two.desk.stop_all("test")
    two.commands[0].answer(ALL)
    two.commands[1].answer(Stopped({**ALL.drives, "left_knee": "unreachable"}, held=True))
    assert "11/12 drives confirmed in" in said(two)
    assert "exo-02 STILL MOVING: left knee unreachable → STOP again" in said(two)


def test_the_result_stays_until_the_last_robot_is_reset_or_removed(two: Bench) -> None:
    first, second = two.desk.stations
    confirmed(two)
    first.reset()
    two.commands[0].answer(OFF)
    assert "1 of 2 robots stopped" in said(two)
    assert "exo-01 reset" in said(two)
    second.reset()
    two.commands[1].answer(OFF)
    assert two.desk.stopped_all is None
    confirmed(two)
    first.reset()
    two.commands[0].answer(OFF)
    two.desk.remove(second)
    assert two.desk.stopped_all is None


def test_a_stop_of_one_robot_alone_is_no_stop_all(two: Bench) -> None:
    two.desk.stations[0].stop("test")
    two.commands[0].answer(ALL)
    assert two.desk.stopped_all is None


def test_a_newer_stop_of_one_robot_counts_for_it(two: Bench) -> None:
    two.desk.stop_all("test")
    two.commands[0].answer(ALL)
    two.commands[1].fail(NotConnected("there is no link"))
    two.desk.stations[1].stop("again")
    two.commands[1].answer(ALL)
    for station in two.desk.stations:
        seen(station)
    assert said(two).startswith("STOP ALL: 2 of 2 robots stopped, 12/12 drives confirmed in")


def test_drives_that_were_off_before_are_not_said_to_have_stopped_in_that_time(two: Bench) -> None:
    """It said 12/12 confirmed in 1384 ms: six of them were off before."""
    second = two.desk.stations[1]
    off: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    second.take([telemetry([time.monotonic_ns()], off)])
    two.desk.stop_all("test")
    for commands in two.commands:
        commands.answer(ALL)
    timed(two.desk.stations[0], 84.0)
    assert said(two).endswith("12/12 drives confirmed: 6 stopped in 84 ms, 6 were off before")


def old(station: Station) -> None:
    station.take([walking(10, age_s=10.0)])


def cut(station: Station) -> None:
    seen(station)
    gone(station)


def one_unknown(station: Station) -> None:
    seen(station, None, joints=["left_knee"])


@pytest.mark.parametrize(
    ("happens", "why"),
    [
        (cut, "no link, what its drives do now is not known"),
        (old, "no live values, what its drives do now is not known"),
        (one_unknown, "state not known of left knee"),
    ],
)
def test_a_robot_that_is_not_seen_any_more_has_stopped_as_far_as_is_known(
    two: Bench, happens: Callable[[Station], None], why: str
) -> None:
    """It was counted as stopped for as long as nobody saw otherwise."""
    happens(confirmed(two))
    assert said(two) == (
        "STOP ALL: 1 of 2 robots stopped, 12/12 drives confirmed in 34 ms; "
        f"exo-02 confirmed it, as far as is known: {why}"
    )
    assert mark(two) == "warn"


def test_rows_from_before_the_answer_say_nothing_against_it(two: Bench) -> None:
    """They show drives that are enabled still; the answer is the drives' own, and newer."""
    two.desk.stop_all("test")
    for station, commands in zip(two.desk.stations, two.commands, strict=True):
        seen(station, 4.0)
        commands.answer(ALL)
        timed(station, 2 * HOUR_NS / 1e6)
    assert said(two).startswith("STOP ALL: 2 of 2 robots stopped")


def test_drives_that_are_enabled_again_have_not_stopped(two: Bench) -> None:
    second = confirmed(two)
    seen(second, 4.0, joints=["left_knee", "right_hip"])
    assert said(two) == (
        "STOP ALL: 1 of 2 robots stopped, 6/12 drives confirmed in 34 ms; "
        "exo-02 ENABLED AGAIN: left knee, right hip → STOP again, or use the hardware stop"
    )
    assert mark(two) == "bad"
    seen(second)
    assert said(two).startswith("STOP ALL: 2 of 2 robots stopped, 12/12")


def test_a_stop_that_is_held_no_more_has_not_stopped_its_robot(two: Bench) -> None:
    """Somebody else has reset it, which its journal does not tell yet."""
    confirmed(two).stopping.described(held=False, reason=None)
    assert said(two) == (
        "STOP ALL: 1 of 2 robots stopped, 6/12 drives confirmed in 34 ms; exo-02 STOP NOT HELD: it was "
        "confirmed, and is held no more → STOP again, or use the hardware stop"
    )
    assert mark(two) == "bad"


def test_another_stop_that_is_held_is_confirmed_by_nothing_that_was_of_ours(two: Bench) -> None:
    """The drives that had confirmed ours, which was reset, were counted for it."""
    second = confirmed(two)
    second.reset()
    two.commands[1].answer(OFF)
    second.stopping.read([{"n": 9, "what": "stop", "reason": "fell", "who": "ann"}])
    assert second.stopping.held
    assert said(two) == (
        "STOP ALL: 1 of 2 robots stopped, 6/12 drives confirmed in 34 ms; exo-02 HELD BY ANOTHER STOP: "
        "ours was reset, nobody here saw that one confirmed (fell, by ann) → "
        "STOP again, or use the hardware stop"
    )
    assert not second.stopping.confirmed
    assert mark(two) == "bad"


def fails(*_: object) -> NoReturn:
    raise OSError("out of files")


WRONG: Final = "internal error: OSError: out of files"


def test_a_robot_whose_stop_fails_here_keeps_it_from_no_other(
    two: Bench, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(two.commands[0], "stop", fails)
    with caplog.at_level(logging.ERROR):
        two.desk.stop_all("test")
    assert [record.message for record in caplog.records] == [
        "exo-01: STOP ALL was not sent, or is not known to be"
    ]
    assert two.commands[1].named("stop") == [("test",)]
    two.commands[1].answer(ALL)
    seen(two.desk.stations[1])
    assert "1 of 2 robots stopped" in said(two)
    assert f"exo-01 STILL MOVING: nobody knows whether it was sent: {WRONG} → STOP again" in said(two)
    assert mark(two) == "bad"


def test_a_stop_that_cannot_be_followed_is_not_confirmed_and_the_others_are_followed(
    two: Bench, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Nothing was shown of any, and the robot's STOP of before stood as this one's."""
    first, second = two.desk.stations
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)  # however busy it is here
    confirmed(two)
    seen(second, 4.0)
    monkeypatch.setattr(first, "note_stop", fails)
    with caplog.at_level(logging.ERROR):
        two.desk.stop_all("again")
    assert [record.message for record in caplog.records] == [
        "exo-01: nobody follows what becomes of its STOP"
    ]
    two.commands[1].answer(ALL)
    seen(second)
    assert "1 of 2 robots stopped, 6/12 drives confirmed" in said(two)
    assert f"exo-01 STILL MOVING: nobody follows what becomes of it: {WRONG} → STOP again" in said(two)


def silent(_two: Bench) -> None:
    pass


def failed(two: Bench) -> None:
    two.commands[1].fail(NotConnected("there is no link"))


def enabled_again(two: Bench) -> None:
    two.commands[1].answer(ALL)
    seen(two.desk.stations[1], 4.0)


@pytest.mark.parametrize(
    ("stands", "last"),
    [
        (silent, "before it answered"),
        (failed, "last seen STILL MOVING"),
        (enabled_again, "last seen ENABLED AGAIN"),
    ],
)
def test_a_robot_that_is_removed_before_it_has_stopped_stays_named(
    two: Bench, stands: Callable[[Bench], None], last: str
) -> None:
    """The others were all that was left, and all of them had stopped."""
    first, second = two.desk.stations
    seen(second, 4.0)
    two.desk.stop_all("test")
    two.commands[0].answer(ALL)
    seen(first)
    timed(first, 34.0)
    stands(two)
    two.desk.remove(second)
    told = f"exo-02 STOP NOT CONFIRMED: removed from this window, {last} → use the hardware stop"
    assert said(two) == f"STOP ALL: 1 of 2 robots stopped, 6 drives confirmed in 34 ms; {told}"
    result = two.desk.stopped_all
    assert result is not None
    assert result.wordings[-2] == "STOP ALL: 1 of 2 robots stopped; exo-02 removed, STOP NOT CONFIRMED"
    assert mark(two) == "bad"
    first.reset()
    two.commands[0].answer(OFF)
    assert told in said(two), "nobody has seen it stop since"
    two.desk.stop_all("again")
    two.commands[0].answer(ALL)
    seen(first)
    assert said(two).startswith("STOP ALL: 1 of 1 robot stopped"), "that is of those that are there"


def test_a_robot_that_is_removed_without_a_link_is_no_better_known_to_be_stopped_than_before(
    two: Bench,
) -> None:
    """All that was left said that every robot had stopped."""
    second = confirmed(two)
    gone(second)
    two.desk.remove(second)
    assert said(two) == (
        "STOP ALL: 1 of 2 robots stopped, 6 drives confirmed in 34 ms; exo-02 confirmed it, as far as is "
        "known: no link, what its drives do now is not known; removed from this window → look at the robot "
        "itself"
    )
    result = two.desk.stopped_all
    assert result is not None
    assert result.wordings[-2].endswith("; exo-02 removed, confirmed it, as far as is known: no link")
    assert mark(two) == "warn"


def test_a_robot_that_was_seen_to_have_stopped_may_be_removed(two: Bench) -> None:
    two.desk.remove(confirmed(two))
    assert said(two) == "STOP ALL: 1 of 1 robot stopped, 6/6 drives confirmed in 34 ms"


def test_drives_are_not_counted_of_all_while_one_robot_is_reset_and_another_is_removed(two: Bench) -> None:
    """The twelve were those of the first two, of three robots."""
    two.add("exo-03", 7422).take([described("exo-03"), walking(10), looked()])
    first, second, third = two.desk.stations
    two.desk.stop_all("test")
    for station, commands in zip((first, second), two.commands, strict=False):
        commands.answer(ALL)
        seen(station)
    timed(first, 34.0)
    second.reset()
    two.commands[1].answer(OFF)
    two.desk.remove(third)
    assert said(two).startswith("STOP ALL: 1 of 3 robots stopped, 6 drives confirmed in 34 ms; exo-02 reset")


def test_a_stop_that_is_answered_at_once_took_a_millisecond_and_not_none(two: Bench) -> None:
    """It said: confirmed in 0 ms."""
    two.desk.stop_all("test")
    for station, commands in zip(two.desk.stations, two.commands, strict=True):
        commands.answer(ALL)
        timed(station, 0.2)
    assert said(two) == "STOP ALL: 2 of 2 robots stopped, 12/12 drives confirmed in 1 ms"
