"""Whatever is done to a store or to a spool's receipts, `gwrms cloud verify` finds it and names it."""

import contextlib
import json
import os
import re
import shutil
import sqlite3
import zlib
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from gateway.main import main
from ml.store import Store
from ml.store.tables import RESOURCES, TABLES, TELEMETRY
from ml.store.upkeep import compact, pin, retain, vacuum
from server_gui.core.cloud import spooled, verify
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.receipts import RECEIPTS
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.cloud.recordings import record
from tests.unit.recording.robots import batch

KNEE = "left_knee.position"


class Place:
    """A store in a folder, the spool that filled it in three batches, and the command that looks."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.store, self.spool = folder / "store", folder / "spool"
        self._config = folder / "server.toml"
        self._config.write_text(
            f'[store]\nurl = "{self.store.as_uri()}"\n[recorder]\nspool = "{self.spool}"\n'
        )
        self._capsys = capsys
        for robot in ("exo-01", "exo-01", "exo-02"):
            record(self.url, self.spool, robot)

    @property
    def url(self) -> str:
        return self.store.as_uri()

    def verify(self, *words: str) -> tuple[int, str]:
        """The exit status, and all that was said of problems."""
        status = main(["cloud", "verify", "--json", *words, "--config", str(self._config)])
        return status, "\n".join(json.loads(self._capsys.readouterr().out)["problems"])

    def ask(self) -> dict[str, Any]:
        main(["cloud", "verify", "--json", "--config", str(self._config)])
        found: dict[str, Any] = json.loads(self._capsys.readouterr().out)
        return found

    def status(self, *words: str) -> int:
        """The exit status of any command."""
        status = main(["cloud", *words, "--config", str(self._config)])
        self._capsys.readouterr()
        return status

    def told(self, *words: str) -> str:
        main(["cloud", *(words or ("verify",)), "--config", str(self._config)])
        said = self._capsys.readouterr()
        return said.out + said.err

    def rename_back(self, *batches: str) -> None:
        """As if they had not been uploaded yet."""
        for batch_ in batches:
            (self.spool / f"{batch_}.uploaded.db").rename(self.spool / f"{batch_}.db")

    def files(self, location: str = "telemetry/000") -> list[Path]:
        return sorted((self.store / location).rglob("*.parquet"))

    def log(self, location: str = "telemetry/000") -> list[Path]:
        return sorted((self.store / location / "_delta_log").glob("*.json"))


@pytest.fixture
def place(store_libraries: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Place:
    return Place(tmp_path, capsys)


def rewrite(file: Path, change: Callable[[pa.Table], pa.Table]) -> None:
    """Other rows in a file, of which the log then says the right size and number: only values tell."""
    known = file.stat().st_size
    pq.write_table(change(pq.read_table(file, partitioning=None)), file)
    new = file.stat().st_size
    for entry in (file.parents[2] if "session=" in str(file) else file.parent).glob("_delta_log/*.json"):
        lines = entry.read_text().splitlines(keepends=True)
        changed = (
            line.replace(f'"size":{known}', f'"size":{new}') if file.name in line else line for line in lines
        )
        entry.write_text("".join(changed))


def replaced(rows: pa.Table, name: str, values: pa.Array) -> pa.Table:
    return rows.set_column(rows.column_names.index(name), rows.schema.field(name), values)


def retyped(rows: pa.Table, name: str, values: pa.Array) -> pa.Table:
    return rows.set_column(rows.column_names.index(name), name, values)


def altered(rows: pa.Table) -> pa.Table:
    values = rows[KNEE].to_pylist()
    return replaced(rows, KNEE, pa.array([*values[:50], values[50] + 1e-9, *values[51:]]))


def swapped(rows: pa.Table) -> pa.Table:
    other = rows["left_knee.velocity"]
    return replaced(replaced(rows, "left_knee.velocity", rows[KNEE]), KNEE, other)


def misplaced(rows: pa.Table) -> pa.Table:
    return replaced(rows, KNEE, rows[KNEE].take(pa.array([1, 0, *range(2, len(rows))])))


def nulled(rows: pa.Table) -> pa.Table:
    return replaced(rows, KNEE, pc.if_else(pc.equal(rows[KNEE], rows[KNEE][0]), None, rows[KNEE]))


def of_file(change: Callable[[pa.Table], pa.Table]) -> Callable[[Place], None]:
    return lambda place: rewrite(place.files()[0], change)


def file_deleted(place: Place) -> None:
    place.files()[0].unlink()


def file_cut_off(place: Place) -> None:
    content = place.files()[0].read_bytes()
    place.files()[0].write_bytes(content[:-100])


def file_doubled(place: Place) -> None:
    file = place.files()[0]
    twin = file.with_name("part-1.zstd.parquet")
    shutil.copy(file, twin)
    [entry] = [each for each in place.log() if file.name in each.read_text()]
    newest = place.log()[-1]
    adds = [line for line in entry.read_text().splitlines() if file.name in line]
    after = newest.with_name(f"{int(newest.stem) + 1:020}.json")
    after.write_text("\n".join(adds).replace(file.name, twin.name) + "\n")


def row_removed(place: Place) -> None:
    Store(place.url).table("telemetry/000").delete("seq = 3 AND row = 1 AND robot = 'exo-02'")


def event_altered(place: Place) -> None:
    rewrite(place.files("events")[0], lambda rows: replaced(rows, "kind", pa.array(["marker"] * len(rows))))


def in_the_log(change: Callable[[str], str]) -> Callable[[Place], None]:
    """Other text in the entries of the telemetry's log."""

    def damage(place: Place) -> None:
        before = [entry.read_text() for entry in place.log()]
        for entry, text in zip(place.log(), before, strict=True):
            entry.write_text(change(text))
        assert before != [entry.read_text() for entry in place.log()]

    return damage


