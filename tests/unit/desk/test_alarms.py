"""What is wrong with a robot: its cause, since when, what to check; the unknown is never good."""

import re
import time
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from drivers.error_codes import error_check
from gateway.client import ConnectionState, LinkLost, NotConnected
from gateway.main import COMMANDS
from gateway.wire.component import QualityInfo, Snapshot
from gateway.wire.control import JournalEntries
from gateway.wire.robot import GuardInfo, GuardRuleInfo
from gateway.wire.stop import Reset, Stopped
from server_gui.core.alarms import watch as watch_module
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.marks import STATES, Mark
from server_gui.core.alarms.texts import TEXTS, Kind
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Described, Event, Journalled, LinkChanged, Looked
from server_gui.core.follow.frame_time import one_moment
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.follow.robot_news import RobotNews
from tests.support.desk import JOINTS, Bench, described, kinds, looked, telemetry, walking, walking_bench

CAUSE = "0x2310 continuous overcurrent at the output (register: generic, current)"
ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


def states(number: float, **others: float) -> Event:
    """A row, just now, with every drive in this state but these."""
    now_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {
        f"{joint}.state": [others.get(joint, number)] for joint in JOINTS
    }
    return telemetry([now_ns], columns, now_ns)


def fault(station: Station) -> None:
    station.take(
        [states(5.0, left_knee=7.0), looked(state="fault", problem=f"the drive is in fault: {CAUSE}")]
    )


def test_a_robot_that_is_well_has_no_alarm_and_is_as_its_drives_are(bench: Bench) -> None:
    assert kinds(bench.station) == []
    assert bench.station.mark == STATES["operation enabled"]


def test_a_fault_says_its_cause_first_where_it_is_what_was_done_and_what_to_check(bench: Bench) -> None:
    description = described().description
    components = [
        replace(part, device={"node_id": 2, "bus": "can0"}) if part.name == "left_knee" else part
        for part in description.components
    ]
    bench.station.take([Described(replace(description, components=components))])
    fault(bench.station)
    (one,) = bench.station.alarms.active
    assert one.alarm.line == f"fault: left knee, node 2 on can0: {CAUSE}"
    assert one.alarm.check == error_check(0x2310)
    assert one.alarm.did == "no drive is enabled: 5 quick stop active, 1 fault"
    assert (one.alarm.channel, one.alarm.clears) == ("left_knee.current", True)
    assert one.alarm.mark == TEXTS[Kind.FAULT].mark
    assert bench.station.mark == Mark("square", "bad", "left knee fault")


def test_a_robot_of_which_one_part_is_lost_says_which_in_its_word(bench: Bench) -> None:
    """It said "lost" beside green drives: nobody knew whether that was the robot."""
    lost: QualityInfo = {"state": "lost", "age_ms": 4000.0, "problem": "nothing came for 4 s"}
    whole = looked()
    bench.station.take([Looked(Snapshot(0, {}, {}, {"left_insole": lost}), whole.parameters, whole.at_ns)])
    assert bench.station.mark == Mark("cross", "bad", "left insole lost")


def test_what_the_robot_advises_is_said_once_in_place_of_what_is_usual(bench: Bench) -> None:
    bench.station.take([looked(state="lost", problem="no heartbeat for 3 s: check the cable")])
    alarm = bench.station.alarms.active[0].alarm
    assert alarm.line.endswith("no heartbeat for 3 s")
    assert alarm.check == "check the cable"


def test_what_is_wrong_twice_is_said_as_such_and_so_is_what_to_check(bench: Bench) -> None:
    twice = "its heartbeat is missing: check its power; it goes on; its position jumped: check its encoder"
    bench.station.take([looked(state="lost", problem=twice)])
    alarm = bench.station.alarms.active[0].alarm
    assert alarm.what == "its heartbeat is missing; its position jumped"
    assert alarm.check == "check its power; it goes on; check its encoder"
    more = (
        "its heartbeat is missing: check its power; it reports 0x8130 life guard error; 3 % of it is missing"
    )
    bench.station.take([looked(state="lost", problem=more)])
    alarm = bench.station.alarms.active[0].alarm
    assert alarm.what == "its heartbeat is missing; it reports 0x8130 life guard error; 3 % of it is missing"
    assert alarm.check == "check its power", "a second problem is no advice"
    bench.station.take([looked(state="stale", problem="this computer stood still: see what keeps it busy")])
    alarm = bench.station.alarms.active[0].alarm
    assert (alarm.what, alarm.check) == ("this computer stood still", "see what keeps it busy")


