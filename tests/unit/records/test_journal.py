"""The journal: durable, hash-chained, and it finds one altered byte."""

import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.records.chain import Broken
from gateway.records.journal import Journal, head_file, read_verified
from tests.support.waiting import WAIT_S


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def journal(path: Path) -> Iterator[Journal]:
    made = Journal(path, "boot")
    yield made
    made.close()


def fill(path: Path, count: int = 5) -> None:
    journal = Journal(path, "boot")
    for number in range(count):
        journal.append("tester", "write", before={"a": number}, after={"a": number + 1}, result="done")
    journal.close()


def test_an_entry_says_who_when_what_before_after_and_result(journal: Journal, path: Path) -> None:
    journal.append("gwrms set", "write", before={"a.b": 1.0}, after={"a.b": 2.0}, result="done").result(
        WAIT_S
    )
    (entry,) = read_verified(path)
    assert (entry["n"], entry["who"], entry["what"], entry["result"]) == (1, "gwrms set", "write", "done")
    assert (entry["before"], entry["after"], entry["boot_id"]) == ({"a.b": 1.0}, {"a.b": 2.0}, "boot")
    assert entry["utc_ns"] > 1_700_000_000_000_000_000
    assert entry["monotonic_ns"] > 0


def test_entries_follow_each_other_over_restarts(path: Path) -> None:
    fill(path, 3)
    fill(path, 2)
    assert [entry["n"] for entry in read_verified(path)] == [1, 2, 3, 4, 5]


def test_the_tail_has_what_was_just_appended(journal: Journal) -> None:
    for number in range(200):
        journal.append("tester", "note", result="x" * number)
    entries, cut = journal.tail(150).result(WAIT_S)
    assert cut is None
    assert [entry["n"] for entry in entries] == list(range(51, 201))
    assert [entry["n"] for entry in journal.tail(1000).result(WAIT_S).entries] == list(range(1, 201))


def test_the_tail_of_an_empty_journal_is_empty(journal: Journal) -> None:
    assert journal.tail(10).result(WAIT_S) == ([], None)


def test_every_single_altered_byte_is_found(path: Path) -> None:
    fill(path, 2)
    whole = path.read_bytes()
    for index in range(len(whole)):
        for flip in (0x01, 0x80):
            damaged = bytearray(whole)
            damaged[index] ^= flip
            path.write_bytes(damaged)
            with pytest.raises(Broken):
                read_verified(path)
    path.write_bytes(whole)
    assert len(read_verified(path)) == 2


def test_removed_moved_and_doubled_lines_are_found(path: Path) -> None:
    fill(path)
    lines = path.read_bytes().splitlines(keepends=True)
    for changed in (lines[1:], lines[:-1], lines[:2] + lines[3:], lines[:1] * 2 + lines[1:], lines[::-1], []):
        path.write_bytes(b"".join(changed))
        with pytest.raises(Broken, match=r"line|missing"):
            read_verified(path)


def test_a_missing_journal_is_told_from_one_that_never_was(path: Path) -> None:
    fill(path)
    path.unlink()
    with pytest.raises(Broken, match="5 entries were written"):
        read_verified(path)
    head_file(path).unlink()
    with pytest.raises(FileNotFoundError):
        read_verified(path)


DAMAGED = [
    pytest.param(b"{}x", id="no-json"),
    pytest.param(b'{"n":1,"hash":"\xff"}', id="no-utf-8"),
    pytest.param(b'{"z":' + b"[" * 100_000, id="deep"),
]


@pytest.mark.parametrize("damaged", DAMAGED)
def test_a_damaged_head_is_found_and_the_journal_begins_anew(path: Path, damaged: bytes) -> None:
    fill(path)
    head_file(path).write_bytes(damaged)
    with pytest.raises(Broken, match="damaged"):
        read_verified(path)
    fill(path, 1)
    assert [entry["what"] for entry in read_verified(path)] == ["journal damaged", "write"]


@pytest.mark.parametrize("damaged", [*DAMAGED, pytest.param(b"[]", id="no-entry")])
def test_a_damaged_line_whose_hash_fits_is_found(path: Path, damaged: bytes) -> None:
    body = damaged[:-1]
    digest = hashlib.sha256(body).hexdigest().encode()
    path.write_bytes(body + b',"hash":"' + digest + b'"}\n')
    with pytest.raises(Broken, match="line 1 is no entry"):
        read_verified(path)
    fill(path, 1)
    assert [entry["what"] for entry in read_verified(path)] == ["journal damaged", "write"]


