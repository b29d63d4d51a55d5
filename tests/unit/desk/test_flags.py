"""What has happened is found in rows, in the journal and among a recording's events, once each."""

import datetime
import math
import time
from types import SimpleNamespace
from typing import cast

import msgspec

from drivers.error_codes import error_text
from gateway.client import ConnectionState, NotConnected
from gateway.wire.bus import BusInfo, NodeInfo
from gateway.wire.parameter import ParameterInfo
from gateway.wire.stop import Stopped
from server_gui.core.desk.flags import (
    Flag,
    FlagKind,
    Flags,
    StateWatch,
    of_events,
    of_journal,
    of_recorded_journal,
)
from server_gui.core.desk.recording import By, Recording
from server_gui.core.fleet.robot_recording import RobotRecording
from server_gui.core.follow.events import BusesSeen, Described, LinkChanged
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.recorder import Recorder
from tests.support.desk import JOINTS, Bench, described, telemetry, walking

WORDS = {
    name: {"4": "operation enabled", "5": "quick stop active", "7": "fault"}
    for name in ("left_knee.state", "right_knee.state", "right_hip.state")
}
MS = 1_000_000
BUS = BusInfo("can0", "error active", 1_000_000, 40.0, 1000.0, 0, 0, 1, 0, [])


def entry(what: str, at_ns: int, boot_id: str = "b", **more: object) -> dict[str, object]:
    return {"what": what, "monotonic_ns": at_ns, "utc_ns": 10 * at_ns, "boot_id": boot_id, **more}


def test_drives_that_fall_into_a_fault_or_stop_are_flagged_at_their_row() -> None:
    found = list(
        StateWatch().take(
            [10, 20, 30],
            {
                "left_knee.state": [4.0, 7.0, 7.0],
                "right_knee.state": [4.0, None, 5.0],
                "right_hip.state": [4.0, 4.0, 5.0],
                "left_knee.position": [0.0, 1.0, 2.0],
            },
            WORDS,
        )
    )
    assert found == [
        Flag(20, "left knee: fault", FlagKind.FAULT),
        Flag(30, "right hip, right knee: quick stop", FlagKind.STOP),
    ]


def test_a_turn_between_two_batches_is_seen_and_what_was_so_at_first_is_none() -> None:
    watch = StateWatch()
    assert list(watch.take([10], {"left_knee.state": [7.0]}, WORDS)) == [], "it did not turn"
    assert list(watch.take([20], {"left_knee.state": [4.0]}, WORDS)) == []
    assert list(watch.take([30], {"left_knee.state": [None]}, WORDS)) == []
    assert [flag.at_ns for flag in watch.take([40], {"left_knee.state": [7.0]}, WORDS)] == [40]


def test_the_journal_tells_stops_writes_and_trials_of_this_boot() -> None:
    entries = [
        entry("stop", 5, who="jkim", reason="F12"),
        entry("write", 6, who="jkim", after={"gait.step": 1}),
        entry("write", 7, before={"a.b": 0.5}, after={"a.b": 1}, trial_s=9.0),
        entry("stop", 8, boot_id="another"),
        entry("control acquired", 9),
    ]
    assert list(of_journal(entries, "b")) == [
        Flag(5, "stop by jkim: F12", FlagKind.STOP),
        Flag(6, "write gait.step by jkim", FlagKind.WRITE),
        Flag(7, "write a.b 0.5 → 1", FlagKind.TRIAL),
    ]
    assert [flag.at_ns for flag in of_recorded_journal(entries)] == [50, 60, 70, 80]


def test_what_a_window_wrote_is_told_without_its_port() -> None:
    here, there = (
        entry(
            "write",
            at,
            who=f"gwrms gui ({host}:33912)",
            before={"gait.step": 400.0},
            after={"gait.step": 420.0},
        )
        for at, host in ((1, "127.0.0.1"), (2, "10.0.0.7"))
    )
    assert [flag.text for flag in of_journal([here, there], "b")] == [
        "write gait.step 400 → 420 from the window",
        "write gait.step 400 → 420 from the window on 10.0.0.7",
    ]


def test_a_write_is_told_in_the_unit_that_its_parameter_is_shown_in() -> None:
    described = [
        ParameterInfo(name, unit, None, None, None, True, None, "gait", "0x2001:0", "rw", False)
        for name, unit in (("gait.step_length", "m"), ("left_hip.offset", "rad"))
    ]
    before = {"gait.step_length": 0.4, "left_hip.offset": 0.0}
    after = {"gait.step_length": 0.43, "left_hip.offset": -math.pi / 2}
    (flag,) = of_journal([entry("write", 5, before=before, after=after)], "b", described)
    assert flag.text == "write step length (gait) 400 → 430 mm, offset (left hip) 0 → −90 °"


