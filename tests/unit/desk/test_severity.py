"""One severity: an event, an alarm and a bus say how bad a thing is by the one table of alarms."""

import dataclasses

import pytest
from msgspec.structs import replace

from gateway.wire.component import QualityInfo, Snapshot
from server_gui.core.alarms.alarm import Alarm, Alarms
from server_gui.core.alarms.marks import NEWS, Mark
from server_gui.core.alarms.severity import bus_level, colour_of, event_mark
from server_gui.core.alarms.texts import TEXTS, Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.follow.events import Described, Event, Looked
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.processing.bus_health import BusHealthLevel as Level
from tests.support.desk import Bench, described, looked, walking

MISSED = "the drive is in fault: 0x8130 life guard or heartbeat error"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A robot whose left knee is a node."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    made, known = Bench(Desk()), described().description
    parts = [
        replace(one, device={"node_id": 2, "bus": "main"}) if one.name == "left_knee" else one
        for one in known.components
    ]
    made.add("exo-01").take([Described(replace(known, components=parts)), walking(50), looked()])
    return made


def quality(**parts: QualityInfo) -> Event:
    whole = looked()
    return Looked(Snapshot(0, {}, {}, dict(parts)), whole.parameters, whole.at_ns)


@pytest.mark.parametrize(("follows", "colour"), [(False, "warn"), (True, "bad")])
def test_a_stale_drive_is_as_bad_in_its_event_as_in_its_alarm_and_at_its_bus(
    bench: Bench, follows: bool, colour: str
) -> None:
    """Also where another drive misses its heartbeat, which makes the alarm worse than its own kind."""
    stale: QualityInfo = {"state": "stale", "age_ms": 700.0, "problem": "no new sample for 0.7 s"}
    fault: QualityInfo = {"state": "fault", "age_ms": 1.0, "problem": MISSED}
    bench.look_again([quality(left_knee=stale, **({"right_knee": fault} if follows else {}))])
    alarms = bench.station.alarms
    (alarm,) = (one.alarm for one in alarms.active)
    (event,) = (item for item in bench.station.news.items if item.text.startswith("left knee stale"))
    assert alarm.mark.colour == colour
    assert event_mark(event, alarms) == Mark(alarm.mark.shape, colour, "STALE")
    earlier = dataclasses.replace(event, utc_s=event.utc_s - 60.0)
    assert event_mark(earlier, alarms) == NEWS[NewsKind.STALE], "the alarm is about another time"
    assert bus_level(Level.ALARM, "main", alarms) is Level.ALARM
    assert bus_level(Level.WARNING, "main", alarms) is (Level.ALARM if follows else Level.WARNING)
    assert bus_level(Level.GOOD, "other", alarms) is Level.GOOD
    bench.look_again(
        [
            quality(
                **{
                    name: {"state": "ok", "age_ms": 1.0, "problem": None}
                    for name in ("left_knee", "right_knee")
                }
            )
        ]
    )
    assert event_mark(event, bench.station.alarms) == NEWS[NewsKind.STALE], "what is over is as it was told"


def test_of_two_alarms_about_one_thing_the_worse_one_counts() -> None:
    alarms, news = Alarms(), News()
    alarms.look([Alarm(Kind.LOST, "left_knee", "gone"), Alarm(Kind.PART_STALE, "left_knee", "old")], 100.0)
    news.add(NewsKind.STALE, "exo-01", "left knee stale", "left_knee")
    assert event_mark(news.items[0], alarms).colour == colour_of("left_knee", alarms) == "bad"


def test_without_an_alarm_an_event_is_as_bad_as_the_table_says() -> None:
    for news, kind in (
        (NewsKind.STALE, Kind.PART_STALE),
        (NewsKind.LOST, Kind.LOST),
        (NewsKind.FAULT, Kind.FAULT),
    ):
        assert (NEWS[news].shape, NEWS[news].colour) == (TEXTS[kind].mark.shape, TEXTS[kind].mark.colour)


def test_a_store_that_is_away_comes_before_trouble_of_a_bus_and_after_danger() -> None:
    ranks = [Alarm(kind, "", "", check="").rank for kind in (Kind.DANGER_ADVICE, Kind.UPLOAD, Kind.BUS)]
    assert ranks == sorted(ranks)
