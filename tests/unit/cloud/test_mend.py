"""What the spool still has of a damaged store is brought again by `gwrms cloud mend`, also cut off."""

import contextlib
import shutil
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from ml.store import Store, mending
from ml.store.errors import StoreError
from ml.store.tables import TELEMETRY
from ml.store.upkeep import compact, retain
from server_gui.core.cloud import mend, verify
from server_gui.core.cloud.repeated_upload import Again
from server_gui.core.recording.receipts import RECEIPTS, Receipts
from server_gui.core.recording.spool import Spool
from tests.unit.cloud.damages import (
    Place,
    altered,
    event_without_its_batch,
    file_doubled,
    numbers_as_text,
    of_file,
    receipt_altered,
    receipt_removed,
    row_removed,
    without,
)
from tests.unit.cloud.recordings import record

KEYS = ("robot", "session", "connection", "stream", "seq", "row")


def rows(url: str) -> list[tuple[object, ...]]:
    found = Store(url).dataset("telemetry/000").to_table(columns=list(KEYS))
    return sorted(zip(*(found[name].to_pylist() for name in KEYS), strict=True))


def file_gone(place: Place) -> None:
    place.files()[0].unlink()


def file_cut_off(place: Place) -> None:
    file = place.files()[0]
    file.write_bytes(file.read_bytes()[:-100])


def values_zeroed(place: Place) -> None:
    file = place.files()[0]
    content = file.read_bytes()
    file.write_bytes(content[:4] + bytes(1000) + content[1004:])


def event_file_gone(place: Place) -> None:
    place.files("events")[1].unlink()


def everything_gone(place: Place) -> None:
    shutil.rmtree(place.store)


def about_gone(place: Place) -> None:
    (place.store / "store.json").unlink()


def second_copies_gone(place: Place) -> None:
    for file in (*place.spool.glob("0*.uploaded.db*"), *place.files()):
        file.unlink()


def receipts_gone(place: Place) -> None:
    (place.spool / RECEIPTS).unlink()


def receipts_cut_off(place: Place) -> None:
    file = place.spool / RECEIPTS
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:1]))


@pytest.mark.parametrize(
    "damage",
    [
        file_gone,
        file_cut_off,
        values_zeroed,
        event_file_gone,
        everything_gone,
        about_gone,
        receipts_gone,
        receipts_cut_off,
        of_file(without("seq")),
        of_file(numbers_as_text),
        event_without_its_batch,
    ],
)
def test_what_was_damaged_is_whole_again(place: Place, damage: Callable[[Place], None]) -> None:
    before = rows(place.url)
    damage(place)
    assert "gwrms cloud mend" in place.told() or "mend" in place.told("mend", "--dry-run")
    place.told("mend")
    assert place.verify("--deep") == (0, "")
    assert rows(place.url) == before
    assert "nothing to mend" in place.told("mend")
    compact(Store(place.url))
    assert record(place.url, place.spool).robot == "exo-01"
    assert place.verify() == (0, "")


def test_the_same_loss_twice_is_mended_twice(place: Place) -> None:
    before = rows(place.url)
    for _ in range(2):
        for file in place.files():
            file.unlink()
        assert "would be brought again" in place.told("mend", "--dry-run")
        place.told("mend")
        assert place.verify() == (0, "")
        assert rows(place.url) == before


def telemetry_gone(place: Place) -> None:
    for file in place.store.glob("telemetry/000/robot=*/**/*.parquet"):
        file.unlink()


def test_of_a_batch_that_retention_has_cut_in_two_the_rest_is_brought_again(place: Place) -> None:
    receipts = Receipts(place.spool / RECEIPTS).whole()
    _, middle, *_ = (part for each in receipts for part in each.parts if part.stream)
    [mark, *_] = middle.marks
    retain(
        Store(place.url), [TELEMETRY], datetime.fromtimestamp(0, UTC) + timedelta(microseconds=mark.from_us)
    )
    before = rows(place.url)
    telemetry_gone(place)
    place.told("mend")
    assert rows(place.url) == before
    assert place.verify() == (0, "")


