"""What is lost, damaged or was never sent is found and named, on a folder and on an S3 server."""

import contextlib
import dataclasses
import sqlite3
from pathlib import Path

from ml.store import Store
from server_gui.core.cloud import verify
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from tests.unit.cloud.recordings import record
from tests.unit.recording.robots import batch


def problems(store: Store, *, deep: bool = False) -> list[str]:
    return list(verify.damages(store, verify.files(store), lambda _: None, deep=deep))


def telemetry(store: Store) -> tuple[str, bytes]:
    """The file with the telemetry."""
    [file] = [file for file in verify.files(store) if file.location == "telemetry/000"]
    path = f"{file.location}/{file.path}"
    return path, store.objects.read(path) or b""


def test_a_whole_store_is_whole(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    assert len(verify.files(recorded.store)) == 4
    assert problems(recorded.store) == problems(recorded.store, deep=True) == []
    assert list(verify.batches_missing(recorded.store, recorded.spool)) == []


def test_a_second_copy_that_is_damaged_is_named_and_the_others_are_looked_into(
    folder_url: str, tmp_path: Path
) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    (recorded.spool / "00000001.uploaded.db").write_bytes(b"x" * 10_000)
    (recorded.spool / "00000003.uploaded.db").write_bytes(b"")
    [problem] = verify.batches_missing(recorded.store, recorded.spool)
    assert problem.endswith("is damaged: file is not a database; it is a second copy: remove it")


def test_a_second_copy_whose_tables_have_lost_their_names_is_damaged(folder_url: str, tmp_path: Path) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    with contextlib.closing(sqlite3.connect(recorded.spool / "00000001.uploaded.db")) as copy:
        copy.execute("ALTER TABLE run RENAME TO rum")
    [problem] = verify.batches_missing(recorded.store, recorded.spool)
    assert "00000001.uploaded.db is damaged: no such table: run" in problem


def test_a_file_that_has_gone_is_named(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    path, _ = telemetry(recorded.store)
    recorded.store.objects.remove(path)
    assert problems(recorded.store) == [f"{recorded.store.url}/{path} is not there, with 100 rows"]


def test_a_file_that_was_cut_off_is_named(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    path, content = telemetry(recorded.store)
    recorded.store.objects.write(path, [content[:-10]])
    [problem] = problems(recorded.store)
    assert problem == f"{recorded.store.url}/{path} has {len(content) - 10} bytes instead of {len(content)}"


def test_a_footer_that_is_damaged_is_found(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    path, content = telemetry(recorded.store)
    recorded.store.objects.write(path, [content[:-500] + bytes(492) + content[-8:]])
    [problem] = problems(recorded.store)
    assert f"{path} cannot be read" in problem


def test_damage_among_the_values_is_found_by_reading_them(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    path, content = telemetry(recorded.store)
    recorded.store.objects.write(path, [content[:4] + bytes(1000) + content[1004:]])
    assert problems(recorded.store) == []
    [problem] = problems(recorded.store, deep=True)
    assert f"{path} cannot be read" in problem


def test_rows_that_are_not_in_a_file_are_found(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    [file] = [file for file in verify.files(recorded.store) if file.location == "events"]
    more = dataclasses.replace(file, rows=9)
    [problem] = verify.damages(recorded.store, [more], lambda _: None, deep=False)
    assert problem.endswith("has 2 rows instead of 9")


def test_a_batch_that_never_arrived_is_named(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    with Spool(recorded.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(1, 5))
        [number] = spool.waiting()
        spool.uploaded(number)  # as if it were in the store
    unproven, *missing = verify.batches_missing(recorded.store, recorded.spool)
    assert f"has no receipt of batch {number}, which went to a store" in unproven
    assert [text.partition(" is not in ")[2] for text in missing] == [
        f"{recorded.store.url}/{table}" for table in ("sessions", "telemetry/000")
    ]
    assert all(f"batch {number} of the spool {recorded.spool}" in text for text in missing)


def test_a_second_copy_that_cannot_be_opened_is_named_and_the_others_are_looked_into(
    folder_url: str, tmp_path: Path
) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    copy = recorded.spool / "00000001.uploaded.db"
    copy.unlink()
    copy.mkdir()
    [problem] = verify.batches_missing(recorded.store, recorded.spool)
    assert "00000001.uploaded.db cannot be used" in problem
