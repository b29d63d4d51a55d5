"""STOP ALL has one result of all robots together: who is stopped, how soon, and who is not, and why."""

import time

import pytest

from gateway.client import NOTHING_SENT, ConnectionState, NotConnected
from gateway.wire.stop import Reset, Stopped
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import LinkChanged
from tests.support.desk import JOINTS, Bench, described, looked, telemetry, walking

ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)
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


def test_every_robot_that_confirms_is_one_result_with_its_drives_and_the_slowest_time(two: Bench) -> None:
    two.desk.stop_all("test")
    assert said(two).startswith("STOP ALL sent: 0 of 2 robots stopped; no answer yet from exo-01, exo-02")
    two.commands[0].answer(ALL)
    assert "1 of 2 robots stopped" in said(two)
    assert said(two).endswith("no answer yet from exo-02")
    two.commands[1].answer(ALL)
    timed(two.desk.stations[0], 34.0)
    timed(two.desk.stations[1], 84.0)
    assert said(two) == "STOP ALL: 2 of 2 robots stopped, 12/12 drives confirmed in 84 ms"


def test_a_robot_without_a_link_is_not_confirmed_with_its_reason_and_what_to_do(two: Bench) -> None:
    gone(two.desk.stations[1])
    two.desk.stop_all("test")
    two.commands[0].answer(ALL)
    two.commands[1].fail(NotConnected(f"{NOTHING_SENT}: there is no link"))
    timed(two.desk.stations[0], 34.0)
    result = two.desk.stopped_all
    assert result is not None
    assert (result.mark.shape, result.mark.colour) == ("square", "bad")
    assert result.wordings[0] == (
        "STOP ALL: 1 of 2 robots stopped, 6/12 drives confirmed in 34 ms; "
        f"exo-02 STOP NOT CONFIRMED: {NOTHING_SENT}: there is no link → use the hardware stop"
    )
    assert result.wordings[-1] == "STOP ALL: 1 of 2 robots stopped; exo-02 STOP NOT CONFIRMED"


def test_drives_of_a_robot_that_was_never_reached_are_not_counted_as_none(two: Bench) -> None:
    two.add("exo-03", 7422)
    two.desk.stop_all("test")
    for commands in two.commands[:2]:
        commands.answer(ALL)
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
    two.desk.stop_all("test")
    for commands in two.commands:
        commands.answer(ALL)
    first.reset()
    two.commands[0].answer(OFF)
    assert "1 of 2 robots stopped" in said(two)
    assert "exo-01 reset" in said(two)
    second.reset()
    two.commands[1].answer(OFF)
    assert two.desk.stopped_all is None
    two.desk.stop_all("again")
    for commands in two.commands:
        commands.answer(ALL)
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
