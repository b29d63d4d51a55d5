"""What one client may write in the journal: its flood is counted, and loses nothing of what others did."""

import os
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from gateway.records import journal as module
from gateway.records.journal import Journal, Share, TooMany, read_verified
from gateway.records.limits import (
    BYTES_A_SECOND,
    BYTES_AT_ONCE,
    CLIENTS,
    ENTRIES_A_SECOND,
    ENTRIES_AT_ONCE,
    FIELD_BYTES,
    LEFT_OUT,
    NAMES_OF_ONE_ADDRESS,
    WHO_BYTES,
    Limits,
    _LeftOut,
    client,
    within_limits,
)
from tests.support.waiting import WAIT_S

SECOND_NS = 10**9
ADA, BEN = "gwrms set (10.0.0.1:50001)", "window (10.0.0.1:50002)"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The journal's time, which stands still."""
    clock = SimpleNamespace(now_ns=SECOND_NS)
    fake = SimpleNamespace(monotonic_ns=lambda: clock.now_ns, time_ns=time.time_ns)
    monkeypatch.setattr(module, "time", fake)
    return clock


@pytest.fixture
def journal(path: Path, clock: SimpleNamespace) -> Iterator[Journal]:
    made = Journal(path, "boot")
    yield made
    made.close()


def flood(journal: Journal, share: Share = Share.ASKED, what: str = "lease taken") -> "list[Future[None]]":
    return [journal.append(ADA, what, share) for _ in range(ENTRIES_AT_ONCE + 50)]


def test_a_flood_is_counted_and_summed_up(journal: Journal, path: Path) -> None:
    written = flood(journal)
    assert [one.exception(WAIT_S) is None for one in written] == [True] * ENTRIES_AT_ONCE + [False] * 50
    journal.close()
    entries = read_verified(path)
    assert len(entries) == ENTRIES_AT_ONCE + 1
    assert (entries[-1]["who"], entries[-1]["what"]) == ("gateway", LEFT_OUT)
    assert entries[-1]["left_out"] == {"lease taken": 50}
    assert "50 more of gwrms set (10.0.0.1)'s were not written out" in entries[-1]["result"]


def test_a_flood_is_summed_up_when_it_goes_on_and_when_nothing_else_happens(
    journal: Journal, clock: SimpleNamespace
) -> None:
    flood(journal)
    journal.tail(1).result(WAIT_S)  # as long as the clock stands, nothing is due
    clock.now_ns += 6 * SECOND_NS
    journal.append(BEN, "lease taken", Share.ASKED).result(WAIT_S)
    entries, _ = journal.tail(3).result(WAIT_S)
    assert [entry["what"] for entry in entries[-2:]] == ["lease taken", LEFT_OUT]


