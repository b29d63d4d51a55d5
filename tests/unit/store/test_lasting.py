"""What is said to be in a folder lasts, with all that it builds on, also where others were killed before."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from ml.store import Store, StoreError, durable, upkeep
from ml.store.store import ABOUT
from ml.store.tables import EVENTS
from tests.unit.store.test_torn import append, cut, entry, log_of, row, texts

LONG_AGO = datetime(1970, 1, 1, tzinfo=UTC)


@pytest.fixture
def url(folder_url: str) -> str:
    for number in (1, 2, 3):
        assert append(folder_url, number)
    return folder_url


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> set[Path]:
    """What was synchronised since the test began."""
    found: set[Path] = set()
    sync = durable._sync

    def watch(path: Path) -> None:
        sync(path)
        found.add(path)

    monkeypatch.setattr(durable, "_sync", watch)
    return found
    return found


def tidied_and_killed(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compaction that the library has committed, and nobody has made to last."""
    with monkeypatch.context() as failing:
        failing.setattr(Store, "make_last", _no_disk)
        with pytest.raises(StoreError):
            upkeep.compact(Store(url), [EVENTS])


def _no_disk(*_: object, **__: object) -> None:
    raise OSError(5, "Input/output error")


def files(url: str) -> set[Path]:
    table = Path(urlsplit(url).path) / EVENTS.name
    return {table / each for each in Store(url).table(EVENTS.name).get_add_actions()["path"].to_pylist()}


def test_an_append_also_makes_last_what_it_builds_on(
    url: str, synced: set[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(url)
    found = row(4)
    assert store.append(EVENTS, EVENTS.name, found.schema, lambda: iter(found.to_batches()), "other", 1)
    tidied_and_killed(url, monkeypatch)
    [compacted] = files(url)
    synced.clear()
    found = row(5)
    assert store.append(EVENTS, EVENTS.name, found.schema, lambda: iter(found.to_batches()), "other", 2)
    assert synced >= {compacted, entry(url, 5), entry(url, 6)}
    assert durable.is_marked(entry(url, 5))


def test_nothing_is_removed_before_what_stands_for_it_lasts(
    url: str, synced: set[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    old = files(url)
    tidied_and_killed(url, monkeypatch)
    [compacted] = files(url)
    monkeypatch.setattr(Store, "mend", lambda *_: None)  # as where it is compacted after that
    synced.clear()
    sync = durable._sync

    def watch(path: Path) -> None:
        assert path != compacted or all(file.exists() for file in old)
        sync(path)

    monkeypatch.setattr(durable, "_sync", watch)
    assert len(upkeep.vacuum(Store(url), [EVENTS], timedelta(0))) == 3
    assert compacted in synced
    assert texts(url) == [1, 2, 3]


def test_a_vacuum_makes_its_own_entries_last(url: str) -> None:
    upkeep.compact(Store(url), [EVENTS])
    upkeep.vacuum(Store(url), [EVENTS], timedelta(0))
    assert len(list(log_of(url).glob("*.json"))) == 7
    assert all(map(durable.is_marked, log_of(url).glob("*.json")))


def test_a_copy_of_a_part_lasts(url: str, synced: set[Path]) -> None:
    before = files(url)
    synced.clear()
    Store(url).add(EVENTS, EVENTS.name, row(9).to_reader())
    assert synced >= files(url) - before


def test_no_checkpoint_is_made_before_the_log_lasts(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(durable, "make_last", _no_disk)
    monkeypatch.setattr(Store, "mend", lambda *_: None)
    with pytest.raises(StoreError, match="cannot be compacted"):
        upkeep.compact(Store(url), [EVENTS])
    assert not list(log_of(url).glob("*.parquet"))


def test_what_says_that_there_is_a_store_lasts_before_anything_is_built_on_it(
    folder_url: str, synced: set[Path]
) -> None:
    Store(folder_url)
    synced.clear()
    append(folder_url, 1)
    about = Path(urlsplit(folder_url).path) / ABOUT
    assert synced >= {about, about.parent}


def test_what_is_created_once_is_on_the_disk_whole_before_it_has_its_name(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    objects = Store(folder_url).objects
    with monkeypatch.context() as failing:
        failing.setattr(os, "fsync", _no_disk)
        with pytest.raises(StoreError, match="Input/output error"):
            objects.create("pins/a", b"1")
    assert objects.names("pins") == []
    assert objects.create("pins/a", b"2")


def test_a_draft_of_what_is_created_is_nobodys_object(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where its writer is killed."""
    monkeypatch.setattr(Path, "unlink", lambda *_, **__: None)
    upkeep.pin(Store(url), EVENTS.name, 3, "gait-3")
    assert len(list((Path(urlsplit(url).path) / "pins").iterdir())) == 2
    assert upkeep.pins(Store(url)) == [upkeep.Pin(EVENTS.name, 3, "gait-3")]


def test_a_pin_lasts(url: str, synced: set[Path]) -> None:
    upkeep.pin(Store(url), EVENTS.name, 3, "gait-3")
    [pin] = (Path(urlsplit(url).path) / "pins").iterdir()
    assert synced >= {pin, pin.parent}


def test_a_store_in_a_folder_with_a_space_is_one_too(tmp_path: Path, synced: set[Path]) -> None:
    url = (tmp_path / "my store").as_uri()
    assert append(url, 1)
    assert entry(url.replace("%20", " "), 1) in synced
    assert Store.existing(url).folder == tmp_path / "my store"


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99, None])
def test_a_compaction_whose_files_are_cut_off_is_set_aside(
    url: str, share: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    tidied_and_killed(url, monkeypatch)
    [compacted] = files(url)
    data = compacted.read_bytes()
    cut(compacted, bytes(len(data)) if share is None else data[: int(share * len(data))])
    cut(entry(url, 4), entry(url, 4).read_bytes())
    assert append(url, 4)
    assert texts(url) == [1, 2, 3, 4]


def test_a_compaction_that_nobody_disturbed_stays_where_its_end_was_killed(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    tidied_and_killed(url, monkeypatch)
    compacted = files(url)
    assert append(url, 4)
    assert texts(url) == [1, 2, 3, 4]
    assert compacted <= files(url)


def test_who_commits_is_not_taken_for_one_whom_a_power_cut_has_ended(url: str) -> None:
    store = Store(url)
    with store.unfinished(EVENTS.name):
        store.table(EVENTS.name).optimize.compact()
        [compacted] = files(url)
        data = compacted.read_bytes()
        cut(compacted, b"")
        cut(entry(url, 4), entry(url, 4).read_bytes())
        store.mend(EVENTS.name)
        compacted.write_bytes(data)
    assert texts(url) == [1, 2, 3]
    assert entry(url, 4).exists()
