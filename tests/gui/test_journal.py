"""The journal at the desk: what people did, whether it can be believed, and what it shows to be stored."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.client import ConnectionState
from gateway.wire.messages import QualityInfo, Snapshot
from server_gui.core.audit.acts import OPEN, Act, acts
from server_gui.core.audit.journal import KEPT, Audit
from server_gui.core.follow.events import Journalled, LinkChanged, Looked
from tests.gui.fakes import HELD, Bench, described, looked, telemetry
from tests.gui.journals import RobotsJournal

STEP = "gait.step_length"


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[RobotsJournal]:
    made = RobotsJournal(tmp_path)
    yield made
    made.close()


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
        ("trial of 20 s", STEP, "taken back: taken back"),
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
    journal.say("stop", reason="STOP key")
    journal.say("stop answered", result={"left_hip": "confirmed", "left_knee": "unconfirmed"})
    audit.take(journal.told().journal.entries)
    assert done(audit) == [
        ("store", "left_knee", "store done: stored"),
        ("stop", "", "STOP key"),
        ("stop answered", "", "left_hip: confirmed, left_knee: unconfirmed"),
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


# What is stored


def seen(boots: int = 0, **more: object) -> Looked:
    """A look at the gait controller and the left knee."""
    life: QualityInfo = {"state": "ok", "boots": boots, "bus_opened": 1, "bus_dropped": 0}
    life |= {name: value for name, value in more.items() if isinstance(value, str | int)}
    return Looked(
        Snapshot(0, {}, {}, {"gait": life, "left_knee": life}), looked().parameters, time.monotonic_ns()
    )


def store(journal: RobotsJournal, component: str = "gait") -> None:
    journal.say("store", component=component)
    journal.say("store done", component=component, result="stored")


@pytest.fixture
def watched(bench: Bench) -> Bench:
    """The robot's clock is known, and its devices have been seen."""
    bench.station.take([telemetry([time.monotonic_ns()], {"gait.x": [0.0]}), seen()])
    return bench


def test_a_value_that_was_stored_after_its_last_write_is_stored(
    watched: Bench, journal: RobotsJournal
) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    watched.station.take([journal.told()])
    assert not watched.station.is_stored(STEP)
    store(journal)
    watched.station.take([journal.told(), seen()])
    assert watched.station.is_stored(STEP)
    assert not watched.station.is_stored("gait.trunk_angle"), "nobody wrote it: what was stored is not known"
    assert not watched.station.is_stored("left_knee.max_torque")


@pytest.mark.parametrize(
    ("name", "then"),
    [
        ("another write", lambda journal: journal.written({STEP: 0.4}, {STEP: 0.41})),
        ("a write of the same value", lambda journal: journal.written({STEP: 0.41}, {STEP: 0.4})),
        ("a trial", lambda journal: journal.written({STEP: 0.4}, {STEP: 0.41}, "trial begun")),
        (
            "a write without an end",
            lambda journal: journal.say("write", write=9, before={}, after={STEP: 0.4}),
        ),
        ("a store that failed", lambda journal: journal.say("store FAILED", component="gait", result="?")),
        ("defaults", lambda journal: journal.say("restore done", component="gait", result="at reset")),
    ],
)
def test_what_came_after_a_store_makes_it_unknown(
    watched: Bench, journal: RobotsJournal, name: str, then: object
) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    store(journal)
    watched.station.take([journal.told()])
    assert watched.station.is_stored(STEP)
    assert callable(then)
    then(journal)
    watched.station.take([journal.told()])
    assert not watched.station.is_stored(STEP), name


@pytest.mark.parametrize("more", [{"boots": 1}, {"bus_opened": 2}, {"state": "lost"}])
def test_a_boot_up_or_what_may_have_hidden_one_makes_it_unknown(
    watched: Bench, journal: RobotsJournal, more: dict[str, int]
) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    store(journal)
    watched.station.take([journal.told(), seen(**more), seen()])
    assert not watched.station.is_stored(STEP)


def test_a_store_from_before_this_link_is_not_believed(watched: Bench, journal: RobotsJournal) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    store(journal)
    watched.station.take([journal.told()])
    assert watched.station.is_stored(STEP)
    for state in (ConnectionState.WAITING, ConnectionState.CONNECTED):
        watched.station.take([LinkChanged(state, None, time.monotonic_ns())])
    watched.station.take([described(), seen()])
    assert not watched.station.is_stored(STEP)


def test_another_value_than_was_stored_is_not_called_stored(watched: Bench, journal: RobotsJournal) -> None:
    journal.written({STEP: 0.3}, {STEP: 0.35})  # and then somebody else has changed it, past the gateway
    store(journal)
    watched.station.take([journal.told()])
    assert not watched.station.is_stored(STEP)
