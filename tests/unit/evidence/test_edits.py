"""Edits as a journal tells them, and which stretches of a walk are before and after them."""

from pathlib import Path
from typing import Any

import pytest

from server_gui.core.evidence.edits import (
    AFTER_NS,
    BACK_NS,
    BEFORE_NS,
    SETTLE_NS,
    EditState,
    JournalEdits,
    ParameterChange,
    due_ns,
    spell,
)
from tests.support.journals import RobotsJournal
from tests.unit.evidence.walks import entry

SECOND = 1_000_000_000
NAME = "left_knee.max_torque"


def journal(*told: tuple[int, str, int]) -> JournalEdits:
    """Return what entries of (second, what, write) make."""
    edits = JournalEdits("exo-01")
    edits.take(_entries(*told))
    return edits


def _entries(*told: tuple[int, str, int]) -> list[dict[str, Any]]:
    return [
        entry(n, at_s * SECOND, what, write, {NAME: 60.0}, {NAME: 80.0}, 20.0 if "trial" in what else None)
        for n, (at_s, what, write) in enumerate(told, 1)
    ]


def test_an_edit_has_who_what_and_when() -> None:
    (edit,) = journal((200, "write", 7), (201, "write done", 7)).all
    assert edit.changes == (ParameterChange(NAME, 80.0, 60.0),)
    assert (edit.who, edit.state, edit.robot, edit.write) == ("anna", EditState.KEPT, "exo-01", 7)
    assert (edit.began_ns, edit.in_force_ns, edit.ended_ns) == (200 * SECOND, 201 * SECOND, None)
    assert edit.utc == "1970-01-01T00:03:20Z"
    assert edit.id == _entries((200, "write", 7))[0]["hash"][:10]


def test_a_trial_is_kept_or_goes_back() -> None:
    on = journal((200, "write", 1), (201, "trial begun", 1))
    assert on.all[0].state is EditState.ON_TRIAL
    assert due_ns(on.all[0]) is None
    kept = journal((200, "write", 1), (201, "trial begun", 1), (220, "trial confirmed", 1)).all[0]
    assert kept.state is EditState.KEPT
    assert kept.in_force_ns == 201 * SECOND
    assert due_ns(kept) == 201 * SECOND + AFTER_NS
    back = journal((200, "write", 1), (201, "trial begun", 1), (220, "taken back", 1)).all[0]
    assert (back.state, back.ended_ns) == (EditState.REVERTED, 220 * SECOND)
    assert due_ns(back) == 220 * SECOND + BACK_NS


def test_what_was_refused_or_failed_is_no_edit_in_force() -> None:
    assert journal((200, "write refused", 1)).all == []
    failed = journal((200, "write", 1), (201, "write taken back", 1)).all[0]
    assert failed.state is EditState.FAILED
    assert spell(failed, [failed])[0].after == ()


def test_a_trial_that_could_not_be_taken_back_yet_goes_on() -> None:
    told = ((200, "write", 1), (201, "trial begun", 1), (220, "NOT TAKEN BACK yet", 1))
    assert journal(*told).all[0].state is EditState.ON_TRIAL


def test_what_follows_the_write_at_once_is_on_neither_side() -> None:
    edits = journal((200, "write", 1), (201, "write done", 1)).all
    windows, notes = spell(edits[0], edits)
    assert windows.before == [(200 * SECOND - BEFORE_NS, 200 * SECOND)]
    assert windows.after == [(201 * SECOND + SETTLE_NS, 201 * SECOND + AFTER_NS)]
    assert notes == ()


def test_a_walk_with_the_old_values_again_counts_as_before() -> None:
    edits = journal((200, "write", 1), (201, "trial begun", 1), (231, "taken back", 1)).all
    windows, _ = spell(edits[0], edits)
    assert windows.after == [(202 * SECOND, 231 * SECOND)]
    assert windows.before[1] == (232 * SECOND, 231 * SECOND + BACK_NS)


def test_two_edits_that_overlap_say_so_and_share_nothing() -> None:
    edits = journal(
        (200, "write", 1),
        (201, "trial begun", 1),
        (220, "write", 2),
        (221, "write done", 2),
        (231, "taken back", 1),
    ).all
    first, notes = spell(edits[0], edits)
    assert first.after == [(202 * SECOND, 221 * SECOND)]
    assert len(first.before) == 1  # what came back is not what was before
    assert notes == (
        f"the edit of {NAME} at {edits[1].utc} ({edits[1].id}) leaves fewer cycles after this one",
    )
    second, notes = spell(edits[1], edits)
    assert second.before == [(202 * SECOND, 220 * SECOND)]
    assert second.after == [(222 * SECOND, 231 * SECOND)]
    assert "before this one" in notes[0]


