"""What others write to a robot is told in the window, once, and what it has written itself is not."""

from collections.abc import Mapping
from typing import Any

from server_gui.core.audit.writes_of_others import WritesOfOthers


def entry(number: int, what: str, write: int, **more: object) -> Mapping[str, Any]:
    return {"n": number, "what": what, "write": write, "who": "gwrms set", **more}


HISTORY = [entry(1, "write", 1), entry(2, "write done", 1)]


def test_what_was_written_before_the_first_look_is_no_news() -> None:
    others = WritesOfOthers()
    assert list(others.take(HISTORY)) == []
    assert list(others.take(HISTORY)) == []


def test_a_write_of_another_is_told_once_it_is_done_and_never_again() -> None:
    others = WritesOfOthers()
    list(others.take(HISTORY))
    begun = entry(3, "write", 2, after={"left_knee.max_torque": 40.0})
    assert list(others.take([*HISTORY, begun])) == []
    told = [*HISTORY, begun, entry(4, "trial begun", 2)]
    assert list(others.take(told)) == [begun]
    assert list(others.take(told)) == []


def test_one_that_was_refused_and_an_own_one_are_not_told() -> None:
    others = WritesOfOthers()
    list(others.take(HISTORY))
    others.own(2)
    told = [entry(3, "write", 2), entry(4, "write done", 2), entry(5, "write", 3)]
    assert list(others.take([*HISTORY, *told, entry(6, "write taken back", 3)])) == []


def test_the_history_of_another_journal_is_no_news() -> None:
    others = WritesOfOthers()
    list(others.take([*HISTORY, entry(3, "write", 2)]))
    assert list(others.take(HISTORY)) == []
    begun = entry(3, "write", 2)
    assert list(others.take([*HISTORY, begun, entry(4, "write done", 2)])) == [begun]