def test_what_else_is_wrong_with_a_drive_in_fault_is_to_be_checked_as_well(bench: Bench) -> None:
    more = "7 % of its PDOs are missing: check its cable"
    problem = f"the drive is in fault: {CAUSE}; {more}"
    bench.station.take([states(5.0, left_knee=7.0), looked(state="fault", problem=problem)])
    (alarm,) = (one for one in bench.station.alarms.each if one.kind is Kind.FAULT)
    assert alarm.what == f"{CAUSE}; 7 % of its PDOs are missing"
    assert alarm.check == f"{error_check(0x2310)}; check its cable"


def test_a_word_has_one_mark_whatever_it_explains_that_is_as_bad() -> None:
    """Lost is a cross, also where what follows from it is a square of the same colour."""
    own = TEXTS[Kind.LOST].mark
    for as_bad in (kind for kind in Kind if TEXTS[kind].mark.colour == own.colour):
        assert Alarm(Kind.LOST, "left_knee", "silent", under=(Alarm(as_bad, "gait", "jumped"),)).mark == own


def test_a_drive_that_tells_its_code_alone_is_put_into_words(bench: Bench) -> None:
    now_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {"left_knee.state": [7.0], "left_knee.error_code": [0x8611]}
    bench.station.take([telemetry([now_ns], columns, now_ns)])
    assert bench.station.alarms.active[0].alarm.what == "0x8611 following error too large"


def test_an_alarm_keeps_its_beginning_and_ends_with_its_cause(bench: Bench) -> None:
    fault(bench.station)
    (before,) = bench.station.alarms.active
    fault(bench.station)
    (after,) = bench.station.alarms.active
    assert (after.since_s, after.at_ns) == (before.since_s, before.at_ns)
    bench.station.take([walking(10), looked()])
    assert kinds(bench.station) == []


def test_what_is_acknowledged_is_no_better_for_it(bench: Bench) -> None:
    fault(bench.station)
    bench.station.alarms.acknowledge((Kind.FAULT, "left_knee"))
    assert bench.station.alarms.active[0].is_acknowledged
    assert bench.station.mark.word == "left knee fault"


def _link_lost(bench: Bench) -> None:
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])


def _never_reached(bench: Bench) -> None:
    lost = LinkChanged(ConnectionState.WAITING, "no gateway", time.monotonic_ns())
    bench.desk.stations[0] = Station("x", "127.0.0.1:1", bench.first, lambda call: call(), News())
    bench.station.take([lost])


def _another(bench: Bench) -> None:
    why = "ANOTHER ROBOT ANSWERS AT 127.0.0.1:1, or somebody in between"
    bench.station.take([LinkChanged(ConnectionState.WAITING, why, time.monotonic_ns(), is_another=True)])


def _no_data(bench: Bench) -> None:
    bench.desk.stations.clear()
    bench.add("exo-03").take([described()])


def _stale(bench: Bench) -> None:
    bench.desk.stations.clear()
    bench.add("exo-03").take([described(), walking(5, age_s=90.0)])


@pytest.mark.parametrize(
    ("happens", "kind"),
    [
        (_link_lost, Kind.NO_LINK),
        (_never_reached, Kind.NEVER_REACHED),
        (_another, Kind.ANOTHER),
        (_no_data, Kind.NO_DATA),
        (_stale, Kind.STALE),
    ],
)
def test_each_way_not_to_know_has_its_own_word_and_none_is_good(
    bench: Bench, happens: Callable[[Bench], None], kind: Kind
) -> None:
    happens(bench)
    assert kinds(bench.station) == [kind]
    assert bench.station.mark == TEXTS[kind].mark
    assert bench.station.mark.colour != "good"