def test_a_flood_that_nothing_follows_is_summed_up_by_itself(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.records.limits.SUM_UP_S", 0.05)
    summed, entry = threading.Event(), _LeftOut.entry

    def told(self: _LeftOut, whose: str) -> dict[str, Any]:
        summed.set()
        return entry(self, whose)

    monkeypatch.setattr(_LeftOut, "entry", told)
    journal = Journal(path, "boot")
    flood(journal)
    assert summed.wait(WAIT_S)
    journal.close()


def test_a_flood_takes_nothing_from_others_nor_from_its_own_stop(journal: Journal, path: Path) -> None:
    flood(journal)
    journal.append(BEN, "write", Share.ASKED).result(WAIT_S)
    journal.append(BEN, "stop", Share.ACT).result(WAIT_S)
    journal.append(ADA, "stop", Share.ACT).result(WAIT_S)
    journal.append("guard", "alarm").result(WAIT_S)
    journal.append("gateway", "taken back").result(WAIT_S)
    told = [(entry["who"], entry["what"]) for entry in read_verified(path)[ENTRIES_AT_ONCE:]]
    assert told == [
        (BEN, "write"),
        (BEN, "stop"),
        (ADA, "stop"),
        ("guard", "alarm"),
        ("gateway", "taken back"),
    ]


def test_a_flood_of_stops_is_counted_too_and_takes_no_write(journal: Journal, path: Path) -> None:
    flood(journal, Share.ACT, "stop")
    journal.append(ADA, "write", Share.ASKED).result(WAIT_S)
    journal.append(BEN, "stop", Share.ACT).result(WAIT_S)
    journal.close()
    assert [entry["what"] for entry in read_verified(path)[-3:]] == ["write", "stop", LEFT_OUT]


def test_what_may_not_be_done_without_its_entry_is_refused_with_when_to_try_again(journal: Journal) -> None:
    flood(journal)
    with pytest.raises(TooMany, match=r"gwrms set .* has written more .*; try again in 0\.\d s"):
        journal.append(ADA, "write", Share.ASKED).result(WAIT_S)
    assert journal.problem is None


def test_an_outcome_is_written_after_whatever_there_was(journal: Journal, path: Path) -> None:
    flood(journal)
    journal.append(ADA, "write done").result(WAIT_S)
    assert read_verified(path)[-1]["what"] == "write done"


def test_a_client_is_the_same_one_with_another_connection(journal: Journal) -> None:
    flood(journal)
    again = ADA.replace("50001", "50009")
    assert isinstance(journal.append(again, "lease taken", Share.ASKED).exception(WAIT_S), TooMany)
    assert client(again) == client(ADA) == "gwrms set (10.0.0.1)"
    assert client("10.0.0.1:50001") == "10.0.0.1"


def test_time_gives_room_again(clock: SimpleNamespace, journal: Journal) -> None:
    flood(journal)
    clock.now_ns += SECOND_NS
    written = [journal.append(ADA, "lease taken", Share.ASKED) for _ in range(ENTRIES_A_SECOND + 1)]
    assert [one.exception(WAIT_S) is None for one in written] == [True] * ENTRIES_A_SECOND + [False]


def test_bytes_are_limited_as_entries_are() -> None:
    limits = Limits()
    size = BYTES_AT_ONCE // 4
    asked = [limits.refusal(ADA, "write", Share.ASKED, size, SECOND_NS) for _ in range(5)]
    assert [refusal is None for refusal in asked] == [True] * 4 + [False]
    later_ns = SECOND_NS + round(size / BYTES_A_SECOND * 1e9)
    assert limits.refusal(ADA, "write", Share.ASKED, size, later_ns) is None


def test_outcomes_count_so_that_what_follows_waits() -> None:
    limits = Limits()
    for _ in range(2 * ENTRIES_AT_ONCE):
        assert limits.refusal(ADA, "write done", Share.OUTCOME, 100, SECOND_NS) is None
    assert limits.refusal(ADA, "write", Share.ASKED, 100, SECOND_NS) is not None


def test_strangers_without_end_share_one_account_and_lose_no_stop() -> None:
    limits = Limits()
    for number in range(CLIENTS):
        for _ in range(2):
            assert (
                limits.refusal(f"{number} (1.2.{number // 9}.4:5)", "lease", Share.ASKED, 100, SECOND_NS)
                is None
            )
    refused = [
        limits.refusal(f"more {number} (5.{number // 9}.3.4:5)", "lease", Share.ASKED, 100, SECOND_NS)
        for number in range(ENTRIES_AT_ONCE + 10)
    ]
    assert sum(refusal is not None for refusal in refused) == 10
    for number in range(2 * ENTRIES_AT_ONCE):
        who = f"more {number} (5.{number // 9}.3.4:5)"
        assert limits.refusal(who, "stop", Share.ACT, 100, SECOND_NS) is None
    (summary,) = limits.summaries(None)
    assert summary["left_out"] == {"lease": 10}


def test_one_that_calls_itself_ever_something_else_has_little_more_and_leaves_the_others_theirs() -> None:
    limits = Limits()
    written = sum(
        limits.refusal(f"{number % 600} (1.2.3.4:5)", "lease", Share.ASKED, 100, SECOND_NS) is None
        for number in range(20_000)
    )
    assert written <= (2 * NAMES_OF_ONE_ADDRESS + 1) * ENTRIES_AT_ONCE
    assert limits.refusal("ada (9.9.9.9:5)", "write", Share.ASKED, 100, SECOND_NS) is None


def test_who_has_written_nothing_for_a_while_is_forgotten() -> None:
    limits = Limits()
    for number in range(10 * CLIENTS):
        now_ns = number * SECOND_NS
        assert limits.refusal(f"{number} (1.2.3.4:5)", "lease", Share.ASKED, 100, now_ns) is None
    assert len(limits._accounts) <= CLIENTS + 1


# What waits becomes durable together


def test_a_queue_of_entries_delays_the_next_by_no_more_than_two_syncs(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(path, "boot")
    journal.append(ADA, "first").result(WAIT_S)
    go_on, syncs, fsync = threading.Event(), [0], os.fsync

    def counted(descriptor: int) -> None:
        syncs[0] += 1
        go_on.wait(WAIT_S)
        fsync(descriptor)

    monkeypatch.setattr("gateway.records.journal.os.fsync", counted)
    for _ in range(200):
        journal.append(ADA, "lease taken", Share.ASKED)
    stop = journal.append(BEN, "stop", Share.ACT)
    go_on.set()
    stop.result(WAIT_S)
    monkeypatch.undo()
    journal.close()
    assert syncs[0] <= 2 * 3  # each batch syncs its lines, its head and the head's folder
    assert [entry["n"] for entry in read_verified(path)] == list(range(1, 203))


def test_an_entry_that_cannot_be_encoded_fails_alone(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal(path, "boot")
    taken, held = module.Journal._take, threading.Event()

    def together(self: Journal) -> list[Any]:
        held.wait(WAIT_S)
        return taken(self)

    monkeypatch.setattr(module.Journal, "_take", together)
    journal.append(ADA, "first").result(WAIT_S)
    written = [journal.append(ADA, "note", result=one) for one in ("good", object(), "good")]
    held.set()
    assert [one.exception(WAIT_S) is None for one in written] == [True, False, True]
    journal.close()
    assert [entry["what"] for entry in read_verified(path)] == ["first", "note", "note"]


def test_what_comes_after_the_end_fails_and_waits_for_nothing(path: Path) -> None:
    journal = Journal(path, "boot")
    journal.close()
    with pytest.raises(OSError, match="the gateway is ending"):
        journal.append(ADA, "late").result(WAIT_S)
    with pytest.raises(OSError, match="the gateway is ending"):
        journal.tail(1).result(WAIT_S)


# The size of one entry


def test_an_entry_of_ordinary_size_is_written_as_it_is() -> None:
    fields = {"who": ADA, "what": "write", "after": {f"joint.parameter_{n}": 1.5 for n in range(400)}}
    assert within_limits(fields)[0] is fields


@pytest.mark.parametrize(
    "value",
    [
        "x" * 100_000,
        "é" * 50_000,
        "\x00" * 30_000,
        {f"parameter {number}": float(number) for number in range(5000)},
        [f"joint {number}" for number in range(5000)],
    ],
    ids=["text", "letters-of-two-bytes", "escapes", "mapping", "list"],
)
def test_a_field_that_is_too_long_is_cut_and_says_so(journal: Journal, path: Path, value: Any) -> None:
    journal.append(ADA, "stop", Share.ACT, reason=value, result="done").result(WAIT_S)
    (entry,) = read_verified(path)
    kept = entry["reason"]
    assert type(kept) is type(value)
    assert kept == (dict(list(value.items())[: len(kept)]) if isinstance(kept, dict) else value[: len(kept)])
    assert 0.5 * FIELD_BYTES < len(msgspec.json.encode(kept)) <= FIELD_BYTES
    assert f"{len(value) - len(kept)} of {len(value)}" in entry["cut"]["reason"]
    assert entry["result"] == "done"


def test_a_long_name_is_cut(journal: Journal, path: Path) -> None:
    journal.append("n" * 60_000 + " (1.2.3.4:5)", "stop", Share.ACT).result(WAIT_S)
    (entry,) = read_verified(path)
    assert len(entry["who"]) <= WHO_BYTES
    assert "who" in entry["cut"]
