"""The spool: what was kept stays, in order, under numbers that are given once."""

import contextlib
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ml.store import durable
from server_gui.core.recording import records
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.rows import JournalHead, Layout, Record, Run
from server_gui.core.recording.segment import SCHEMA, Segment
from server_gui.core.recording.spool import Spool

LAYOUT = Layout(("left_knee.position", "trunk.tilt_forward"), ("rad", None))


def run(robot: str = "exo-01", seq: int = 0, rows: int = 3) -> Run:
    values = np.arange(2 * rows, dtype=np.float64).reshape(2, rows) + seq
    values[1, 0] = np.nan
    numbers = np.arange(rows, dtype=np.int64)
    return Run(
        robot, "s-1", "c-1", 1, LAYOUT, numbers + 10, numbers * 0 + seq, numbers, numbers * 0 + 7, values
    )


def runs(segment: Segment) -> list[Run]:
    found = list(segment.runs())
    segment.close()
    return found


def test_what_was_appended_is_read_as_it_was(tmp_path: Path) -> None:
    with Spool(tmp_path) as spool:
        spool.append([run(), run("exo-02")], [Record("events", {"robot": "exo-01", "text": "é"})])
        spool.freeze()
        segment = spool.read(spool.waiting()[0])
        assert list(segment.records()) == [Record("events", {"robot": "exo-01", "text": "é"})]
        found = runs(segment)
    assert [(read.robot, read.session, read.connection, read.stream) for read in found] == [
        ("exo-01", "s-1", "c-1", 1),
        ("exo-02", "s-1", "c-1", 1),
    ]
    for name in ("stamps_ns", "seqs", "rows", "utc_offset_ns", "values"):
        np.testing.assert_array_equal(getattr(found[0], name), getattr(run(), name))
    assert found[0].layout == LAYOUT


def test_a_row_cannot_be_kept_twice(tmp_path: Path) -> None:
    with Spool(tmp_path) as spool:
        spool.append([run()], [])
        with pytest.raises(SpoolUnusable, match="UNIQUE"):
            spool.append([run(seq=5), run()], [])
        spool.freeze()
        assert len(runs(spool.read(1))) == 1  # all or nothing


def test_numbers_are_never_given_twice(tmp_path: Path) -> None:
    for expected in (1, 2, 3):
        with Spool(tmp_path, keep_bytes=0) as spool:
            spool.append([run()], [])
            spool.freeze()
            assert spool.waiting() == [expected]
            spool.uploaded(expected)
            assert spool.make_room()
            assert spool.waiting() == []


def test_what_a_crash_left_waits_for_upload(tmp_path: Path) -> None:
    with Spool(tmp_path) as spool:
        name = spool.id
        spool.append([run()], [])
    with Spool(tmp_path) as spool:
        assert spool.id == name
        assert spool.waiting() == [1]
        assert len(runs(spool.read(1))) == 1


def test_oldest_uploaded_segments_go_first_and_others_never(tmp_path: Path) -> None:
    free = 100
    with Spool(tmp_path, reserve_bytes=100, free_bytes=lambda folder: free) as spool:
        for seq in range(4):
            spool.append([run(seq=seq)], [])
            spool.freeze()
        spool.uploaded(1)
        spool.uploaded(2)
        assert spool.make_room()
        assert len(list(tmp_path.glob("*.uploaded.db"))) == 2  # room enough: they stay
        free = 99
        assert not spool.make_room()
        assert list(tmp_path.glob("*.uploaded.db")) == []
        assert spool.waiting() == [3, 4]