def unit_altered(text: str) -> str:
    return text.replace(r"\"unit\":\"rad\"", r"\"unit\":\"deg\"")


def column_removed(text: str) -> str:
    lines = [json.loads(line) for line in text.splitlines()]
    for line in lines:
        if "metaData" in line:
            schema = json.loads(line["metaData"]["schemaString"])
            schema["fields"] = [each for each in schema["fields"] if each["name"] != KNEE]
            line["metaData"]["schemaString"] = json.dumps(schema)
    return "".join(f"{json.dumps(line)}\n" for line in lines)


def last_time_altered(text: str) -> str:
    return re.sub(r'(\\"maxValues\\": ?\{[^}]*?\\"utc\\": ?\\")2', r"\g<1>1", text)


def first_stamp_altered(text: str) -> str:
    return re.sub(r'(\\"minValues\\": ?\{[^}]*?\\"stamp_ns\\": ?)5', r"\g<1>4", text)


def time_in_the_footer_altered(place: Place) -> None:
    """Of the file's own statistics, by which readers leave out rows."""
    file = place.files()[0]
    last = pq.read_table(file, partitioning=None)["utc"].cast(pa.int64()).to_pylist()[-1]
    content = file.read_bytes()
    begin = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    footer = content[begin:].replace(last.to_bytes(8, "little"), (last - 50_000).to_bytes(8, "little"))
    assert footer != content[begin:]
    file.write_bytes(content[:begin] + footer)


def log_rolled_back(place: Place) -> None:
    place.log()[-1].unlink()


def log_entry_missing(place: Place) -> None:
    place.log()[1].unlink()


def first_log_entry_missing(place: Place) -> None:
    place.log()[0].unlink()


def log_missing(place: Place) -> None:
    shutil.rmtree(place.log()[0].parent)


def table_missing(place: Place) -> None:
    shutil.rmtree(place.store / "labels")


def table_begun_anew(place: Place) -> None:
    shutil.rmtree(place.store / "telemetry")
    record(place.url, place.spool)


def store_missing(place: Place) -> None:
    shutil.rmtree(place.store)


def receipt_altered(place: Place) -> None:
    file = place.spool / RECEIPTS
    file.write_text(file.read_text().replace('"rows":100', '"rows":101', 1))