def test_no_kind_of_alarm_is_green_and_each_says_what_to_check() -> None:
    assert set(TEXTS) == set(Kind)
    assert all(text.mark.colour != "good" and text.check for text in TEXTS.values())


def test_a_command_that_an_alarm_names_is_there() -> None:
    named = {name for text in TEXTS.values() for name in re.findall(r"gwrms ([a-z-]+)", text.check)}
    assert "gateway" in named
    assert named <= set(COMMANDS)


def test_a_state_that_this_program_does_not_know_is_not_taken_for_well(bench: Bench) -> None:
    bench.station.take([looked(state="dozing")])
    assert kinds(bench.station) == [Kind.UNKNOWN]


def test_a_rule_that_has_tripped_says_why_and_what_it_did(bench: Bench) -> None:
    rule = GuardRuleInfo(
        "knee_heat",
        "torque",
        "above 60 N·m",
        ["left_knee"],
        ["quick_stop"],
        "alarm",
        "tripped",
        0,
        None,
        1,
        [],
    )
    guard = GuardInfo(configured=True, rules=[rule])
    entry = {"n": 1, "hash": "x", "who": "guard", "what": "alarm", "about": "knee_heat", "reason": "71 N·m"}
    bench.station.take([Described(replace(described().description, guard=guard)), walking(5)])
    bench.station.audit.entries.append(entry)
    (one,) = bench.station.alarms.active
    assert (one.alarm.kind, one.alarm.what) == (Kind.GUARD, "71 N·m")
    assert "quick stop" in one.alarm.did
    assert one.alarm.channel == "left_knee.torque"


# --- STOP


def test_a_confirmed_stop_is_proved_drive_by_drive_and_says_how_to_go_on(bench: Bench) -> None:
    bench.station.stop("test")
    bench.station.take([states(5.0)])
    bench.first.answer(ALL)
    stopping = bench.station.stopping
    assert set(stopping.proofs) == set(JOINTS)
    assert all(proof.state == "quick stop active" for proof in stopping.proofs.values())
    (one,) = bench.station.alarms.active
    assert one.alarm.kind is Kind.STOPPED
    assert "all 6 drives confirmed in quick stop active within" in one.alarm.did
    assert "Reset stop…" in one.alarm.check


def test_rows_from_before_the_stop_prove_nothing(bench: Bench) -> None:
    before = states(5.0)
    bench.station.stop("test")
    bench.station.take([before])
    assert bench.station.stopping.proofs == {}


def test_a_drive_that_a_stop_has_stopped_before_the_window_notes_it_was_not_off_already(bench: Bench) -> None:
    bench.station.take([states(4.0)])
    sent = bench.station.send_stop("a key, in a thread of its own")
    stopped = states(5.0)
    bench.station.take([stopped])
    bench.station.note_stop(sent)
    bench.station.take([stopped])
    proofs = bench.station.stopping.proofs
    assert set(proofs) == set(JOINTS)
    assert not any(proof.was_so for proof in proofs.values())


def test_what_every_drive_does_at_once_is_one_short_event(bench: Bench) -> None:
    told: list[str] = []
    others = [joint.replace("_", " ") for joint in JOINTS if joint != "left_knee"]
    news = RobotNews(lambda _kind, text, _about="": told.append(text))
    all_but_the_knee = states(6.0, left_knee=4.0)
    for event in (states(4.0), states(5.0), states(5.0, left_knee=4.0), all_but_the_knee):
        bench.station.take([event])
        news.look(bench.station.robot)
    assert [text for text in told if "→" in text] == [
        "all 6 drives: operation enabled → quick stop active",
        "left knee: quick stop active → operation enabled",
        f"5 of 6 drives: quick stop active → switch on disabled ({', '.join(others)})",
    ]


def test_a_fault_and_its_error_are_one_event(bench: Bench) -> None:
    told: list[str] = []
    news = RobotNews(lambda _kind, text, _about="": told.append(text))
    for state, code in ((4.0, 0.0), (7.0, float(0x2310))):
        row: dict[str, list[float | None]] = {"left_knee.state": [state], "left_knee.error_code": [code]}
        bench.station.take([telemetry([time.monotonic_ns()], row)])
        news.look(bench.station.robot)
    (one,) = [text for text in told if "left knee" in text]
    assert one.startswith("left knee: 0x2310 ")
    assert one.endswith(" (operation enabled → fault)")


