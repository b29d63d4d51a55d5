"""Danger at the desk: an alarm from advice on, a flag on the axis of time, and never fine where unknown."""

import time
from datetime import UTC, datetime
from typing import Any, Final

import pytest
from msgspec.structs import replace

from gateway.client import ConnectionState
from gateway.wire.stop import Stopped
from ml.danger.levels import Level
from server_gui.core.alarms.texts import Kind
from server_gui.core.alarms.undriven import HELD, undriven
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.flags import FlagKind, of_events
from server_gui.core.desk.station import Station
from server_gui.core.fleet.live_prediction import RecordedPrediction
from server_gui.core.follow.events import Described, LinkChanged
from server_gui.core.prediction.news import turn
from server_gui.core.prediction.robot_predictor import RobotPredictor
from server_gui.core.recording.batching import EventKind
from server_gui.terminal.danger_prediction import DangerPrediction
from tests.support.desk import JOINTS, Bench, described, looked, telemetry, walking
from tests.support.terminal_robot import a_station, screen
from tests.unit.prediction.endangered import HOT, endangered
from tests.unit.prediction.robots import ROBOT

NOW: Final = datetime.now(UTC)
KINDS: Final = {Kind.DANGER, Kind.DANGER_ADVICE}


@pytest.fixture
def station(monkeypatch: pytest.MonkeyPatch) -> Station:
    """A robot that walks, whose data and whose danger stay new within a test."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    monkeypatch.setattr("server_gui.core.prediction.newest_predictions.STALE_S", 60.0)
    bench = Bench(Desk())
    made = bench.add("exo-01")
    made.predictions.foresees = True
    made.take([described(), walking(50), looked()])
    return made


def told(station: Station) -> list[tuple[Kind, bool]]:
    """The alarms of danger, and whether each is so now."""
    active = (one.alarm for one in station.alarms.active)
    return [(alarm.kind, alarm.is_now) for alarm in active if alarm.kind in KINDS]


@pytest.mark.parametrize(
    ("level", "kind", "colour"),
    [
        (Level.UNKNOWN, None, None),
        (Level.NONE, None, None),
        (Level.EARLY, None, None),
        (Level.ADVICE, Kind.DANGER_ADVICE, "warn"),
        (Level.ALARM, Kind.DANGER, "bad"),
        (Level.STOP, Kind.DANGER, "bad"),
    ],
)
def test_from_advice_on_it_is_an_alarm_with_its_level_and_reasons(
    station: Station, level: Level, kind: Kind | None, colour: str | None
) -> None:
    station.take_prediction(endangered(level))
    assert told(station) == ([] if kind is None else [(kind, True)])
    if kind is not None:
        (one,) = station.alarms.active
        assert one.alarm.mark.colour == colour
        assert one.alarm.line.endswith(f"level {level.word}: {HOT}")
        assert "on trial, and may be wrong" in one.alarm.check
        assert f"{kind.value}: level {level.word}: {HOT}" in screen(station)
        assert f"danger: {level.word}" in screen(station)


def test_what_nobody_knows_any_more_is_not_over(station: Station) -> None:
    station.take_prediction(endangered(Level.ALARM))
    station.take_prediction(endangered(Level.UNKNOWN))
    assert told(station) == [(Kind.DANGER, False)]
    (one,) = station.alarms.active
    assert one.alarm.did == "whether it is so still is not known"
    station.take_prediction(endangered(Level.NONE))
    assert not told(station)


def test_a_robot_that_is_stopped_or_has_gone_is_not_judged(station: Station) -> None:
    station.take_prediction(endangered(Level.ALARM))
    station.stopping.described(True, "somebody's")
    assert not told(station)
    station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    assert station.predictions.danger is not None
    assert not station.predictions.danger.is_known
    assert Kind.NO_LINK in {one.alarm.kind for one in station.alarms.active}


def test_a_blink_of_the_link_ends_no_danger_and_another_start_does(station: Station) -> None:
    station.take_prediction(endangered(Level.ALARM))
    for state in (ConnectionState.WAITING, ConnectionState.CONNECTED):
        station.take([LinkChanged(state, "gone", time.monotonic_ns())])
    station.take([walking(10)])
    assert told(station) == [(Kind.DANGER, False)]
    anew = described()
    station.take([Described(replace(anew.description, boot_id="another"))])
    assert not told(station)
    station.take_prediction(endangered(Level.EARLY))
    station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    assert station.predictions.danger is None, "it was none to look at"


def test_danger_that_goes_on_after_the_link_was_lost_is_an_event_again(station: Station) -> None:
    station.take_prediction(endangered(Level.ALARM))
    station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    before = len([flag for flag in station.flags if flag.kind is FlagKind.DANGER])
    station.take_prediction(endangered(Level.ALARM, stamp_ns=9 * 10**9))
    assert len([flag for flag in station.flags if flag.kind is FlagKind.DANGER]) == before + 1


@pytest.mark.parametrize("others", [4.0, 5.0, None])
@pytest.mark.parametrize("one", [5.0, 7.0])
def test_one_drive_that_stops_does_not_end_the_danger_of_those_that_go_on(
    station: Station, one: float, others: float | None
) -> None:
    station.take_prediction(endangered(Level.ALARM))
    columns: dict[str, list[float | None]] = {f"{joint}.state": [others] for joint in JOINTS}
    station.take([telemetry([time.monotonic_ns()], {**columns, "left_knee.state": [one]})])
    assert (Kind.DANGER in {kind for kind, _ in told(station)}) is (others != 5.0)


def test_a_stop_that_is_not_confirmed_ends_no_danger_while_drives_are_enabled(station: Station) -> None:
    station.take_prediction(endangered(Level.ALARM))
    stopping = station.stopping
    stopping.described(True, "somebody's")
    assert undriven(station.robot, stopping) == HELD
    number = stopping.sent()
    assert undriven(station.robot, stopping) != HELD
    stopping.answered(number, Stopped(dict.fromkeys(JOINTS, "unconfirmed"), held=True))
    assert undriven(station.robot, stopping) != HELD
    assert Kind.DANGER in {kind for kind, _ in told(station)}
    assert "danger: alarm" in screen(station)


def test_it_stands_on_the_axis_of_time_where_it_begins_gets_worse_and_ends(station: Station) -> None:
    levels = (Level.NONE, Level.EARLY, Level.ADVICE, Level.ADVICE, Level.ALARM, Level.UNKNOWN, Level.NONE)
    for second, level in enumerate(levels):
        station.take_prediction(endangered(level, stamp_ns=second * 10**9))
    flags = [flag for flag in station.flags if flag.kind is FlagKind.DANGER]
    assert [(flag.at_ns // 10**9, flag.text) for flag in flags] == [
        (2, f"danger: advice: {HOT}"),
        (4, f"danger: alarm: {HOT}"),
        (5, "danger: not known any more, after alarm"),
    ]


def test_what_ends_is_said_and_what_is_below_advice_is_not_noted() -> None:
    assert turn(Level.STOP, endangered(Level.EARLY).verdict) == "danger: stop is over"
    assert turn(Level.NONE, endangered(Level.EARLY).verdict) is None
    assert turn(Level.UNKNOWN, endangered(Level.NONE).verdict) is None


def test_a_recording_keeps_it_as_events_which_are_shown_again() -> None:
    kept: list[dict[str, Any]] = []

    class Recorder:
        def event(self, robot: str, kind: EventKind, text: str, **data: Any) -> None:
            kept.append({"robot": robot, "kind": kind.value, "text": text, "utc": NOW, **data})

    one = object.__new__(RecordedPrediction)
    one._recorder, one._show, one._levels = Recorder(), None, {}  # type: ignore[assignment]
    one._session = lambda _: ""
    one._keep([endangered(Level.NONE), endangered(Level.ADVICE), endangered(Level.ADVICE)])
    one._keep([endangered(Level.NONE)])
    assert [(event["robot"], event["level"]) for event in kept] == [(ROBOT, "advice"), (ROBOT, "none")]
    gap = {"kind": "gap", "text": "12 notifications were lost", "utc": NOW}
    assert [flag.kind for flag in of_events([*kept, gap])] == [FlagKind.DANGER] * 2 + [FlagKind.GAP]


def test_the_terminal_says_the_level_and_that_it_is_not_known_and_nothing_where_it_is_off() -> None:
    station = a_station()
    assert "danger" not in screen(station)
    station.predictions.foresees = True
    assert "danger: not known" in screen(station)
    for level, words in ((Level.NONE, "danger: none"), (Level.UNKNOWN, "danger: not known")):
        station.take_prediction(endangered(level))
        assert words in screen(station, size=(80, 24))


def test_what_breaks_while_it_foresees_is_told_once_and_ends_nothing_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[str] = []
    one = DangerPrediction(ROBOT, told.append)

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(RobotPredictor, "take", broken)
    assert [list(one.take([])) for _ in range(2)] == [[], []]
    assert told == ["danger is not foreseen any more: internal error, ZeroDivisionError"]