def test_what_retention_has_removed_is_not_brought_again_where_nobody_can_count_it(place: Place) -> None:
    times = sorted(Store(place.url).dataset("telemetry/000").to_table()["utc"].to_pylist())
    retain(Store(place.url), [TELEMETRY], times[len(times) // 2])
    before = rows(place.url)
    telemetry_gone(place)
    assert "stays in its table" in place.told("mend")
    place.told("mend", "--accept-loss", "--yes")
    assert rows(place.url) == before
    assert place.verify() == (0, "")


def test_what_is_still_there_of_a_damaged_file_is_kept_and_noted(place: Place) -> None:
    file_cut_off(place)
    [damaged, *_] = place.files()
    content = damaged.read_bytes()
    place.told("mend")
    [kept] = (place.store / "mended").rglob("*.parquet")
    assert (kept.name, kept.read_bytes()) == (damaged.name, content)
    [note], _ = mending.taken_out(Store(place.url))
    assert (note.rows, note.robot) == (100, "exo-01")
    assert "100 rows in 1 file were taken out" in place.told()


def test_cut_off_anywhere_it_goes_on(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    before = rows(place.url)
    for file in place.files():
        file.unlink()
    for module, name in ((mending, "_let_go"), (mend, "_bring")):
        with monkeypatch.context() as cut:
            cut.setattr(module, name, _ends)
            assert "cut off here" in place.told("mend")
    place.told("mend")
    assert place.verify() == (0, "")
    assert rows(place.url) == before


@contextlib.contextmanager
def _steps(count: int) -> Iterator[Callable[[int], object]]:
    yield lambda _: None


def _ends(*_: object, **__: object) -> None:
    raise StoreError("cut off here")


def test_what_no_second_copy_has_is_told(place: Place) -> None:
    (place.spool / "00000002.uploaded.db").unlink()
    for file in place.files():
        file.unlink()
    assert "the spool has no second copy of batch 2" in place.told("mend")
    status, problems = place.verify()
    assert status == 1
    assert "100 of 100 rows are missing (batch 2 of" in problems
    assert "batch 1" not in problems


def test_beside_a_collector_nothing_is_done(place: Place) -> None:
    file_gone(place)
    with Spool(place.spool, reserve_bytes=0):
        assert "end it first" in place.told("mend")
    assert "is not there" in place.verify()[1]


def test_after_it_a_table_in_a_bucket_is_whole(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    before = rows(store_url)
    [path] = [file.path for file in recorded.store.objects.listing("telemetry") if "session=" in file.path]
    recorded.store.objects.remove(path)
    with Spool(recorded.spool, reserve_bytes=0) as spool:
        store = Again.existing(store_url)
        found = mend.plan(store, spool, _steps)
        assert not mend.mend(store, spool, found, lambda _: None).problems
    assert rows(store_url) == before


def test_while_a_listing_is_late_nothing_is_taken_out(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Again.existing(place.url)
    [file, *_] = place.files()
    monkeypatch.setattr(mending, "_move", lambda *_: None)
    [wanted] = [each for each in verify.files(store) if each.path.endswith(file.name)]
    moved = file.rename(file.with_name("elsewhere"))
    monkeypatch.setattr(store.objects, "find", lambda path: object())
    with pytest.raises(StoreError, match="try again later"):
        mending.take_out(store, [wanted], lambda _: None)
    moved.rename(file)
    assert len(rows(place.url)) == 300


@pytest.mark.parametrize(
    "damage",
    [row_removed, of_file(altered), file_doubled, receipt_altered, receipt_removed, second_copies_gone],
)
def test_a_loss_that_is_accepted_is_told_no_more(place: Place, damage: Callable[[Place], None]) -> None:
    damage(place)
    for copy in place.spool.glob("0*.uploaded.db*"):
        copy.unlink()
    assert place.verify()[0] == 1
    assert "mend" in place.told("mend", "--accept-loss", "--yes") or place.verify() == (0, "")
    assert place.verify() == (0, "")
    record(place.url, place.spool)
    assert place.verify() == (0, "")


def test_receipts_that_were_altered_stay_beside(place: Place) -> None:
    receipt_altered(place)
    known = (place.spool / RECEIPTS).read_text()
    assert f"bring {place.spool / RECEIPTS} back from a copy" in place.told()
    place.told("mend", "--accept-loss", "--yes")
    [beside] = place.spool.glob(f"{RECEIPTS}.*.damaged")
    assert beside.read_text().startswith(known)


def test_what_waits_is_mentioned_and_cron_hears_nothing(place: Place) -> None:
    record(place.url, place.spool, sent=False)
    assert "not uploaded yet, and not looked at: batch 4 of the spool" in place.told()
    assert place.told("verify", "--quiet") == ""


def test_an_upload_begins_no_store_anew_in_the_place_of_one_that_is_gone(place: Place) -> None:
    record(place.url, place.spool, sent=False)
    everything_gone(place)
    assert "though 3 batches of the spool" in place.told("upload")
    assert not place.store.exists()
    place.told("mend")
    assert "1 batch uploaded" in place.told("upload")
    assert place.verify() == (0, "")


def test_days_that_are_none_are_refused_in_words(place: Place, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        place.told("retain", "--days", "x")
    assert "'x' is no number of days: write a number from 0 to" in capsys.readouterr().err


def test_what_waits_to_be_uploaded_again_is_not_called_lost(place: Place) -> None:
    for file in place.files():
        file.unlink()
    place.rename_back("00000002")
    assert "second copy" not in place.told("mend")
    assert "1 batch uploaded" in place.told("upload")
    assert place.verify() == (0, "")