def test_a_fault_again_is_an_event_where_a_drive_keeps_its_last_code(bench: Bench) -> None:
    told: list[str] = []
    news = RobotNews(lambda _kind, text, _about="": told.append(text))
    code: list[float | None] = [float(0x2310)]
    bench.station.take([looked(state="fault", problem=f"the drive is in fault: {CAUSE}")])
    for state in (4.0, 7.0, 6.0, 7.0):
        columns: dict[str, list[float | None]] = {"left_knee.state": [state], "left_knee.error_code": code}
        bench.station.take([telemetry([time.monotonic_ns()], columns)])
        news.look(bench.station.robot)
    assert [text for text in told if "→ fault" in text] == ["left knee: switch on disabled → fault"]
    assert len([text for text in told if "0x2310" in text]) == 1


@pytest.mark.parametrize("first", ["the drive", "the robot's word"])
def test_what_the_drive_and_the_robot_say_of_one_fault_is_said_once_each_time_it_comes(
    bench: Bench, first: str
) -> None:
    told: list[str] = []
    news = RobotNews(lambda _kind, text, _about="": told.append(text))

    def row(state: float, code: float) -> None:
        values: dict[str, list[float | None]] = {"left_knee.state": [state], "left_knee.error_code": [code]}
        bench.station.take([telemetry([time.monotonic_ns()], values)])
        news.look(bench.station.robot)

    def word(state: str, problem: str | None = None) -> None:
        bench.station.take([looked(state=state, problem=problem)])
        news.look(bench.station.robot)

    def faults(code: str) -> int:
        return len([text for text in told if code in text])

    in_fault = "the drive is in fault: 0x2310 continuous overcurrent at the output (register: current)"

    def by_the_drive() -> None:
        row(7.0, float(0x2310))

    def by_the_robot() -> None:
        word("fault", in_fault)

    both = [by_the_drive, by_the_robot]
    row(4.0, 0.0)
    for one in (both[1], both[0]) if first != "the drive" else ():
        one()
        assert len([text for text in told if "fault" in text]) == 1, "nor is its state told then"
    told.clear()
    row(4.0, 0.0)
    word("ok")
    told.clear()
    for count in (1, 2):
        for one in both if first == "the drive" else reversed(both):
            one()
        assert faults("0x2310") == count
        row(6.0, 0.0)  # cleared, whether or not the robot has had time to say so
        if count == 1 and first == "the drive":
            continue
        word("ok")
    word("fault", in_fault.replace("0x2310", "0x4210"))
    assert faults("0x4210") == 1
    for state in ("lost", "fault"):
        word(state, in_fault.replace("0x2310", "0x4210"))
    assert faults("0x4210") == 3, "it was lost meanwhile: the lost part's words, and it is in fault again"
    word("ok")
    word("fault", "its values cannot be: no code")
    assert faults("no code") == 1


def test_the_result_of_a_stop_does_not_hide_a_fault(bench: Bench) -> None:
    fault(bench.station)
    bench.station.stop("test")
    bench.first.answer(ALL)
    assert kinds(bench.station) == [Kind.FAULT, Kind.STOPPED]


def test_after_a_reset_it_says_how_to_go_on_until_a_drive_is_enabled(bench: Bench) -> None:
    bench.station.take([states(5.0)])
    bench.station.stop("test")
    bench.first.answer(ALL)
    bench.station.reset()
    bench.first.answer(Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False))
    (one,) = bench.station.alarms.active
    assert one.alarm.kind is Kind.RESET
    assert "to go on: enable the drives: start the robot's controller again" in one.alarm.check
    bench.station.take([states(4.0)])
    assert kinds(bench.station) == []


