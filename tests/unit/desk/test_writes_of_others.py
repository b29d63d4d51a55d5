"""What others write to a robot is told in the window, once, and what it has written itself is not."""

from typing import Any

import pytest

from server_gui.core.desk.writes_of_others import WritesOfOthers
from server_gui.core.follow.robot import Robot


def entry(number: int, what: str, write: int, **more: object) -> dict[str, Any]:
    return {"n": number, "what": what, "write": write, "who": "gwrms set", "utc_ns": number, **more}


HISTORY = [entry(1, "write", 1), entry(2, "write done", 1)]
BEGUN = entry(3, "write", 2, before={"left_knee.max_torque": 80.0}, after={"left_knee.max_torque": 40.0})
SAID = "write left_knee.max_torque 80 → 40 by gwrms set"


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def others(told: list[str]) -> WritesOfOthers:
    made = WritesOfOthers(Robot(), lambda _kind, text: told.append(text))
    made.take(HISTORY)
    return made


def test_what_was_written_before_the_first_look_is_no_news(others: WritesOfOthers, told: list[str]) -> None:
    others.take(HISTORY)
    assert told == []


def test_a_write_of_another_is_told_once_it_is_done_and_never_again(
    others: WritesOfOthers, told: list[str]
) -> None:
    others.take([*HISTORY, BEGUN])
    assert told == []
    for _ in range(2):
        others.take([*HISTORY, BEGUN, entry(4, "write done", 2)])
    assert told == [SAID]


def test_one_on_trial_is_said_to_be(others: WritesOfOthers, told: list[str]) -> None:
    others.take([*HISTORY, BEGUN | {"trial_s": 30.0}, entry(4, "trial begun", 2)])
    assert told == [f"{SAID}, on trial"]


def test_one_that_was_refused_and_an_own_one_are_not_told(others: WritesOfOthers, told: list[str]) -> None:
    others.own(2)
    later = [BEGUN, entry(4, "write done", 2), entry(5, "write", 3), entry(6, "write taken back", 3)]
    others.take([*HISTORY, *later])
    assert told == []


def test_the_history_of_another_journal_is_no_news(others: WritesOfOthers, told: list[str]) -> None:
    others.take([*HISTORY, BEGUN])
    others.take(HISTORY)
    assert told == []
    others.take([*HISTORY, BEGUN, entry(4, "write done", 2)])
    assert told == [SAID]