def receipt_removed(place: Place) -> None:
    file = place.spool / RECEIPTS
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:1] + lines[2:]))


def pinned_file_deleted(place: Place) -> None:
    store = Store(place.url)
    pin(store, "events", store.table("events").version(), "walking-1")
    [only, *_] = place.files("events")
    compact(store)
    only.unlink()


def pin_damaged(place: Place) -> None:
    store = Store(place.url)
    pin(store, "telemetry/000", 1, "walking-1")
    [file] = (place.store / "pins").iterdir()
    file.write_text("{")


def retention_note_damaged(place: Place) -> None:
    file_deleted(place)
    retain(Store(place.url), [TELEMETRY], datetime(1970, 1, 2, tzinfo=UTC))
    [note] = (place.store / "retained").rglob("*.json")
    note.rename(note.with_name("x.json"))


def mended_note_damaged(place: Place) -> None:
    file_deleted(place)
    (place.store / "mended").mkdir()
    (place.store / "mended" / "x.json").write_bytes(b"\xff")


def without(name: str) -> Callable[[pa.Table], pa.Table]:
    return lambda rows: rows.drop_columns([name])


def numbers_as_text(rows: pa.Table) -> pa.Table:
    return retyped(rows, "seq", rows["seq"].cast(pa.string()))


def event_without_its_batch(place: Place) -> None:
    rewrite(place.files("events")[0], without("batch"))


def event_of_lists(place: Place) -> None:
    rewrite(place.files("events")[0], lambda rows: retyped(rows, "spool", pa.array([["a"]] * len(rows))))


def pinned_version_gone(place: Place) -> None:
    (place.store / "pins").mkdir()
    named = {"location": "telemetry/000", "version": 77, "by": "walking-1"}
    (place.store / "pins" / "1.json").write_text(json.dumps(named))


def receipts_cut_off(place: Place) -> None:
    file = place.spool / RECEIPTS
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:1]))


def receipts_deleted(place: Place) -> None:
    (place.spool / RECEIPTS).unlink()


def receipts_and_second_copies_deleted(place: Place) -> None:
    receipts_deleted(place)
    for file in place.spool.glob("0*.uploaded.db*"):
        file.unlink()


def receipts_deleted_and_collected_on(place: Place) -> None:
    receipts_deleted(place)
    record(place.url, place.spool)


def segment_damaged(place: Place) -> None:
    with Spool(place.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(7, 5))
        [number] = spool.waiting()
        with contextlib.closing(sqlite3.connect(spool.folder / f"{number:08}.db")) as database, database:
            database.execute("UPDATE run SET data = zeroblob(length(data))")
        with pytest.raises(Damaged):
            send(spool, number, Store(place.url))


def segment_unreadable(place: Place) -> None:
    (place.spool / "00000004.damaged.db").write_bytes(b"x" * 10_000)


def segment_removed(place: Place) -> None:
    for seq in (0, 1):
        with Spool(place.spool, reserve_bytes=0) as spool, Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(seq))
    (place.spool / "00000004.db").unlink()


def receipts_of_another_spool(place: Place) -> None:
    other = place.spool.with_name("other")
    for _ in range(3):
        record((place.spool.with_name("another")).as_uri(), other, "exo-09")
    (place.spool / RECEIPTS).write_bytes((other / RECEIPTS).read_bytes())


def id_of_another_spool(place: Place) -> None:
    (place.spool / "id").write_text("00000000-0000-4000-8000-000000000000\n")


def id_emptied(place: Place) -> None:
    (place.spool / "id").write_bytes(b"")


def id_garbled(place: Place) -> None:
    (place.spool / "id").write_bytes(b"\xff\n")


def loss_untold(place: Place) -> None:
    """The event goes that says what was lost."""
    segment_removed(place)
    assert "batch 4 of the spool" in place.told("upload")
    Store(place.url).table("events").delete("kind = 'lost'")


