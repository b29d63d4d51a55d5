"""Alarms of a STOP: its proof, its failure, its end, and whoever sent it."""

import time

import pytest

from gateway.client import ConnectionState, LinkLost, NotConnected
from gateway.wire.control import JournalEntries
from gateway.wire.stop import Reset
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk import station as station_module
from server_gui.core.follow.events import Journalled, LinkChanged
from server_gui.core.follow.frame_time import one_moment
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot_news import RobotNews
from server_gui.core.tuning.stop import StopState
from tests.support.desk import JOINTS, Bench, walking
from tests.unit.desk.alarming import ALL, fault, kinds, link_lost, states, walking_bench


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


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


def test_a_robot_that_moves_after_an_unconfirmed_stop_is_to_be_stopped_again(bench: Bench) -> None:
    link_lost(bench)
    bench.station.stop("test")
    bench.first.fail(NotConnected("there is no link"))
    assert kinds(bench.station) == [Kind.NOT_STOPPED, Kind.NO_LINK]
    assert "still moving" not in bench.station.alarms.active[0].alarm.line
    bench.station.take([LinkChanged(ConnectionState.CONNECTED, None, time.monotonic_ns()), walking(10)])
    assert "still moving: STOP again" in bench.station.alarms.active[0].alarm.line
    assert bench.station.mark.word == "STOP NOT CONFIRMED"


def test_a_stop_that_never_went_out_has_stopped_no_drive_that_was_off(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    bench.station.take([states(5.0, left_knee=4.0)])
    bench.station.stop("test")
    bench.first.fail(NotConnected("there is no link"))
    bench.station.take([states(5.0)])
    proofs = bench.station.stopping.proofs
    assert {joint for joint, proof in proofs.items() if not proof.was_so} == {"left_knee"}
    assert proofs["left_hip"].when == "already off"


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
    news = RobotNews(lambda _kind, text, _about="": told.append(text))
    for event in (states(4.0), states(5.0), states(5.0, left_knee=4.0)):
        bench.station.take([event])
        news.look(bench.station.robot)
    assert [text for text in told if "→" in text] == [
        "all 6 drives: operation enabled → quick stop active",
        "left knee: quick stop active → operation enabled",
    ]


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
            patched.setattr(station_module, "found", fails)
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


def written(number: int, what: str, **more: object) -> dict[str, object]:
    return {"n": number, "hash": str(number), "who": "gwrms", "what": what, "utc_ns": number, **more}


RESET = written(6, "reset", held=False)


def test_a_confirmed_stop_that_was_reset_while_there_was_no_link_is_not_shown_any_more(bench: Bench) -> None:
    """Header and table said that it is confirmed while the robot walked."""
    stopping = bench.station.stopping
    bench.station.stop("test")
    bench.first.answer(ALL)
    stopping.read([written(5, "stop")])
    stopping.described(held=False, reason=None)
    assert (stopping.stage, stopping.was_ended) == ((StopState.IDLE, False), True)
    bench.station.stop("test")
    bench.first.answer(ALL)
    stopping.described(held=False, reason=None)  # it may be older than this stop
    assert stopping.state is StopState.CONFIRMED
    stopping.read([RESET, written(7, "stopped again", drive="left_knee"), written(8, "stop")])
    assert stopping.stage == (StopState.CONFIRMED, True)
    stopping.read([written(9, "reset", held=False)])
    assert stopping.stage == (StopState.IDLE, False)


def test_a_reset_before_a_stop_does_not_end_it(bench: Bench) -> None:
    stopping = bench.station.stopping
    stopping.read([written(4, "stop")])
    bench.station.stop("test")
    bench.first.answer(ALL)
    stopping.read([RESET])
    assert stopping.stage == (StopState.CONFIRMED, True)
    stopping.read([RESET, written(7, "stopped again")])
    stopping.read([written(8, "reset", held=False)])
    assert stopping.stage == (StopState.IDLE, False)


def test_of_a_reset_before_the_window_came_nobody_knows_what_was_enabled_since(bench: Bench) -> None:
    stopping = bench.station.stopping
    stopping.read([written(5, "stop"), RESET])
    assert (stopping.stage, stopping.was_ended) == ((StopState.IDLE, False), False)
    stopping.read([written(7, "stop"), written(8, "reset", held=False, utc_ns=9_000_000_000)])
    assert (stopping.was_ended, stopping.since_s) == (True, 9.0)


def test_a_stop_in_a_journal_that_begins_anew_is_read(bench: Bench) -> None:
    bench.station.stopping.read([written(500, "stop"), written(501, "reset", held=False)])
    bench.station.stopping.read([written(1, "begun"), written(2, "stop", reason="door")])
    assert bench.station.stopping.held