def test_a_trial_that_the_robot_took_back_is_told_with_why() -> None:
    entries = [
        entry("taken back", 5, who="gateway", reason="time ran out"),
        entry("taken back", 5, who="gateway", reason="asked for"),
        entry("stop", 6, who="guard", reason="knee_heat: 71 N·m"),
    ]
    assert [flag.text for flag in of_journal(entries, "b")] == [
        "taken back: time ran out",
        "taken back on request",
        "stop by guard: knee_heat: 71 N·m",
    ]


def test_a_fault_is_flagged_with_the_code_that_its_drive_tells_soon() -> None:
    columns: dict[str, list[float | None]] = {
        "left_knee.state": [4.0, 7.0, 7.0],
        "left_knee.error_code": [0.0, 0.0, 0x2310],
        "right_knee.state": [4.0, 7.0, 7.0],
        "right_knee.error_code": [0x2310, None, 0.0],
        "right_hip.state": [4.0, 4.0, 5.0],
        "right_hip.error_code": [0.0, 0.0, 0x2310],
    }
    assert {flag.text for flag in StateWatch().take([10 * MS, 20 * MS, 30 * MS], columns, WORDS)} == {
        f"left knee: fault {error_text(0x2310)}",
        "right knee: fault",
        "right hip: quick stop",
    }
    late = StateWatch().take([0, 1 * MS, 3000 * MS], columns, WORDS)
    assert "left knee, right knee: fault" in {flag.text for flag in late}


def test_every_event_of_a_recording_is_a_flag_also_what_is_missing_in_it() -> None:
    at = datetime.datetime(2026, 11, 23, tzinfo=datetime.UTC)
    kinds = {"marker": "turns", "gap": "the link was made again", "rule": "rule fall (stop) holds"}
    kinds |= {"clock_step": "this server's clock was set", "unheard_of": "", "dropped": "12 rows"}
    events = [{"kind": kind, "utc": at, "text": text} for kind, text in kinds.items()]
    assert [(flag.text, flag.kind) for flag in of_events(events)] == [
        ("turns", FlagKind.MARK),
        ("the link was made again", FlagKind.GAP),
        ("rule fall (stop) holds", FlagKind.RULE),
        ("this server's clock was set", FlagKind.CHANGE),
        ("gap", FlagKind.GAP),
        ("12 rows", FlagKind.GAP),
    ]