DAMAGES: list[tuple[Callable[[Place], None], str]] = [
    (file_deleted, "is not there, with 100 rows"),
    (file_cut_off, "bytes instead of"),
    (file_doubled, "100 rows more than the 100 that were sent: doubled (batch"),
    (row_removed, "1 of 100 rows are missing (batch 3 of "),
    (of_file(altered), "the 100 rows are not as they were sent: altered (batch"),
    (of_file(swapped), "altered (batch"),
    (of_file(misplaced), "altered (batch"),
    (of_file(nulled), "altered (batch"),
    (event_altered, "/events: the 2 rows are not as they were sent: altered (batch"),
    (in_the_log(unit_altered), f"{KNEE} is in deg there, and its values were sent in rad"),
    (in_the_log(column_removed), f"/telemetry/000 has no column {KNEE} any more"),
    (in_the_log(last_time_altered), "the table's log says that utc goes from "),
    (in_the_log(first_stamp_altered), "the table's log says that stamp_ns goes from 4"),
    (time_in_the_footer_altered, "its own statistics say that utc goes from "),
    (log_rolled_back, "/telemetry/000: 100 of 100 rows are missing (batch 3 of "),
    (log_entry_missing, "/telemetry/000"),
    (
        first_log_entry_missing,
        "00000000000000000000.json is missing, and was whole once: bring this file back",
    ),
    (log_missing, "/telemetry/000 has files and no _delta_log"),
    (table_missing, "/labels: 1 of 1 rows are missing (batch 1 of "),
    (table_begun_anew, "/telemetry/000: 100 of 100 rows are missing (batch 2 of "),
    (store_missing, "3 batches of the spool"),
    (receipt_altered, f"line 1 of the spool's {RECEIPTS} is not as it was written"),
    (receipt_removed, f"line 2 of the spool's {RECEIPTS} is not as it was written"),
    (pinned_file_deleted, "is not there, with 2 rows (needed by version 3, which walking-1 names)"),
    (pinned_version_gone, "(needed by version 77, which walking-1 names)"),
    (pin_damaged, "is damaged: bring it back from a copy of the store"),
    (retention_note_damaged, "retained/telemetry-000 has no time for a name"),
    (mended_note_damaged, "mended/x.json is damaged"),
    (of_file(without("seq")), "is not as it was written"),
    (of_file(without("connection")), "is not as it was written"),
    (of_file(numbers_as_text), "is not as it was written"),
    (event_without_its_batch, "is not as it was written"),
    (event_of_lists, "is not as it was written"),
    (receipts_cut_off, f"{RECEIPTS} has no receipt of the batches 2 to 3, which went to a store"),
    (receipts_deleted, f"{RECEIPTS} has no receipt of the batches 1 to 3, which went to a store"),
    (receipts_and_second_copies_deleted, f"{RECEIPTS} is not there, though the spool had the batches 1 to 3"),
    (receipts_deleted_and_collected_on, f"{RECEIPTS} has no receipt of the batches 1 to 3"),
    (segment_damaged, "00000004.damaged.db was set aside: 5 rows of exo-01, stream 1 from notification 7 on"),
    (segment_unreadable, "00000004.damaged.db was set aside: what batch 4 held is not in the store"),
    (segment_removed, "batch 4 of the spool"),
    (receipts_of_another_spool, f"{RECEIPTS} are of another spool"),
    (receipts_of_another_spool, f"{RECEIPTS} has no receipt of the batches 1 to 3, which went to a store"),
    (id_of_another_spool, "3 receipts in "),
    (id_emptied, "id is damaged: bring it back from a copy"),
    (id_garbled, "id is damaged: bring it back from a copy"),
    (loss_untold, "/events: 2 of 2 rows are missing (batch 4 of "),
]


@pytest.mark.parametrize(("damage", "told"), DAMAGES)
def test_each_damage_is_found_and_named(place: Place, damage: Callable[[Place], None], told: str) -> None:
    damage(place)
    status, problems = place.verify()
    assert status == 1
    assert told in problems


@pytest.mark.parametrize("damage", [log_entry_missing, first_log_entry_missing, log_missing])
def test_where_a_log_is_damaged_the_log_alone_is_named(place: Place, damage: Callable[[Place], None]) -> None:
    damage(place)
    assert len(place.verify()[1].splitlines()) == 1
    assert "telemetry/000" in place.told("compact")
    assert "telemetry/000" in place.told("upload") or place.verify()[0] == 1


