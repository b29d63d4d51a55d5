"""`gwrms cloud mend` takes nothing out that it cannot bring again, and brings nothing twice."""

import shutil
import sqlite3
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.fs
import pytest

from ml.store import Store, damage, mending
from ml.store.errors import StoreError, StoreRefused, StoreUnreachable
from ml.store.files import filesystem
from ml.store.tables import TELEMETRY
from ml.store.upkeep import compact, retain
from server_gui.core.cloud import row_counting
from server_gui.core.recording.receipts import RECEIPTS
from tests.unit.cloud.damages import Place, altered, fill, of_file, rewrite
from tests.unit.cloud.recordings import record
from tests.unit.cloud.test_mend import file_cut_off, rows

LATER: tuple[type[StoreError], ...] = (StoreUnreachable, StoreRefused)


def fails(error: type[StoreError]) -> Callable[..., object]:
    def fail(*_: object, **__: object) -> object:
        raise error("not now")

    return fail


def test_a_store_below_any_folder_is_read(
    store_libraries: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "a b" / "jürgen" / "100%"
    folder.mkdir(parents=True)
    fill(folder)
    place = Place(folder, capsys)
    assert place.verify("--deep") == (0, "")
    assert "nothing to mend" in place.told("mend")


def test_what_one_way_of_reading_alone_does_not_find_stays(
    place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "empty").mkdir()
    files = place.files()
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr("ml.store.store.filesystem", lambda _: filesystem((tmp_path / "empty").as_uri()))
        status, problems = place.verify()
        assert status == 2
        assert "is not there" in problems
        assert place.status("mend") == 2
    assert place.files() == files
    assert place.verify() == (0, "")


@pytest.mark.parametrize("error", LATER)
@pytest.mark.parametrize(
    ("module", "function", "how"),
    [(damage, "footer", ""), (damage, "_decoded", "--deep"), (row_counting, "_rows", "")],
)
def test_a_store_that_fails_for_a_moment_is_not_called_damaged(
    place: Place,
    monkeypatch: pytest.MonkeyPatch,
    error: type[StoreError],
    module: object,
    function: str,
    how: str,
) -> None:
    files = place.files()
    with monkeypatch.context() as moment:
        moment.setattr(module, function, fails(error))
        status, problems = place.verify(*filter(None, [how]))
        assert status == 2
        assert "not now" in problems
        assert place.status("mend") == 2 or (module, function) == (damage, "footer")
    assert place.files() == files
    assert not (place.store / "mended").exists()
    assert place.verify() == (0, "")


def test_where_no_way_of_reading_works_nobody_can_say(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(damage, "footer", fails(StoreRefused))
    monkeypatch.setattr("ml.store.objects.Objects.pieces", fails(StoreRefused))
    assert place.verify()[0] == 2


def test_rows_of_which_the_store_knows_no_number_are_not_brought_twice(place: Place, tmp_path: Path) -> None:
    place.told("download", "--out", str(tmp_path / "copy"), "--robot", "exo-*")
    copy = (tmp_path / "copy").as_uri()
    (place.spool / RECEIPTS).unlink()
    for _ in range(2):
        place.told("mend", copy)
        assert rows(copy) == rows(place.url)
        assert place.verify(copy) == (0, "")


def test_of_a_part_copy_only_what_is_missing_is_brought(place: Place, tmp_path: Path) -> None:
    place.told("download", "--out", str(tmp_path / "copy"), "--robot", "exo-02")
    copy = (tmp_path / "copy").as_uri()
    (place.spool / RECEIPTS).unlink()
    place.told("mend", copy)
    assert rows(copy) == rows(place.url)
    assert place.verify(copy) == (0, "")


@pytest.mark.parametrize("part", [0.5, 1.0])
def test_what_retention_removed_does_not_come_back(place: Place, part: float) -> None:
    store = Store(place.url)
    times = store.dataset("telemetry/000").to_table()["utc"].cast(pa.int64())
    [last] = pc.quantile(times, part).to_pylist()
    retain(store, [TELEMETRY], datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=last + 1))
    before = rows(place.url)
    for file in place.files("events"):
        file.unlink()
    place.told("mend")
    assert rows(place.url) == before
    assert place.verify() == (0, "")


def events(place: Place) -> int:
    return len(Store(place.url).dataset("events").to_table())


def newest_events(place: Place) -> Path:
    """What compaction has made."""
    files = (file for file in place.files("events") if "_delta_log" not in file.parts)
    return max(files, key=lambda file: file.stat().st_mtime_ns)


def test_a_file_of_which_not_all_comes_back_stays_until_the_loss_is_accepted(place: Place) -> None:
    compact(Store(place.url))
    file = newest_events(place)
    content = file.read_bytes()
    file.write_bytes(bytes(len(content)))
    (place.spool / "00000001.uploaded.db").unlink()
    told = place.told("mend", "--dry-run"), place.told("mend")
    assert all(f"{file.name} is damaged or gone, and stays in its table" in each for each in told)
    assert not any("brought again" in each or "taken out of the store" in each for each in told)
    assert place.status("mend") == 1
    file.write_bytes(content)
    assert place.verify() == (0, "")

    file.write_bytes(bytes(len(content)))
    assert "brought again from the spool" in place.told("mend", "--accept-loss", "--yes")
    assert events(place) == 4
    assert place.verify() == (0, "")


def test_a_damaged_second_copy_brings_not_all_either(place: Place) -> None:
    file_cut_off(place)
    for copy in place.spool.glob("0*.uploaded.db"):
        with sqlite3.connect(copy) as database:
            database.execute(
                "UPDATE run SET data = zeroblob(length(data)) WHERE seq = (SELECT max(seq) FROM run)"
            )
    assert "stays in its table" in place.told("mend")
    assert place.files()[0].exists()


@pytest.mark.parametrize("damaged", [file_cut_off, lambda place: place.files()[0].unlink()])
def test_rows_of_another_collector_are_taken_out_only_where_their_loss_is_accepted(
    place: Place, damaged: Callable[[Place], None]
) -> None:
    shutil.rmtree(place.spool)
    record(place.url, place.spool, "exo-02")
    damaged(place)
    for _ in range(2):
        assert place.status("mend") == 1
        assert place.verify()[0] == 1
    place.told("mend", "--accept-loss", "--yes")
    assert place.verify() == (0, "")
    assert len(rows(place.url)) == 300


def test_beside_a_file_that_stays_everything_else_is_brought(place: Place) -> None:
    (place.spool / "00000003.uploaded.db").unlink()
    for file in place.files():
        file.unlink()
    told = place.told("mend")
    assert "2 files with 200 rows taken out" in told
    assert "the batches 1 to 2 brought again" in told
    assert "robot=exo-02" in place.verify()[1]
    assert "robot=exo-01" not in place.verify()[1]


def test_a_robot_may_have_any_name(place: Place) -> None:
    record(place.url, place.spool, "lab@exo:1+2 3%25")
    before = rows(place.url)
    compact(Store(place.url))
    for file in place.files():
        if "session=" in str(file):
            file.write_bytes(file.read_bytes()[:-100])
    place.told("mend")
    assert rows(place.url) == before
    assert place.verify() == (0, "")


def test_beside_an_altered_value_everything_else_is_brought_and_that_is_told(place: Place) -> None:
    of_file(altered)(place)
    for file in place.files("events"):
        file.unlink()
    told = place.told("mend")
    assert events(place) == 6
    assert "has other values in 1 of 100 rows" in told
    [number] = [number for number in (1, 2, 3) if f"batch {number}: " in told]
    brought = told.partition(" brought again")[0].splitlines()[-1]
    assert str(number) not in brought
    assert len(place.verify()[1].splitlines()) == 1


def test_a_row_in_whose_place_another_is_twice_is_brought(place: Place) -> None:
    before = rows(place.url)
    rewrite(place.files()[0], lambda found: found.take(pa.array([0, 0, *range(2, len(found))])))
    told = place.told("mend")
    assert "has 1 rows of this batch twice" in told
    assert sorted({*rows(place.url)}) == before
    assert "doubled" in place.verify()[1]


def test_a_damaged_note_of_what_went_stops_what_would_bring_it_back(place: Place) -> None:
    retain(Store(place.url), [TELEMETRY], datetime.now(UTC) + timedelta(days=1))
    [note] = (place.store / "retained").rglob("*.json")
    note.rename(note.with_name("x.json"))
    place.files("events")[0].unlink()
    assert place.status("mend") == 2
    assert rows(place.url) == []


def test_a_note_that_is_damaged_hides_no_other(place: Place) -> None:
    file_cut_off(place)
    place.told("mend")
    (place.store / "mended" / "x.json").write_bytes(b"\xff")
    found, problems = mending.taken_out(Store(place.url))
    assert len(found) == len(problems) == 1