def test_a_trial_that_takes_over_another_is_judged_against_what_it_found() -> None:
    """What comes back at its end is of before the first one, and not what it is compared with."""
    edits = journal(
        (200, "write", 1),
        (201, "trial begun", 1),
        (220, "write", 2),
        (221, "trial begun", 2),
        (250, "taken back", 2),
    ).all
    first, _ = spell(edits[0], edits)
    second, _ = spell(edits[1], edits)
    assert (edits[0].state, edits[1].state) == (EditState.TAKEN_OVER, EditState.REVERTED)
    assert first.after == [(202 * SECOND, 221 * SECOND)]
    assert second.before == [(202 * SECOND, 220 * SECOND)]
    assert second.after == [(222 * SECOND, 250 * SECOND)]


def test_what_did_not_come_back_is_said_and_no_stretch_of_before() -> None:
    """Somebody else has changed it meanwhile, or a stop has set it: the robot left it alone."""
    for what, said in (
        ("taken back", "left alone: it holds 01, neither of both"),
        ("claimed by the stop", "left as the stop set it"),
    ):
        edits = JournalEdits("exo-01")
        told = _entries((200, "write", 1), (201, "trial begun", 1), (231, what, 1), (240, "taken back", 1))
        told[2]["outcome"], told[3]["outcome"] = {NAME: said}, {"left_hip.max_torque": "taken back"}
        edits.take(told)
        (edit,) = edits.all
        assert (edit.ended_ns, edit.became) == (231 * SECOND, "taken back, NOT all of it")
        assert edit.not_back == (f"{NAME}: {said}",)
        assert len(spell(edit, edits.all)[0].before) == 1
    edits = JournalEdits("exo-01")
    told = _entries((200, "write", 1), (201, "trial begun", 1), (231, "taken back", 1))
    told[2]["outcome"] = {NAME: "unchanged"}
    edits.take(told)
    assert (edits.all[0].became, len(spell(edits.all[0], edits.all)[0].before)) == ("taken back", 2)


def test_a_replayed_tail_changes_nothing() -> None:
    """The same write number of another journal's entry is another edit."""
    told = ((200, "write", 1), (201, "write done", 1), (300, "write", 1), (301, "write done", 1))
    assert [edit.in_force_ns for edit in journal(*told).all] == [201 * SECOND, 301 * SECOND]


def test_edits_that_are_over_are_forgotten_and_no_trial_is() -> None:
    edits = journal((100, "write", 1), (101, "write done", 1), (200, "write", 2), (201, "trial begun", 2))
    edits.forget(900 * SECOND)
    assert [edit.write for edit in edits.all] == [2]


def test_the_robots_own_journal_is_understood(tmp_path: Path) -> None:
    journal = RobotsJournal(tmp_path)
    kept = journal.written({NAME: 80.0}, {NAME: 60.0})
    trial = journal.written({NAME: 60.0}, {NAME: 50.0}, "trial begun")
    journal.say("taken back", write=trial, outcome={NAME: "taken back"}, reason="its time is over")
    edits = JournalEdits("exo-01")
    edits.take(journal.told().journal.entries)
    journal.close()
    assert [(edit.write, edit.state, edit.trial_s) for edit in edits.all] == [
        (kept, EditState.KEPT, None),
        (trial, EditState.REVERTED, 20.0),
    ]
    assert [edit.boot_id for edit in edits.all] == ["boot-1", "boot-1"]
    assert edits.all[1].ended_ns is not None
    assert edits.all[1].in_force_ns is not None
    assert edits.all[0].began_ns < edits.all[1].began_ns < edits.all[1].in_force_ns < edits.all[1].ended_ns


def test_the_whole_journal_again_makes_no_edit_twice() -> None:
    edits = JournalEdits("exo-01")
    told = _entries((200, "write", 1), (201, "trial begun", 1), (220, "taken back", 1))
    edits.take(told)
    once = list(edits.all)
    edits.take(told)
    assert edits.all == once


@pytest.mark.parametrize(
    "nonsense",
    [{"monotonic_ns": "soon"}, {"monotonic_ns": None}, {"write": [1]}, {"after": {NAME: 10**400}}],
)
def test_an_entry_that_is_nonsense_costs_no_other(nonsense: dict[str, Any]) -> None:
    edits = JournalEdits("exo-01")
    good = _entries((200, "write", 1), (201, "write done", 1))
    edits.take([entry(9, 1, "write", 9, {NAME: 1.0}) | nonsense, *good])
    assert [(edit.write, edit.state) for edit in edits.all] == [(1, EditState.KEPT)]


def test_a_value_that_is_no_number_and_a_time_of_no_calendar_can_be_shown() -> None:
    edits = JournalEdits("exo-01")
    edits.take([entry(1, 1, "write", 1, {NAME: float("nan"), "a.b": 2.0}) | {"utc_ns": 10**30}])
    (edit,) = edits.all
    assert [change.name for change in edit.changes] == ["a.b"]
    assert edit.utc == "–"


def test_edits_of_which_nothing_was_heard_are_forgotten() -> None:
    edits = journal((100, "write", 1), (200, "write", 2), (201, "trial begun", 2))
    edits.forget(900 * SECOND)
    assert [edit.write for edit in edits.all] == [2]