def test_a_damaged_line_in_the_tail_is_said(journal: Journal, path: Path) -> None:
    fill(path, 3)
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"tester", b"t\xffster", 1))
    assert len(journal.tail(2).result(WAIT_S).entries) == 2
    with pytest.raises(OSError, match="is damaged"):
        journal.tail(3).result(WAIT_S)


def test_whatever_fails_in_writing_an_entry_is_a_problem(
    journal: Journal, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal.append("tester", "before").result(WAIT_S)
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.durable.sync_folder", _broken)
        with pytest.raises(OSError, match="cannot be written: oops"):
            journal.append("tester", "lost").result(WAIT_S)
    assert journal.problem is not None
    assert [entry["what"] for entry in read_verified(path)] == ["before"]
    with pytest.raises(OSError, match="cannot be written"):
        journal.append("tester", "lost", result=object()).result(WAIT_S)
    journal.append("tester", "after").result(WAIT_S)
    assert journal.problem is None
    assert [entry["what"] for entry in read_verified(path)] == ["before", "after"]


@pytest.mark.parametrize("cut", [1, 2, 40])
def test_an_entry_that_a_crash_left_half_written_is_removed_and_said(path: Path, cut: int) -> None:
    fill(path, 3)
    whole = path.read_bytes()
    fill(path, 1)
    torn = path.read_bytes()[:-cut]
    path.write_bytes(torn)
    head_file(path).replace(path.with_suffix(".gone"))  # the head is written after the line
    fill(path, 1)
    entries = read_verified(path)
    assert [entry["what"] for entry in entries[3:]] == ["journal damaged", "write"]
    assert f"{len(torn) - len(whole)} bytes" in entries[3]["result"]


def test_entries_missing_at_the_end_are_said_in_the_journal(path: Path) -> None:
    fill(path)
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:3]))
    fill(path, 1)
    entries = read_verified(path)
    assert entries[3]["result"] == "2 entries are missing at its end"


def test_a_journal_whose_end_does_not_hold_is_kept_and_begun_anew(path: Path) -> None:
    fill(path)
    damaged = path.read_bytes()[:-3] + b"?" + path.read_bytes()[-2:]
    path.write_bytes(damaged)
    fill(path, 1)
    entries = read_verified(path)
    assert [entry["what"] for entry in entries] == ["journal damaged", "write"]
    (kept,) = path.parent.glob("*.broken-*")
    assert kept.read_bytes() == damaged
    assert kept.name in entries[0]["result"]


def test_a_full_disk_fails_the_entry_and_leaves_the_journal_whole(path: Path) -> None:
    fill(path, 2)
    journal = Journal(path, "boot")
    journal.append("tester", "before", result="").result(WAIT_S)
    limit_fails = pytest.MonkeyPatch()
    limit_fails.setattr("gateway.records.journal.os.fsync", _no_space)
    with pytest.raises(OSError, match="No space left on device; make room"):
        journal.append("tester", "lost", result="").result(WAIT_S)
    assert journal.problem is not None
    limit_fails.undo()
    journal.append("tester", "after", result="").result(WAIT_S)
    assert journal.problem is None
    journal.close()
    assert [entry["what"] for entry in read_verified(path)] == ["write", "write", "before", "after"]


def test_an_entry_whose_head_cannot_be_written_is_not_in_the_journal(
    journal: Journal, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal.append("tester", "before").result(WAIT_S)
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.durable.os.fsync", _fails_for(f"{head_file(path).name}.draft"))
        with pytest.raises(OSError, match="No space left on device; make room"):
            journal.append("tester", "lost").result(WAIT_S)
    assert [entry["what"] for entry in read_verified(path)] == ["before"]
    journal.append("tester", "after").result(WAIT_S)
    assert [entry["what"] for entry in read_verified(path)] == ["before", "after"]


def test_an_entry_whose_head_was_written_and_perhaps_not_kept_is_in_neither(
    journal: Journal, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The head has its new name, and only the folder cannot be made durable."""
    journal.append("tester", "before").result(WAIT_S)
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.durable.sync_folder", _no_space)
        with pytest.raises(OSError, match="No space left on device"):
            journal.append("tester", "lost").result(WAIT_S)
    assert [entry["what"] for entry in read_verified(path)] == ["before"]


def _fails_for(name: str) -> Callable[[int], None]:
    """What makes durable every file but this one."""
    fsync = os.fsync

    def fails(descriptor: int) -> None:
        if Path(f"/proc/self/fd/{descriptor}").readlink().name == name:
            _no_space(descriptor)
        fsync(descriptor)

    return fails


def _broken(_what: object) -> None:
    raise RuntimeError("oops")


def _no_space(_what: object) -> None:
    raise OSError(28, "No space left on device")
