"""The journal at the desk: what people did, and whether it can be believed."""

from pathlib import Path

from server_gui.core.audit.acts import OPEN, Act, acts
from server_gui.core.audit.journal import KEPT, Audit
from server_gui.core.follow.events import Journalled
from tests.support.journals import RobotsJournal

STEP = "gait.step_length"


def done(audit: Audit) -> list[tuple[str, str, str]]:
    return [(act.what, act.thing, act.outcome) for act in acts(audit.entries)]


# What people did


def test_a_write_is_told_with_old_new_and_what_was_read_back(journal: RobotsJournal) -> None:
    audit = Audit()
    journal.written({STEP: 0.4, "gait.trunk_angle": 0.05}, {STEP: 0.43, "gait.trunk_angle": 0.06})
    audit.take(journal.told().journal.entries)
    first, second = acts(audit.entries)
    assert first == Act(
        1,
        first.hash,
        first.utc_ns,
        "ada at 10.0.0.3",
        "write",
        STEP,
        "written and read back",
        0.4,
        0.43,
        0.43,
    )
    assert (second.thing, second.old, second.new, second.read_back) == ("gait.trunk_angle", 0.05, 0.06, 0.06)


def test_every_way_that_a_write_can_end_is_told(journal: RobotsJournal) -> None:
    audit = Audit()
    kept = journal.written({STEP: 0.4}, {STEP: 0.43}, "trial begun")
    journal.say("trial confirmed", write=kept)
    reverted = journal.written({STEP: 0.43}, {STEP: 0.5}, "trial begun")
    journal.say(
        "taken back", "gateway", write=reverted, reason="its time is over", outcome={STEP: "taken back"}
    )
    journal.written(
        {STEP: 0.43}, {STEP: 0.5}, "write taken back", result="no", outcome={STEP: "it holds 0.429"}
    )
    claimed = journal.written({STEP: 0.43}, {STEP: 0.5}, "trial begun")
    outcome = {STEP: "left as the stop set it"}
    journal.say("claimed by the stop", "gateway", write=claimed, outcome=outcome)
    journal.say("write refused", after={STEP: 9.0}, result="above the maximum 0.6 m")
    journal.say("write", write=99, before={STEP: 0.43}, after={STEP: 0.45}, trial_s=None)
    audit.take(journal.told().journal.entries)
    assert done(audit) == [
        ("trial of 20 s", STEP, "kept after its trial"),
        ("trial of 20 s", STEP, "taken back"),
        ("write", STEP, "write taken back: it holds 0.429"),
        ("trial of 20 s", STEP, "claimed by the stop: left as the stop set it"),
        ("write", STEP, "refused: above the maximum 0.6 m"),
        ("write", STEP, OPEN),
    ]
    assert [act.read_back for act in acts(audit.entries)] == [0.43, 0.5, None, 0.5, None, None]


def test_stores_and_stops_are_told_too(journal: RobotsJournal) -> None:
    audit = Audit()
    journal.say("store", component="left_knee")
    journal.say("store done", component="left_knee", result="stored")
    journal.say("store refused", component="left_knee", result="it cannot")
    journal.say("stop", reason="STOP key")
    journal.say("stop answered", result={"left_hip": "confirmed", "left_knee": "unconfirmed"})
    audit.take(journal.told().journal.entries)
    assert done(audit) == [
        ("store", "left_knee", "store done: stored"),
        ("store", "left_knee", "refused: it cannot"),
        ("stop", "", "STOP key"),
        ("stop answered", "", "left_hip: confirmed, left_knee: unconfirmed"),
    ]


def test_the_right_to_write_is_called_control_as_in_the_rest_of_the_window(journal: RobotsJournal) -> None:
    audit = Audit()
    journal.say("lease taken")
    journal.say("lease taken over by somebody")
    journal.say("write refused", after={STEP: 0.5}, result="somebody has the lease for up to 9.0 s more")
    audit.take(journal.told().journal.entries)
    assert done(audit) == [
        ("control taken", "", ""),
        ("control taken over by somebody", "", ""),
        ("write", STEP, "refused: somebody has control for up to 9.0 s more"),
    ]


# Whether it can be believed


def test_entries_that_come_again_and_again_are_there_once_and_the_chain_holds(journal: RobotsJournal) -> None:
    audit = Audit()
    for number in range(30):
        journal.say("lease taken", ratio=number / 7, nothing=None, deep={"ä": [1, 2.0]})
        audit.take(journal.told(20).journal.entries)
    assert [entry["n"] for entry in audit.entries] == list(range(1, 31))
    assert audit.verdict == "Entries 1 to 30 are unaltered and in their places: the chain of hashes holds."


def altered(told: Journalled, place: int, **changes: object) -> list[dict[str, object]]:
    entries = [dict(entry) for entry in told.journal.entries]
    entries[place] |= changes
    return entries


def test_an_entry_that_was_altered_or_taken_out_is_seen(journal: RobotsJournal) -> None:
    for number in range(5):
        journal.say("stop", reason=str(number))
    for place, changes, said in (
        (2, {"who": "nobody"}, "line 3 was altered"),
        (2, {"hash": "0" * 64}, "line 3 was altered"),
    ):
        audit = Audit()
        audit.take(altered(journal.told(), place, **changes))
        assert said in audit.verdict
        assert "NOT INTACT" in audit.verdict
    audit = Audit()
    without = altered(journal.told(), 0)
    del without[2]
    audit.take(without)
    assert "line 4 does not follow the line before it" in audit.verdict


def test_what_came_too_fast_is_counted_and_not_called_a_broken_chain(journal: RobotsJournal) -> None:
    audit = Audit()
    for count in (3, 30):
        for number in range(count):
            journal.say("stop", reason=str(number))
        audit.take(journal.told(20).journal.entries)
    assert "10 between them came too fast" in audit.verdict
    assert [entry["n"] for entry in audit.unbroken()] == list(range(14, 34))


def test_a_journal_that_begins_anew_is_said_to(journal: RobotsJournal, tmp_path: Path) -> None:
    audit = Audit()
    for _ in range(3):
        journal.say("stop")
    audit.take(journal.told().journal.entries)
    (tmp_path / "other").mkdir()
    other = RobotsJournal(tmp_path / "other")
    other.say("stop")
    audit.take(other.told().journal.entries)
    other.close()
    assert "begun anew on the robot after entry 3" in audit.verdict
    assert len(audit.entries) == 1


def test_memory_is_bounded(journal: RobotsJournal) -> None:
    journal.say("stop")
    entry, audit = journal.told().journal.entries[0], Audit()
    audit.take([entry | {"n": number} for number in range(1, KEPT + 100)])
    assert len(audit.entries) == KEPT
