"""Compaction, retention and vacuum: fewer files, the same rows; what a model names stays readable."""

import threading
from datetime import UTC, datetime, timedelta

import pytest

from ml.store import NoSuchTable, Store
from ml.store.tables import TELEMETRY
from ml.store.upkeep import Compacted, Pin, compact, pin, pins, retain, unpin, vacuum
from tests.unit.store.test_store import HERE, numbers, telemetry

NOW = timedelta(0)


def filled(url: str, commits: int = 6, rows: int = 3) -> Store:
    store = Store(url)
    for sequence in range(commits):
        store.append(TELEMETRY, HERE, *telemetry(rows, sequence * rows), "spool-a", sequence + 1)
    return store


def test_compaction_leaves_every_row_and_fewer_files(store_url: str) -> None:
    store = filled(store_url)
    version = store.table(HERE).version()
    assert compact(store) == [Compacted(HERE, 6, 1)]
    assert numbers(store) == list(range(18))
    assert store.units(HERE)["left_knee.position"] == "rad"
    assert store.dataset(HERE, version).count_rows() == 18
    assert store.append(TELEMETRY, HERE, *telemetry(1, 18), "spool-a", 7)
    assert not Store(store_url).append(TELEMETRY, HERE, *telemetry(1, 18), "spool-a", 7)


def test_vacuum_keeps_what_is_pinned_until_it_is_unpinned(store_url: str) -> None:
    store = filled(store_url)
    old = store.table(HERE).version()
    pin(store, HERE, old, "gait-3")
    pin(store, HERE, old, "gait-3")
    assert pins(store) == [Pin(HERE, old, "gait-3")]
    compact(store)
    assert vacuum(store, grace=NOW) == []
    assert store.dataset(HERE, old).to_table().num_rows == 18
    unpin(store, HERE, old, "gait-3")
    assert len(vacuum(store, grace=NOW)) == 6
    assert numbers(store) == list(range(18))


def test_vacuum_leaves_files_that_somebody_may_still_read(store_url: str) -> None:
    store = filled(store_url)
    compact(store)
    assert vacuum(store) == []


def test_old_rows_go_and_new_ones_stay(folder_url: str) -> None:
    store = filled(folder_url)
    before = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=7)
    assert retain(store, [TELEMETRY], before) == {HERE: 7}
    assert numbers(store) == list(range(7, 18))
    with pytest.raises(ValueError, match="time zone"):
        retain(store, [TELEMETRY], datetime(2026, 1, 1))  # noqa: DTZ001


def test_a_version_that_is_not_there_cannot_be_pinned(folder_url: str) -> None:
    with pytest.raises(NoSuchTable):
        pin(filled(folder_url, 1), HERE, 99, "gait-3")


def test_a_version_whose_files_are_gone_cannot_be_pinned(store_url: str) -> None:
    store = filled(store_url)
    old = store.table(HERE).version()
    compact(store)
    newest = store.table(HERE).version()
    vacuum(store, grace=NOW)
    whole = rf"6 of the files of version {old} no more: .*the versions {newest} to \d+ can be pinned"
    with pytest.raises(NoSuchTable, match=whole):
        pin(store, HERE, old, "gait-3")
    assert pins(store) == []
    pin(store, HERE, newest, "gait-3")
    assert store.dataset(HERE, newest).to_table().num_rows == 18


def test_compaction_disturbs_nobody_who_writes(store_url: str) -> None:
    filled(store_url, 4)

    def write() -> None:
        store = Store(store_url)
        for sequence in range(1, 9):
            store.append(TELEMETRY, HERE, *telemetry(2, 100 * sequence), "spool-b", sequence)

    writer = threading.Thread(target=write)
    writer.start()
    compact(Store(store_url))
    writer.join()
    compact(Store(store_url))
    assert len(numbers(Store(store_url))) == 4 * 3 + 8 * 2
