"""Batch numbers that are used again, and batches that come back: every row is in the store once, or told."""

import contextlib
import shutil
import sqlite3
from collections import Counter
from pathlib import Path

import msgspec
import pytest

from ml.store import Store
from ml.store.tables import TELEMETRY
from ml.store.upkeep import retain
from server_gui.core.recording.errors import Contradicted, Damaged
from server_gui.core.recording.receipts import RECEIPTS, Receipt, Receipts
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import ahead, send, upload
from server_gui.core.recording.uploader import Uploader
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import batch

HERE = TELEMETRY.location("exo-01", 1)


def record(folder: Path, seqs: range, text: str = "here") -> None:
    """Rows, a session and a marker, which wait for upload then."""
    with Spool(folder, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        for seq in seqs:
            recorder.record("exo-01", 1, batch(seq))
        recorder.mark("exo-01", text)


def send_all(folder: Path, store: Store) -> list[str]:
    """Send what waits; what was wrong with it."""
    problems = []
    with Spool(folder, reserve_bytes=0) as spool:
        for number in spool.waiting():
            try:
                send(spool, number, store)
            except Damaged as error:
                problems.append(str(error))
    return problems


def found(store: Store) -> Counter[int]:
    """How often each notification is there."""
    return Counter(store.dataset(HERE).to_table()["seq"].to_pylist())


def names(store: Store) -> list[tuple[str, int, int]]:
    """What names the rows of `events`."""
    table = store.dataset("events").to_table(columns=["spool", "batch", "number"])
    return [(row["spool"], row["batch"], row["number"]) for row in table.to_pylist()]


@pytest.mark.parametrize("receipts", ["kept", "removed"])
def test_rows_under_a_number_that_was_used_before_arrive_too(
    tmp_path: Path, folder_url: str, receipts: str
) -> None:
    spool, store = tmp_path / "spool", Store(folder_url)
    record(spool, range(15))
    assert send_all(spool, store) == []
    for file in spool.glob("*.db*"):
        file.unlink()
    if receipts == "removed":
        (spool / RECEIPTS).unlink()
    record(spool, range(15, 25))
    assert send_all(spool, store) == []
    assert found(store) == Counter(range(25))
    assert len(set(names(store))) == len(names(store)) == 2


def test_numbers_go_on_after_the_newest_receipt(tmp_path: Path, folder_url: str) -> None:
    record(tmp_path, range(3))
    send_all(tmp_path, Store(folder_url))
    for file in tmp_path.glob("*.db*"):
        file.unlink()
    with Spool(tmp_path) as spool:
        assert spool.first == 2


def test_an_older_copy_of_a_spool_is_told_and_what_is_recorded_into_it_arrives(
    tmp_path: Path, folder_url: str
) -> None:
    spool, copy, store = tmp_path / "spool", tmp_path / "copy", Store(folder_url)
    with Spool(spool, reserve_bytes=0) as opened:
        with Recorder(opened) as recorder:
            recorder.record("exo-01", 1, batch(0))
            recorder.cut(lambda: None)
            recorder.flush(WAIT_S)
            shutil.copytree(spool, copy)
            recorder.record("exo-01", 1, batch(1))
            recorder.cut(lambda: None)
            recorder.flush(WAIT_S)
            recorder.record("exo-01", 1, batch(2))
        for number in opened.waiting():
            send(opened, number, store)
    shutil.rmtree(spool)
    copy.rename(spool)
    with Spool(spool, reserve_bytes=0) as opened:
        [told, *_] = ahead(opened, store)
        assert f"{HERE} has batch 3 of the spool {spool}, which had only 1" in told
    record(spool, range(10, 15))
    assert send_all(spool, store) == []
    assert found(store) == Counter([0, 1, 2, *range(10, 15)])
    assert len(set(names(store))) == len(names(store))


def test_an_older_copy_is_told_also_where_what_it_lacks_was_recorded_by_a_later_opening(
    tmp_path: Path, folder_url: str
) -> None:
    spool, copy, store = tmp_path / "spool", tmp_path / "copy", Store(folder_url)
    record(spool, range(3))
    assert send_all(spool, store) == []
    shutil.copytree(spool, copy)
    for first in (3, 6):
        record(spool, range(first, first + 3))
    assert send_all(spool, store) == []
    shutil.rmtree(spool)
    copy.rename(spool)
    with Spool(spool, reserve_bytes=0) as opened, Recorder(opened) as recorder:
        uploader = Uploader(opened, lambda: Store(folder_url))
        recorder.record("exo-01", 1, batch(20))
        recorder.cut(lambda: None)
        assert recorder.flush(WAIT_S)
        assert uploader._empty(asked=True)
        assert f"{HERE} has batch 3 of the spool {spool}, which had only 1" in uploader.state.ahead[0]
        assert uploader.state.lost == ()
    assert found(store) == Counter([*range(9), 20])


def test_files_that_are_missing_are_an_alarm_of_the_uploader(tmp_path: Path, folder_url: str) -> None:
    record(tmp_path, range(3))
    send_all(tmp_path, Store(folder_url))
    for file in tmp_path.glob("*.db*"):
        file.unlink()
    with Spool(tmp_path, reserve_bytes=0) as opened:
        [told] = Uploader(opened, lambda: Store(folder_url)).state.lost
    assert f"files are missing in the spool {tmp_path}: batch 1 was uploaded from it" in told


def test_a_damaged_batch_that_is_repaired_and_named_back_arrives(tmp_path: Path, folder_url: str) -> None:
    store = Store(folder_url)
    record(tmp_path, range(5))
    good = (tmp_path / "00000001.db").read_bytes()
    (tmp_path / "00000001.db").write_bytes(b"x" * len(good))
    record(tmp_path, range(5, 15))
    assert send_all(tmp_path, store) == []
    assert found(store) == Counter(range(5, 15))
    (tmp_path / "00000001.damaged.db").unlink()
    (tmp_path / "00000001.db").write_bytes(good)
    assert send_all(tmp_path, store) == []
    assert found(store) == Counter(range(15))


@pytest.mark.parametrize("table", ["run", "record"])
def test_of_a_batch_that_is_repaired_only_what_was_damaged_is_added(
    tmp_path: Path, store_url: str, table: str
) -> None:
    store = Store(store_url)
    record(tmp_path, range(5))
    good = (tmp_path / "00000001.db").read_bytes()
    column = {"run": "data", "record": "content"}[table]
    with contextlib.closing(sqlite3.connect(tmp_path / "00000001.db")) as database, database:
        change = f"UPDATE {table} SET {column} = substr({column}, 1, 20) || x'c1' || substr({column}, 22)"
        database.execute(f"{change} WHERE rowid = 1")
    [problem] = send_all(tmp_path, store)
    assert "all else of it is in the store" in problem
    before = found(store).total() + store.dataset("sessions").count_rows()
    for _ in range(2):
        (tmp_path / "00000001.damaged.db").unlink(missing_ok=True)
        (tmp_path / "00000001.db").write_bytes(good)
        assert send_all(tmp_path, store) == []
        (tmp_path / "00000001.uploaded.db").unlink()
    assert found(store) == Counter(range(5))
    after = found(store).total() + store.dataset("sessions").count_rows()
    assert after == before + {"run": 5, "record": 1}[table]
    assert len(set(names(store))) == len(names(store))


def test_another_batch_by_the_same_name_is_set_aside_and_what_is_wrong_is_told(
    tmp_path: Path, folder_url: str
) -> None:
    store = Store(folder_url)
    record(tmp_path, range(5))
    with Spool(tmp_path) as spool:
        send(spool, 1, store)
    shutil.copy(tmp_path / "00000001.uploaded.db", tmp_path / "00000001.db")
    with contextlib.closing(sqlite3.connect(tmp_path / "00000001.db")) as database, database:
        [content] = database.execute("SELECT content FROM record WHERE number = 2").fetchone()
        other = content.replace(b"here", b"away")
        database.execute("UPDATE record SET content = ?, crc = NULL WHERE number = 2", [other])
    [problem] = send_all(tmp_path, store)
    assert "/events has something else as row 1 of this batch" in problem
    assert "it is kept as 00000001.damaged.db, and is not in the store as a whole" in problem
    assert found(store) == Counter(range(5))


def test_rows_of_a_known_batch_that_were_removed_from_the_store_are_brought_again_once(
    tmp_path: Path, folder_url: str
) -> None:
    store = Store(folder_url)
    record(tmp_path, range(5))
    with Spool(tmp_path) as spool, contextlib.closing(spool.read(1)) as segment:
        upload(segment, spool.id, store)
        for again in (0, 1):
            store.table(HERE).delete()
            if again:
                with pytest.raises(Contradicted, match="had 5 rows of batch 1, which were removed since"):
                    upload(segment, spool.id, store)
            else:
                upload(segment, spool.id, store)
                assert found(store) == Counter(range(5))


def test_what_retention_has_removed_of_a_known_batch_is_not_brought_again(
    tmp_path: Path, folder_url: str
) -> None:
    store = Store(folder_url)
    record(tmp_path, range(5))
    with Spool(tmp_path) as spool, contextlib.closing(spool.read(1)) as segment:
        upload(segment, spool.id, store)
        [middle] = store.dataset(HERE).to_table().sort_by("seq")["utc"].to_pylist()[2:3]
        retain(store, [TELEMETRY], middle)
        store.table(HERE).delete("seq = 4")
        assert found(store) == Counter([2, 3])
        upload(segment, spool.id, store)
        assert found(store) == Counter([2, 3, 4])


def test_a_batch_that_arrived_before_its_server_died_is_there_once_and_has_its_receipt(
    tmp_path: Path, store_url: str
) -> None:
    store = Store(store_url)
    record(tmp_path, range(5))
    with Spool(tmp_path) as spool:
        with contextlib.closing(spool.read(1)) as segment:
            sent = upload(segment, spool.id, store)
        send(spool, 1, Store(store_url))
        [receipt] = spool.receipts.all()
    assert isinstance(receipt, Receipt)
    assert sorted(receipt.parts, key=str) == sorted(sent.parts, key=str)
    assert found(store) == Counter(range(5))


def test_a_segment_from_before_writers_had_names_goes_under_that_of_its_spool(
    tmp_path: Path, folder_url: str
) -> None:
    store = Store(folder_url)
    record(tmp_path, range(5))
    with contextlib.closing(sqlite3.connect(tmp_path / "00000001.db")) as database, database:
        database.execute("DROP TABLE meta")
    assert send_all(tmp_path, store) == []
    assert {spool for spool, _, _ in names(store)} == {(tmp_path / "id").read_text().strip()}


def test_what_an_opening_left_unfinished_keeps_its_writer(tmp_path: Path) -> None:
    left = Spool(tmp_path, reserve_bytes=0)
    left.append([], [Record("events", {"robot": "exo-01"})])
    left.close()  # as if it had been killed: nothing is frozen
    with Spool(tmp_path) as spool:
        assert spool.writer != left.writer
        with contextlib.closing(spool.read(1)) as segment:
            assert segment.writer == left.writer


def receipt(number: int) -> Receipt:
    return Receipt("w", number, "file:///s", ())


def test_receipts_are_kept_and_a_line_that_was_being_written_is_none(tmp_path: Path) -> None:
    receipts = Receipts(tmp_path / RECEIPTS)
    assert receipts.newest() is None
    for number in (1, 2):
        receipts.add(receipt(number))
    with receipts.file.open("ab") as out:
        out.write(b'{"crc":"0000')
    assert receipts.newest() == receipt(2)
    receipts.add(receipt(3))
    assert list(receipts.all()) == [receipt(1), receipt(2), receipt(3)]
    assert [msgspec.json.decode(line)["batch"] for line in receipts.file.read_bytes().splitlines()] == [
        1,
        2,
        3,
    ]


@pytest.mark.parametrize("damage", ["altered", "removed", "cut off"])
def test_a_receipt_that_is_not_as_it_was_written_is_found(tmp_path: Path, damage: str) -> None:
    receipts = Receipts(tmp_path / RECEIPTS)
    for number in (1, 2, 3):
        receipts.add(receipt(number))
    lines = receipts.file.read_bytes().splitlines(keepends=True)
    lines[1] = {"altered": lines[1].replace(b'"batch":2', b'"batch":9'), "removed": b"", "cut off": lines[1]}[
        damage
    ]
    lines[2] = lines[2][:-9] if damage == "cut off" else lines[2]
    receipts.file.write_bytes(b"".join(lines))
    assert sum(not isinstance(each, Receipt) for each in receipts.all()) == 1