def test_a_missing_file_is_named_once(place: Place) -> None:
    file_deleted(place)
    name = place.verify()[1].partition(" is not there")[0].rpartition("/")[2]
    assert place.verify()[1].count(name) == 1


@pytest.mark.parametrize("damage", [retention_note_damaged, mended_note_damaged])
def test_a_damaged_note_hides_no_other_damage(place: Place, damage: Callable[[Place], None]) -> None:
    damage(place)
    assert "is not there, with 100 rows" in place.verify()[1]


def test_what_lies_about_in_the_store_and_is_no_note_is_not_read(place: Place) -> None:
    for folder in ("retained/telemetry-000", "mended"):
        (place.store / folder).mkdir(parents=True)
        (place.store / folder / "notes.txt").write_text("junk")
    assert place.verify() == (0, "")


def test_a_spool_whose_name_cannot_be_read_is_refused_in_words(place: Place) -> None:
    (place.spool / "id").unlink()
    (place.spool / "id").mkdir()
    assert place.status("mend") == 2
    status, problems = place.verify()
    assert status == 2
    assert "the spool's name" in problems


def test_there_is_no_batch_0(place: Place) -> None:
    receipts_and_second_copies_deleted(place)
    assert "batch 0 " not in place.verify()[1]


def test_what_no_receipt_proves_is_counted_on_a_line_of_its_own(place: Place) -> None:
    shutil.rmtree(place.spool)
    record(place.url, place.spool)
    told = place.ask()
    assert (told["problems"], told["batches"], told["receipts"]) == ([], 1, 1)
    assert (told["rows"], told["rows_proven"]) == (420, 105)
    assert place.told().splitlines()[-1] == "315 of 420 rows are proven by no receipt here"


def test_what_is_missing_or_altered_is_not_called_unproven(place: Place) -> None:
    file_deleted(place)
    event_altered(place)
    assert "no receipt here" not in place.told()


def test_a_store_is_whole_however_its_files_were_put_together(place: Place) -> None:
    assert place.verify() == (0, "")
    store = Store(place.url)
    compact(store)
    vacuum(store, grace=timedelta(0))
    record(place.url, place.spool)
    assert place.verify() == place.verify("--quick") == place.verify("--deep") == (0, "")


def test_counting_alone_finds_what_is_missing_and_not_what_is_altered(place: Place) -> None:
    of_file(altered)(place)
    assert place.verify("--quick") == (0, "")
    row_removed(place)
    assert "1 of 100 rows are missing" in place.verify("--quick")[1]


def test_counting_alone_finds_a_row_that_is_there_twice_in_the_place_of_another(place: Place) -> None:
    of_file(lambda rows: rows.take(pa.array([0, 0, *range(2, len(rows))])))(place)
    assert "of the 100 rows some are missing and as many others doubled" in place.verify("--quick")[1]
    rewrite(
        place.files("events")[0], lambda rows: replaced(rows, "number", pa.array([7] * len(rows), pa.int64()))
    )
    assert "/events: of the 2 rows some are missing" in place.verify("--quick")[1]


def test_what_is_younger_than_retention_is_missed_also_of_a_batch_that_is_partly_older(place: Place) -> None:
    store = Store(place.url)
    rows = store.dataset("telemetry/000").to_table(columns=["robot", "utc"]).to_pylist()
    before = sorted(row["utc"] for row in rows if row["robot"] == "exo-02")[1]
    retain(store, [TELEMETRY], before)
    assert place.verify() == place.verify("--quick") == (0, "")
    Store(place.url).table("telemetry/000").delete("robot = 'exo-02' AND seq = 15 AND row = 1")
    assert "1 of " in place.verify()[1]
    assert "rows are missing (batch 3 of " in place.verify("--quick")[1]


