"""Whatever is done to a store or to a spool's receipts, `gwrms cloud verify` finds it and names it."""

import json
import os
import shutil
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
from ml.store.upkeep import compact, retain, vacuum
from server_gui.core.cloud import spool_reader, verify
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.receipts import RECEIPTS
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.cloud.damages import (
    DAMAGES,
    KNEE,
    Place,
    altered,
    event_altered,
    file_deleted,
    first_log_entry_missing,
    in_the_log,
    log_entry_missing,
    log_missing,
    loss_untold,
    mended_note_damaged,
    of_file,
    receipts_and_second_copies_deleted,
    replaced,
    retention_note_damaged,
    rewrite,
    row_removed,
    segment_removed,
    unit_altered,
)
from tests.unit.cloud.recordings import record
from tests.unit.recording.robots import batch


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
    listed = spool_reader.uploaded

    def late(spool: Path) -> list[int]:
        found = listed(spool)
        (spool / "00000001.uploaded.db").unlink(missing_ok=True)
        return found

    monkeypatch.setattr(spool_reader, "uploaded", late)
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
