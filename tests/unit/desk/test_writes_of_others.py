"""What others write to a robot is told in the window, once, and what it has written itself is not."""

import time
from typing import Any
from unittest.mock import create_autospec

import pytest

from gateway.wire.control import JournalEntries
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.writes_of_others import ANSWERED_NS, WritesOfOthers
from server_gui.core.experiments.run import Run
from server_gui.core.follow.events import Journalled
from server_gui.core.follow.robot import Robot
from tests.support.desk import Bench, described


def read(others: WritesOfOthers, *entries: dict[str, Any]) -> None:
    """Let it read the journal, and wait for an answer to a write of its own."""
    others.take(entries, 0)
    others.look(ANSWERED_NS)


def entry(number: int, what: str, write: int, **more: object) -> dict[str, Any]:
    of_all = {"n": number, "what": what, "write": write, "who": "gwrms set"}
    return {**of_all, "hash": f"{number}", "utc_ns": time.time_ns(), **more}


HISTORY = [entry(1, "write", 1), entry(2, "write done", 1)]
BEGUN = entry(3, "write", 2, before={"left_knee.max_torque": 80.0}, after={"left_knee.max_torque": 40.0})
SAID = "write left_knee.max_torque 80 → 40 by gwrms set"


@pytest.fixture(autouse=True)
def slow_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    """What these tests write is not late for half an hour."""
    monkeypatch.setattr("server_gui.core.desk.writes_of_others.LATE_S", 1800.0)


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def others(told: list[str]) -> WritesOfOthers:
    made = WritesOfOthers(Robot(), lambda _kind, text: told.append(text))
    read(made, *HISTORY)
    return made


def test_what_was_written_before_the_first_look_is_no_news(others: WritesOfOthers, told: list[str]) -> None:
    read(others, *HISTORY)
    assert told == []


def test_a_write_of_another_is_told_once_it_is_done_and_never_again(
    others: WritesOfOthers, told: list[str]
) -> None:
    read(others, *HISTORY, BEGUN)
    assert told == []
    for _ in range(2):
        read(others, *HISTORY, BEGUN, entry(4, "write done", 2))
    assert told == [SAID]


def test_one_on_trial_is_said_to_be(others: WritesOfOthers, told: list[str]) -> None:
    read(others, *HISTORY, BEGUN | {"trial_s": 30.0}, entry(4, "trial begun", 2))
    assert told == [f"{SAID}, on trial"]


def test_one_that_was_refused_and_an_own_one_are_not_told(others: WritesOfOthers, told: list[str]) -> None:
    others.own(2)
    later = [BEGUN, entry(4, "write done", 2), entry(5, "write", 3), entry(6, "write taken back", 3)]
    read(others, *HISTORY, *later)
    assert told == []


def test_one_that_is_answered_after_it_stood_in_the_journal_is_an_own_one(
    others: WritesOfOthers, told: list[str]
) -> None:
    others.take([*HISTORY, BEGUN, entry(4, "write done", 2)], 0)
    others.look(ANSWERED_NS - 1)
    others.own(2)
    others.look(ANSWERED_NS)
    assert told == []


def test_the_history_of_another_journal_is_no_news(others: WritesOfOthers, told: list[str]) -> None:
    read(others, *HISTORY, BEGUN)
    read(others, *HISTORY)
    assert told == []
    read(others, *HISTORY, BEGUN, entry(4, "write done", 2))
    assert told == [SAID]


def test_a_longer_journal_of_another_robot_is_its_history(others: WritesOfOthers, told: list[str]) -> None:
    theirs = [entry(n, what, n // 2, hash=f"b{n}") for n, what in ((1, "x"), (4, "write"), (5, "write done"))]
    read(others, *theirs)
    assert told == []


def test_an_own_write_and_one_that_waits_outlast_another_journal(
    others: WritesOfOthers, told: list[str]
) -> None:
    others.own(7)
    others.take([*HISTORY, BEGUN, entry(4, "write done", 2)], 0)
    read(others, entry(1, "write", 7, hash="b"))
    read(others, entry(1, "write", 7, hash="b"), entry(2, "write done", 7, hash="b"))
    assert told == [SAID]


def test_one_that_is_read_late_says_how_long_ago_it_was(others: WritesOfOthers, told: list[str]) -> None:
    read(others, *HISTORY, BEGUN | {"utc_ns": time.time_ns() - 3600 * 10**9}, entry(4, "write done", 2))
    assert told == [f"{SAID}, 60 min ago"]


@pytest.mark.parametrize("is_own", [False, True])
def test_a_robots_events_have_what_others_write_and_not_what_an_experiment_of_this_window_does(
    monkeypatch: pytest.MonkeyPatch, is_own: bool
) -> None:
    monkeypatch.setattr("server_gui.core.desk.writes_of_others.ANSWERED_NS", 0)
    bench = Bench(Desk())
    bench.add("exo-01").take([described()])
    if is_own:
        bench.station.experiment = create_autospec(Run, instance=True, writes=[2])
    for entries in (HISTORY, [*HISTORY, BEGUN, entry(4, "write done", 2)]):
        bench.look_again([Journalled(JournalEntries(entries, None))])
    told = [item.text for item in bench.desk.news.items if item.text.startswith("write ")]
    assert told == ([] if is_own else ["write max torque (left knee) 80 → 40 N·m by gwrms set"])