def test_an_altered_value_is_found_in_what_retention_has_left_of_a_batch(place: Place) -> None:
    store = Store(place.url)
    rows = store.dataset("telemetry/000").to_table(columns=["robot", "utc"]).to_pylist()
    retain(store, [TELEMETRY], sorted(row["utc"] for row in rows if row["robot"] == "exo-02")[1])
    where = "robot = 'exo-02' AND seq = 15 AND row = 1"
    Store(place.url).table("telemetry/000").update(updates={f'"{KNEE}"': "7.0"}, predicate=where)
    assert "rows are not as they were sent: altered (batch 3 of " in place.verify()[1]


def without_what_is_new(place: Place) -> None:
    """Receipts as they were written before they had names, marks and units."""
    file, lines = place.spool / RECEIPTS, b""
    crc = 0
    for line in file.read_bytes().splitlines():
        told = json.loads(line)
        parts = [
            {name: value for name, value in part.items() if name not in ("names", "marks", "units")}
            for part in told["parts"]
        ]
        assert parts != told["parts"]
        body = json.dumps(
            {name: told[name] for name in ("writer", "batch", "url")} | {"parts": parts, "lost": []}
        )
        crc = zlib.crc32(body[1:].encode(), crc)
        lines += b'{"crc":"%08x",' % crc + body[1:].encode() + b"\n"
    file.write_bytes(lines)


def test_receipts_from_before_are_believed_and_prove_what_they_tell(place: Place) -> None:
    without_what_is_new(place)
    assert place.verify() == place.verify("--quick") == place.verify("--deep") == (0, "")
    record(place.url, place.spool)
    assert place.verify() == place.verify("--quick") == (0, "")
    of_file(altered)(place)
    row_removed(place)
    assert "altered (batch" in place.verify()[1]
    assert "1 of 100 rows are missing (batch 3 of " in place.verify()[1]


def test_a_unit_that_was_accepted_is_told_no_more(place: Place) -> None:
    in_the_log(unit_altered)(place)
    assert place.verify("--quick")[0] == 1
    place.told("mend", "--accept-loss", "--yes")
    assert place.verify() == (0, "")


def test_what_went_because_it_was_old_is_not_missed(place: Place, capsys: pytest.CaptureFixture[str]) -> None:
    store = Store(place.url)
    [middle] = pc.quantile(store.dataset("telemetry/000").to_table()["utc"].cast(pa.int64()), 0.5).to_pylist()
    retain(store, [TELEMETRY, RESOURCES], datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=middle))
    assert 0 < store.dataset("telemetry/000").count_rows() < 300
    assert place.verify() == (0, "")
    retain(store, [TABLES["labels"]], datetime.now(UTC) + timedelta(days=1))
    assert place.verify() == (0, "")
    row_removed(place)
    Store(place.url).table("events").delete()
    assert "/events: 2 of 2 rows are missing" in place.verify()[1]


def test_a_batch_that_could_not_be_read_is_told_until_somebody_has_removed_it(place: Place) -> None:
    with Spool(place.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(7, 5))
        (place.spool / "00000004.db").write_bytes(b"x" * 10_000)
        with pytest.raises(Damaged):
            send(spool, 4, Store(place.url))
    status, problems = place.verify()
    assert status == 1
    assert "00000004.damaged.db was set aside: the spool's file" in problems
    (place.spool / "00000004.damaged.db").unlink()
    assert place.verify() == (0, "")


def test_what_went_to_another_store_is_not_missed_here(place: Place, tmp_path: Path) -> None:
    record((tmp_path / "other").as_uri(), place.spool)
    assert place.verify() == (0, "")
    assert place.verify((tmp_path / "other").as_uri()) == (0, "")


def test_a_store_that_was_moved_and_then_lost_is_missed(place: Place) -> None:
    old, moved = place.url, place.store.with_name("moved")
    assert "files copied" in place.told("upload", moved.as_uri(), "--from", old)
    assert place.verify(moved.as_uri()) == (0, "")
    shutil.rmtree(moved)
    assert "there is no store" in place.verify(moved.as_uri())[1]
    assert "3 batches of the spool" in place.verify(f"{moved.as_uri()}/")[1]
    record(moved.as_uri(), place.spool, "exo-07")
    assert "/telemetry/000: 100 of 100 rows are missing (batch 1 of " in place.verify(moved.as_uri())[1]
    assert place.verify(old)[1].count("rows are missing") == 0