def test_a_drive_that_does_not_leave_fault_is_told_and_no_success(bench: Bench) -> None:
    fault(bench.station)
    told: list[str] = []
    bench.station.reset(told.append)
    stays = "it stays in fault: 0x4310 drive temperature too high; let it cool, then reset it again"
    drives = {**dict.fromkeys(JOINTS, "switch on disabled"), "left_knee": "fault"}
    bench.first.answer(Reset(drives, {"left_knee": stays}, held=False))
    assert told == [f"left_knee DID NOT LEAVE FAULT: {stays}"]
    grave = bench.desk.news.items[0]
    assert (grave.kind, grave.text) == (NewsKind.FAULT, told[0])
    assert not any("every drive is off" in item.text for item in bench.desk.news.items)


def test_a_clearing_that_was_refused_is_told_too(bench: Bench) -> None:
    told: list[str] = []
    bench.station.reset(told.append)
    bench.first.fail(NotConnected("bob has the lease"))
    assert told == ["Nothing was cleared: bob has the lease"]


def test_of_a_clearing_whose_answer_was_lost_nobody_knows(bench: Bench) -> None:
    told: list[str] = []
    bench.station.reset(told.append)
    bench.first.fail(LinkLost("the link broke"))
    assert told == ["Nobody knows whether anything was cleared: the link broke"]


def test_an_answer_to_a_reset_takes_no_stop_away_that_was_sent_meanwhile(bench: Bench) -> None:
    bench.station.reset()
    reset = bench.first.futures[-1]
    bench.station.stop("test")
    bench.first.answer(ALL)
    reset.set_result(Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False))
    assert bench.station.stopping.held
    assert kinds(bench.station) == [Kind.STOPPED]


def test_a_look_for_alarms_that_ends_half_way_is_no_look(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise ValueError("a mistake of ours")

    fault(bench.station)
    with one_moment():
        bench.station.take([])
        with monkeypatch.context() as patched:
            patched.setattr(watch_module, "alarms", fails)
            for _ in range(2):  # the second place that asks gets no old ones either
                with pytest.raises(ValueError, match="a mistake"):
                    _ = bench.station.alarms
        assert kinds(bench.station) == [Kind.FAULT]


def test_a_stop_of_somebody_else_is_read_in_the_journal_and_so_is_its_end(bench: Bench) -> None:
    stop = {"n": 7, "hash": "a", "who": "gwrms stop", "what": "stop", "reason": "door", "utc_ns": 5}
    bench.station.take([Journalled(JournalEntries([stop], None))])
    assert bench.station.stopping.held
    assert "door, by gwrms stop" in bench.station.alarms.active[0].alarm.what
    reset = {"n": 8, "hash": "b", "who": "gwrms reset", "what": "reset", "held": False}
    bench.station.take([Journalled(JournalEntries([stop, reset], None))])
    assert not bench.station.stopping.held


# --- names and news


def test_the_name_that_the_user_gave_is_kept(bench: Bench) -> None:
    station = Station("walker", "127.0.0.1:1", bench.first, lambda call: call(), News(), is_named=True)
    station.take([described("simulated-exo")])
    assert station.title == "walker"


def test_sensors_that_come_and_go_do_not_push_a_fault_away() -> None:
    news = News()
    news.add(NewsKind.FAULT, "exo", "left_knee fault")
    for number in range(2000):
        news.add(NewsKind.STALE, "exo", f"right_insole {number} stale")
    assert news.items[-1].text == "left_knee fault"
    assert len(news.items) == 500


def test_what_comes_and_goes_is_counted_on_one_line() -> None:
    news = News()
    for number in range(5):
        news.add(NewsKind.STALE, "exo", f"right_insole stale: no frame for 0.{number} s")
        news.add(NewsKind.STATE, "exo", "right_insole ok")
    assert [(item.text[:20], item.count) for item in news.items] == [
        ("right_insole ok", 5),
        ("right_insole stale: ", 5),
    ]


def test_faults_of_two_nodes_are_not_one() -> None:
    news = News()
    for node in (2, 3):
        news.add(NewsKind.LOST, "exo", f"no heartbeat from node {node}")
    assert len(news.items) == 2


def test_a_look_without_quality_takes_no_alarm_back(bench: Bench) -> None:
    bench.station.take([looked(state="lost", problem="no heartbeat")])
    bench.station.take([Looked(Snapshot(0, {}, {}, {}), None, 0)])
    assert kinds(bench.station) == [Kind.LOST]
