"""A store with the spool that it was recorded in, and what may happen to them."""

import contextlib
import json
import re
import shutil
import sqlite3
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from gateway.main import main
from ml.store import Store
from ml.store.tables import TELEMETRY
from ml.store.upkeep import compact, pin, retain
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.receipts import RECEIPTS
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.cloud.recordings import record
from tests.unit.recording.robots import batch

KNEE = "left_knee.position"


def fill(folder: Path) -> None:
    """Record what a place is about."""
    for robot in ("exo-01", "exo-01", "exo-02"):
        record((folder / "store").as_uri(), folder / "spool", robot)


class Place:
    """A store in a folder, the spool that filled it in three batches, and the command that looks."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.store, self.spool = folder / "store", folder / "spool"
        self._config = folder / "server.toml"
        self._config.write_text(
            f'[store]\nurl = "{self.store.as_uri()}"\n[recorder]\nspool = "{self.spool}"\n'
        )
        self._capsys = capsys

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