@pytest.mark.parametrize("spelled", ["{}/", "{}/.", "%73tore"])
def test_a_store_is_the_same_however_its_url_is_spelled(place: Place, spelled: str) -> None:
    url = spelled.format(place.url) if "{" in spelled else place.url.removesuffix("store") + spelled
    shutil.rmtree(place.store)
    assert "3 batches of the spool" in place.verify(url)[1]


def test_a_loss_whose_event_has_gone_is_told_again(place: Place) -> None:
    loss_untold(place)
    place.told("upload")
    assert "rows are missing" not in place.verify()[1]
    events = Store(place.url).dataset("events").to_table()
    assert events["kind"].to_pylist().count("lost") == 2


def test_a_loss_whose_event_retention_has_removed_is_not_told_again(place: Place) -> None:
    segment_removed(place)
    place.told("upload")
    retain(Store(place.url), [TABLES["events"]], datetime.now(UTC))
    place.told("upload")
    assert len(Store(place.url).dataset("events").to_table()) == 0


def test_where_the_spool_is_gone_nobody_can_judge_and_files_alone_are_looked_at_by_url(place: Place) -> None:
    shutil.rmtree(place.spool)
    status, problems = place.verify()
    assert status == 2
    assert "there is no spool at" in problems
    assert place.verify(place.url) == (0, "")


def test_a_batch_that_goes_to_the_store_while_somebody_looks_is_no_problem(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(place.url, place.spool, sent=False)
    listed = verify.receipts_of

    def late(spool: Path) -> Any:
        found = listed(spool)
        with Spool(place.spool, reserve_bytes=0) as opened:
            for number in opened.waiting():
                send(opened, number, Store(place.url))
        return found

    monkeypatch.setattr(verify, "receipts_of", late)
    assert list(verify.batches_missing(Store(place.url), place.spool)) == []


def test_a_second_copy_that_goes_while_somebody_looks_is_no_problem(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = spooled.uploaded

    def late(spool: Path) -> list[int]:
        found = listed(spool)
        (spool / "00000001.uploaded.db").unlink(missing_ok=True)
        return found

    monkeypatch.setattr(spooled, "uploaded", late)
    assert place.verify() == (0, "")


def test_where_nobody_can_look_the_exit_status_says_so(place: Place, tmp_path: Path) -> None:
    assert place.verify((tmp_path / "nothing").as_uri())[0] == 2
    assert main(["cloud", "verify", "--config", str(tmp_path / "nothing.toml")]) == 2
    (place.store / "store.json").write_text("{")
    assert place.verify()[0] == 2


def test_vacuum_tells_of_files_that_were_there_and_are_not(place: Place) -> None:
    store = Store(place.url)
    compact(store)
    [gone, *_] = [file for file in place.files("events") if len(pq.read_table(file, partitioning=None)) == 2]
    gone.unlink()
    before = set(store.objects.names(""))
    told = vacuum(store, grace=timedelta(0), dry_run=True)
    assert vacuum(store, grace=timedelta(0)) == told
    parquet = {name for name in before - set(store.objects.names("")) if name.endswith(".parquet")}
    assert parquet == set(told) != set()


def test_whoever_meets_a_missing_file_is_told_what_helps(place: Place) -> None:
    file_deleted(place)
    said = place.told("compact") + place.told("mend", "--dry-run")
    place.rename_back("00000001", "00000002", "00000003")
    record(place.url, place.spool, sent=False)
    upload = place.told("upload")
    assert (place.spool / "00000004.uploaded.db").exists()
    assert "is not there; bring it back from a copy, or let gwrms cloud mend take it out" in upload
    assert "errno" not in said + upload
    place.told("mend")
    assert "nothing waits" in place.told("upload")
    assert place.verify() == (0, "")


def test_a_store_that_cannot_be_written_is_refused_in_words(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "cannot be written: run this as whom it belongs to" in place.told("compact")