def test_flags_are_in_the_order_of_time_bounded_and_none_is_told_twice() -> None:
    flags = Flags()
    for at in (30, 10, 20):
        flags.add(Flag(at * 1000 * MS, "stop", FlagKind.STOP))
    flags.add(Flag(30_000 * MS, "stop", FlagKind.STOP), Flag(30_100 * MS, "stop", FlagKind.STOP))
    assert [flag.at_ns // (1000 * MS) for flag in flags] == [10, 20, 30]
    assert [flag.at_ns // (1000 * MS) for flag in flags.between(10_001 * MS, 30_000 * MS)] == [20]
    for number in range(2000):
        flags.add(Flag(number * 1000 * MS, "write", FlagKind.WRITE))
    assert len(flags) == 500


def test_a_station_flags_what_its_rows_tell_and_what_is_marked(bench: Bench) -> None:
    station = bench.station
    station.take([telemetry([10 * MS, 20 * MS], {"left_knee.state": [4.0, 7.0]})])
    recording = Recording(By.WINDOW, None, lambda call: call(), bench.desk.news)
    bench.desk.recording = recording
    for told in recording.on_mark:
        told("turns", 0.0)
    assert [(flag.at_ns // MS, flag.kind) for flag in station.flags] == [
        (20, FlagKind.FAULT),
        (20, FlagKind.MARK),
    ]
    for told in recording.on_mark:
        told("before that", (station.robot.age_s() or 0.0) + 0.005)
    newest = next(iter(station.flags))
    assert newest.text == "before that"
    assert 10 * MS <= newest.at_ns <= 20 * MS
    assert station.rings.seconds(20 * MS) == 0.01
    assert station.rings.stamp_ns(0.01) == 20 * MS
    other = described().description
    station.take([Described(msgspec.structs.replace(other, boot_id="another"))])
    assert len(station.flags) == 0, "its clock has begun anew"


def test_a_bus_in_trouble_is_flagged_where_it_began_once_and_again_where_it_becomes_worse(
    bench: Bench,
) -> None:
    bench.station.take([described(), telemetry([1_000, 2_000], {"left_knee.position": [0.0, 0.1]})])

    def see(at_s: float, **now: object) -> None:
        bus = msgspec.structs.replace(BUS, **now)
        bench.station.take([BusesSeen((bus,), round(at_s * 1e9))])

    def told() -> list[Flag]:
        return [flag for flag in bench.station.flags if flag.kind is FlagKind.BUS]

    see(1.0)
    see(2.0, load_percent=85.0)
    assert told() == [], "busy is no trouble yet"
    see(3.0, load_percent=99.0)
    see(4.0, load_percent=90.0)
    see(5.0, load_percent=99.0)
    assert told() == [Flag(2_000, "can0: it is full: 99 % of its time is taken", FlagKind.BUS)]
    bench.station.take([telemetry([3_000], {"left_knee.position": [0.2]})])
    see(6.0, state="bus off")
    assert [(flag.at_ns, flag.text) for flag in told()[1:]] == [(3_000, "can0: bus off")]
    node = NodeInfo(3, ["left_knee"], 0.4, 1.0, 1, 0, 0, 8.0)
    see(40.0)
    see(41.0, nodes=[node])
    assert told()[-1].text == "can0: left knee: 8 % of its PDOs are missing"


def test_the_trouble_of_a_bus_is_recorded_and_flagged_in_the_replay() -> None:
    said: list[tuple[object, ...]] = []
    keeping = RobotRecording(
        "exo-01", cast("Recorder", SimpleNamespace(event=lambda *told: said.append(told)))
    )
    for at_s, state in ((1, "error active"), (2, "bus off"), (3, "bus off")):
        keeping.take(BusesSeen((msgspec.structs.replace(BUS, state=state),), at_s * 10**9))
    assert said == [("exo-01", EventKind.BUS, "can0: bus off")]
    utc = datetime.datetime(2026, 11, 28, tzinfo=datetime.UTC)
    (flag,) = of_events([{"kind": EventKind.BUS.value, "utc": utc, "text": "can0: bus off"}])
    assert (flag.kind, flag.text) == (FlagKind.BUS, "can0: bus off")


def test_each_session_is_told_the_trouble_of_its_buses_and_none_of_the_one_before() -> None:
    said: list[str] = []
    recorder = SimpleNamespace(
        event=lambda _robot, _kind, text: said.append(text),
        describe=lambda *_: None,
        begin=lambda *_: said.append("begins"),
        end=lambda _robot: said.append("ends"),
    )
    keeping = RobotRecording("exo-01", cast("Recorder", recorder))
    node = NodeInfo(3, ["left_knee"], 0.4, 1.0, 1, 0, 0, 8.0)
    missing, off, fine = (
        msgspec.structs.replace(BUS, **now)
        for now in (
            {"nodes": [node]},
            {"state": "bus off"},
            {"nodes": [msgspec.structs.replace(node, pdos_missing_percent=0.0)]},
        )
    )
    first = described()
    another = Described(msgspec.structs.replace(first.description, boot_id="another"))

    def see(at_s: int, *buses: BusInfo) -> None:
        keeping.take(BusesSeen(buses, at_s * 10**9))

    keeping.take(first)
    see(1, off)
    keeping.take(first)  # another link of the same session
    see(2, off)
    assert said == ["begins", "can0: bus off"]
    keeping.take(another)
    see(3, off)
    assert said[2:] == ["begins", "can0: bus off"]
    keeping.pause()
    see(4, missing)
    keeping.go_on("")
    see(5, missing)
    assert said[4:] == ["ends", "begins", "can0: left knee: 8 % of its PDOs are missing"]
    keeping.take(first)
    see(6, fine)
    see(20, fine)
    assert said[7:] == ["begins"], "missing PDOs do not last into the next session"


def test_a_stop_that_is_not_confirmed_has_a_flag_also_where_no_data_came(bench: Bench) -> None:
    station = bench.station
    station.take([described(), walking(10)])
    newest_ns = station.rings.newest_ns or 0
    station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    station.stop("test")
    bench.first.fail(NotConnected("nothing was sent; there is no link"))
    (flag,) = (one for one in station.flags if one.kind is FlagKind.UNPROVEN)
    assert flag.text == "STOP NOT CONFIRMED: nothing was sent; there is no link"
    assert newest_ns < flag.at_ns < newest_ns + 5_000_000_000
    station.stop("again")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    assert [one.kind for one in station.flags].count(FlagKind.UNPROVEN) == 1


def test_a_fault_is_shown_where_its_rows_begin_not_where_somebody_noticed_it() -> None:
    flags = Flags()
    flags.add(
        Flag(1_000, "right hip: fault 0x2310", FlagKind.FAULT),
        Flag(1_500, "left hip, right knee: fault", FlagKind.FAULT),
        Flag(2_000, "right hip", FlagKind.MARK),
    )
    assert flags.instant_of_fault("right_hip", 400_000_000) == 1_000
    assert flags.instant_of_fault("right_knee", 400_000_000) == 1_500
    assert flags.instant_of_fault("left_knee", 400_000_000) == 400_000_000
    assert flags.instant_of_fault("right_hip", 9_000_000_000) == 9_000_000_000, "another one, long before"