def test_a_segment_in_the_making_does_not_wait_for_upload(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[list[int]] = []
    with Spool(tmp_path) as spool:
        spool.append([run()], [])
        current = spool._current

        def close() -> None:
            seen.append(spool.waiting())
            Segment.close(current)

        monkeypatch.setattr(current, "close", close)
        spool.freeze()
        assert seen == [[]]  # both files are there, and neither is frozen yet
        assert spool.waiting() == [1]


def test_one_server_at_a_time(tmp_path: Path) -> None:
    with Spool(tmp_path), pytest.raises(SpoolUnusable, match="another server records into"):
        Spool(tmp_path)
    Spool(tmp_path).close()


def test_a_damaged_segment_is_set_aside_its_number_is_not_given_again_and_recording_begins(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with Spool(tmp_path) as spool:
        spool.append([], [Record("journal", {"n": 7})], {"exo-01": JournalHead(7, "abc")})
        spool.freeze()
    (tmp_path / "00000002.db").write_bytes(b"not a database" * 100)
    for _ in range(2):
        with Spool(tmp_path) as spool:
            assert spool._current.number == 3
            assert spool.waiting() == [1]
            assert spool.heads == {"exo-01": JournalHead(7, "abc")}
            assert [file.name for file in spool.damaged()] == ["00000002.damaged.db"]
    [said] = caplog.messages
    assert "00000002.db is damaged: file is not a database; it is kept as" in said


@pytest.mark.parametrize("rows", [0, 3])
def test_where_a_column_is_called_otherwise_recording_goes_on_in_a_file_of_its_own(
    tmp_path: Path, rows: int
) -> None:
    with Spool(tmp_path) as spool:
        if rows:
            spool.append([run(rows=rows)], [])
    file = tmp_path / "00000001.db"
    file.write_bytes(
        file.read_bytes().replace(b"session TEXT", b"sessyon TEXT")
    )  # as a flipped bit leaves it
    with Spool(tmp_path) as spool:
        spool.append([run(seq=9)], [])
        spool.freeze()
        assert spool.waiting() == [1, 2]
        assert len(runs(spool.read(2))) == 1


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(SpoolUnusable, match="cannot be used"):
        Spool(tmp_path / "file" / "spool")


def test_journal_heads_outlive_segments_and_crashes(tmp_path: Path) -> None:
    with Spool(tmp_path, keep_bytes=0) as spool:
        spool.append([], [Record("journal", {"n": 7})], {"exo-01": JournalHead(7, "abc")})
        spool.freeze()
        spool.uploaded(1)
        spool.make_room()
    Segment(tmp_path / "00000003.db", 3).close()  # a crash in the middle of making it
    with Spool(tmp_path) as spool:
        assert spool.heads == {"exo-01": JournalHead(7, "abc")}


@pytest.mark.parametrize("column", ["n", "hash", "robot"])
@pytest.mark.parametrize("how", ["closed", "killed"])
def test_a_bit_that_flips_in_a_journals_head_neither_hides_an_entry_nor_brings_one_twice(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, how: str, column: str
) -> None:
    entries = [records.journal("exo-01", {"n": n, "hash": f"h{n}"}) for n in range(1, 7)]
    with Spool(tmp_path, reserve_bytes=0) as spool:
        spool.append([], entries, {"exo-01": JournalHead(6, "h6"), "exo-02": JournalHead(2, "g2")})
        if how == "closed":  # then the newest file has a head, and no entry
            spool.freeze()
    with contextlib.closing(sqlite3.connect(max(tmp_path.glob("0*.db")))) as database, database:
        flipped = "n + 4" if column == "n" else f"'x' || substr({column}, 2)"
        database.execute(f"UPDATE journal_head SET {column} = {flipped} WHERE robot = 'exo-01'")
    with Spool(tmp_path, reserve_bytes=0) as spool:
        assert spool.heads == {"exo-01": JournalHead(6, "h6"), "exo-02": JournalHead(2, "g2")}
    assert "is damaged: up to where a journal is recorded is looked for" in caplog.text


def test_journal_heads_from_before_they_had_checksums_are_read(tmp_path: Path) -> None:
    with Spool(tmp_path) as spool:
        spool.append([], [Record("journal", {"n": 7})], {"exo-01": JournalHead(7, "abc")})
    with contextlib.closing(sqlite3.connect(max(tmp_path.glob("0*.db")))) as database, database:
        database.execute("ALTER TABLE journal_head DROP COLUMN crc")
    with Spool(tmp_path) as spool:
        assert spool.heads == {"exo-01": JournalHead(7, "abc")}


def test_every_commit_is_synchronised(tmp_path: Path) -> None:
    with Spool(tmp_path) as spool:
        database: sqlite3.Connection = spool._current._database
        assert database.execute("PRAGMA synchronous").fetchone() == (2,)
        assert database.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def _refused(*_: Any, **__: Any) -> None:
    raise OSError(5, "Input/output error")


@pytest.mark.parametrize("broken", [(os, "fsync"), (Path, "touch")])
def test_a_segment_that_the_disk_refuses_is_begun_later_and_the_one_before_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: tuple[object, str]
) -> None:
    with Spool(tmp_path) as spool:
        spool.append([run()], [])
        with monkeypatch.context() as failing:
            failing.setattr(*broken, _refused)
            with pytest.raises(SpoolUnusable, match="Input/output error"):
                spool.freeze()
        spool.append([run(seq=5)], [])
        spool.freeze()
        assert spool.waiting() == [1]
        assert sum(map(len, runs(spool.read(1)))) == 6
        spool.append([run(seq=6)], [])
        spool.freeze()
        assert spool.waiting() == [1, 2]


@pytest.mark.parametrize("work", [lambda spool: spool.uploaded(1), lambda spool: spool.set_aside(1)])
@pytest.mark.parametrize("broken", [(os, "fsync"), (Path, "rename")])
def test_a_name_that_the_disk_refuses_is_an_error_of_the_spool(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    work: Callable[[Spool], object],
    broken: tuple[object, str],
) -> None:
    with Spool(tmp_path) as spool:
        spool.append([run()], [])
        spool.freeze()
        monkeypatch.setattr(*broken, _refused)
        with pytest.raises(SpoolUnusable, match="Input/output error"):
            work(spool)
        monkeypatch.undo()


def test_a_spool_that_cannot_be_begun_says_so_and_lets_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as failing:
        failing.setattr(os, "fsync", _refused)
        with pytest.raises(SpoolUnusable, match="Input/output error"):
            Spool(tmp_path)
    Spool(tmp_path).close()


def test_an_uploaded_batch_takes_its_log_along(tmp_path: Path) -> None:
    with Spool(tmp_path) as spool:
        spool.append([run()], [])
        reader = sqlite3.connect(tmp_path / "00000001.db")  # as an export that has it open when it is frozen
        reader.execute("SELECT count(*) FROM run").fetchone()
        spool.freeze()
        spool.uploaded(1)
        reader.close()
    assert not list(tmp_path.glob("00000001.db*"))
    assert len(runs(Segment(tmp_path / "00000001.uploaded.db", 1))) == 1


def test_a_batch_that_was_killed_between_its_names_is_whole(tmp_path: Path) -> None:
    with Spool(tmp_path) as spool:
        spool.append([run()], [])
        reader = sqlite3.connect(tmp_path / "00000001.db")
        reader.execute("SELECT count(*) FROM run").fetchone()
        spool.freeze()
    database, wal = ((tmp_path / f"00000001.db{suffix}").read_bytes() for suffix in ("", "-wal"))
    reader.close()
    (tmp_path / "00000001.db").unlink()
    (tmp_path / "00000001.uploaded.db").write_bytes(database)
    (tmp_path / "00000001.db-wal").write_bytes(wal)
    Spool(tmp_path).close()
    assert not list(tmp_path.glob("00000001.db*"))
    assert len(runs(Segment(tmp_path / "00000001.uploaded.db", 1))) == 1


def test_a_segment_that_cannot_be_opened_is_let_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[sqlite3.Connection] = []
    connect = sqlite3.connect

    class Failing(sqlite3.Connection):
        def executescript(self, sql: str) -> sqlite3.Cursor:
            assert sql == SCHEMA
            raise sqlite3.OperationalError("disk I/O error")

    def failing(path: Path, **options: Any) -> sqlite3.Connection:
        opened.append(connect(path, factory=Failing, **options))
        return opened[-1]

    monkeypatch.setattr(sqlite3, "connect", failing)
    with pytest.raises(SpoolUnusable, match="disk I/O error"):
        Segment(tmp_path / "00000001.db", 1)
    with pytest.raises(sqlite3.ProgrammingError, match="closed"):
        opened[0].execute("SELECT 1")


def test_the_names_of_the_folders_above_a_spool_last_whoever_made_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: set[Path] = set()
    monkeypatch.setattr(durable, "_sync", synced.add)
    folder = tmp_path / "data" / "gwrms" / "spool"
    folder.mkdir(parents=True)  # by a server that was killed then
    Spool(folder).close()
    assert synced >= {folder, folder.parent, folder.parent.parent, tmp_path}


def test_a_folder_above_that_is_anothers_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def theirs(path: Path) -> None:
        if path == tmp_path:
            raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(durable, "_sync", theirs)
    Spool(tmp_path / "spool").close()
