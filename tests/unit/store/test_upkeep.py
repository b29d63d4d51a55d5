"""Compaction, retention and vacuum: fewer files, the same rows; what a model names stays readable."""

import contextlib
import threading
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import cast

import msgspec
import pytest
from deltalake import DeltaTable
from pyarrow.dataset import field

from ml.store import NoSuchTable, Store, StoreError, durable
from ml.store.compaction_lock import COUNTS, PLACE, Claim, alone
from ml.store.objects import Object
from ml.store.tables import EVENTS, TELEMETRY
from ml.store.upkeep import GRACE, Compacted, Pin, compact, pin, pins, retain, unpin, vacuum
from tests.unit.store.test_store import HERE, numbers, telemetry

NOW = timedelta(0)
LONG_AGO = datetime(2026, 1, 1, tzinfo=UTC)


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


def test_of_several_pinned_versions_each_stays_readable(folder_url: str) -> None:
    store = filled(folder_url)
    versions = [store.table(HERE).version()]
    compact(store)
    store.append(TELEMETRY, HERE, *telemetry(3, 100), "spool-b", 1)
    versions.append(store.table(HERE).version())
    for version in versions:
        pin(store, HERE, version, "gait-3")
    compact(store)
    vacuum(store, grace=NOW)
    assert [store.dataset(HERE, version).to_table().num_rows for version in versions] == [18, 21]


@pytest.mark.parametrize("grace", [GRACE, timedelta(minutes=10)])
def test_vacuum_leaves_files_that_somebody_may_still_read(store_url: str, grace: timedelta) -> None:
    store = filled(store_url)
    compact(store)
    assert vacuum(store, grace=grace) == []


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


def test_a_version_that_is_emptied_while_it_is_pinned_is_not_pinned(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = filled(folder_url)
    old = store.table(HERE).version()
    compact(store)
    create = store.objects.create

    def late(path: str, data: bytes) -> bool:
        vacuum(Store(folder_url), grace=NOW)
        return create(path, data)

    monkeypatch.setattr(store.objects, "create", late)
    with pytest.raises(NoSuchTable, match="6 of the files"):
        pin(store, HERE, old, "gait-3")
    assert pins(store) == []


class Overtaken(Store):
    """A store in which others are always faster, some times."""

    def __init__(self, url: str, times: int, others: Callable[[int], object]) -> None:
        super().__init__(url)
        self._left = times
        self._others = others

    def table(self, location: str, version: int | None = None) -> DeltaTable:
        found = super().table(location, version)
        if location == HERE and self._left:
            self._left -= 1
            self._others(self._left)
        return found


def test_old_rows_go_also_while_others_write(folder_url: str) -> None:
    filled(folder_url)

    def write(left: int) -> None:
        Store(folder_url).append(TELEMETRY, HERE, *telemetry(1, 100 + left), "spool-b", 10 - left)

    before = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=7)
    retain(Overtaken(folder_url, 4, write), [TELEMETRY], before)
    assert numbers(Store(folder_url)) == [*range(7, 18), 100, 101, 102, 103]


def test_small_files_are_put_together_also_while_old_rows_go(folder_url: str) -> None:
    filled(folder_url)

    def remove(left: int) -> None:
        before = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=10 - left)
        retain(Store(folder_url), [TELEMETRY], before)

    compact(Overtaken(folder_url, 4, remove))
    assert numbers(Store(folder_url)) == list(range(10, 18))


def test_two_that_put_files_together_at_once_double_no_row(store_url: str) -> None:
    filled(store_url)
    refused: list[str] = []

    def other(left: int) -> None:
        if not left:  # the table is open for the compaction now
            with pytest.raises(StoreError, match="is being compacted by another") as error:
                compact(Store(store_url))
            refused.append(str(error.value))

    compact(Overtaken(store_url, 2, other))
    assert len(refused) == 1
    assert numbers(Store(store_url)) == list(range(18))
    assert compact(Store(store_url)) == [Compacted(HERE, 1, 1)]


def test_what_a_killed_compaction_has_left_is_in_nobodys_way_for_ever(store_url: str) -> None:
    store = filled(store_url)
    path = f"{PLACE}/{HERE.replace('/', '-')}.json"
    left = Claim("somebody", datetime.now(UTC) + timedelta(hours=1))
    store.objects.create(path, msgspec.json.encode(left))
    if store.folder is None:
        with pytest.raises(StoreError, match=f"remove the object {path}"):
            compact(store)
        store.objects.remove(path)
        store.objects.create(path, msgspec.json.encode(Claim("somebody", left.until - COUNTS)))
    assert compact(store) == [Compacted(HERE, 6, 1)]


class Elsewhere:
    """Objects of a store that is in no folder; `before` happens once, before the first create or remove."""

    def __init__(self) -> None:
        self.url, self.folder, self.objects = "s3://lab", None, self
        self.held: dict[str, bytes] = {}
        self.before: Callable[[], object] = lambda: None

    def read(self, path: str) -> bytes | None:
        return self.held.get(path)

    def find(self, path: str) -> Object | None:
        return Object(path, len(self.held[path]), LONG_AGO, "") if path in self.held else None

    def create(self, path: str, data: bytes) -> bool:
        self._happen()
        return self.held.setdefault(path, data) is data

    def remove(self, path: str) -> None:
        self._happen()
        self.held.pop(path, None)

    def _happen(self) -> None:
        happens, self.before = self.before, lambda: None
        happens()


@pytest.mark.parametrize("left", [b"", b"no claim", b'{"who":"a/b","until":"2026-01-01T00:00:00Z"}'])
@pytest.mark.parametrize("goes", [False, True])
def test_of_two_that_find_a_dead_compaction_one_goes_on(left: bytes, goes: bool) -> None:
    """The other begins, or begins and ends, between the look and the claim of the first."""
    objects = Elsewhere()
    store = cast("Store", objects)
    objects.held[f"{PLACE}/t.json"] = left
    with contextlib.ExitStack() as others:

        def other() -> None:
            if goes:
                with alone(store, "t"):
                    pass
            others.enter_context(alone(store, "t"))

        objects.before = other
        with pytest.raises(StoreError, match="is being compacted by another"), alone(store, "t"):
            pytest.fail("two are in the table")
        with pytest.raises(StoreError, match="is being compacted by another"), alone(store, "t"):
            pytest.fail("two are in the table")
    assert objects.held == {}
    with alone(store, "t"):
        assert len(objects.held) == 1
    assert objects.held == {}


def test_two_that_remove_old_rows_at_once_double_no_row(folder_url: str) -> None:
    filled(folder_url)

    def other(left: int) -> None:
        if not left:
            retain(Store(folder_url), [TELEMETRY], datetime.fromtimestamp(0, UTC) + timedelta(microseconds=8))

    retain(
        Overtaken(folder_url, 2, other),
        [TELEMETRY],
        datetime.fromtimestamp(0, UTC) + timedelta(microseconds=7),
    )
    assert numbers(Store(folder_url)) == list(range(8, 18))


def test_who_is_always_overtaken_says_so(folder_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ml.store.upkeep.ATTEMPTS", 3)
    filled(folder_url)
    after = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=7)

    def write(left: int) -> None:
        Store(folder_url).append(TELEMETRY, HERE, *telemetry(1, 100 + left), "spool-b", 100 - left)

    with pytest.raises(StoreError, match="was changed meanwhile, 3 times; try again later"):
        retain(Overtaken(folder_url, 99, write), [TELEMETRY], after)


def test_what_goes_while_it_is_synchronised_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A draft of another writer's, as it is in a log for a moment."""
    monkeypatch.setattr(Path, "exists", lambda _: True)
    durable.synchronise([tmp_path / "00000000000000000007.json#1"])


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


@pytest.mark.parametrize("is_compacted_meanwhile", [False, True])
def test_what_retention_leaves_in_a_file_is_found_by_its_texts(
    new_store_url: str, is_compacted_meanwhile: bool
) -> None:
    """Of several robots; where somebody compacts just then, the next compaction does it."""
    store, began_ns = Store(new_store_url), 1_795_000_000_000_000_000
    named = {"session": "s", "kind": "marker", "text": "x", "spool": "w", "batch": 1}
    times_ns = [began_ns + number * 10**9 for number in range(4)]
    rows = EVENTS.rows(
        [
            {**named, "robot": robot, "utc": utc_ns, "number": number}
            for number, (robot, utc_ns) in enumerate(zip("abcd", times_ns, strict=True))
        ]
    )
    store.append(EVENTS, EVENTS.name, rows.schema, lambda: iter(rows.to_batches()), "w", 1)
    with alone(store, EVENTS.name) if is_compacted_meanwhile else contextlib.nullcontext():
        assert retain(store, [EVENTS], datetime.fromtimestamp(times_ns[1] / 1e9, UTC)) == {"events": 1}
    if is_compacted_meanwhile:
        compact(store, [EVENTS])
    found = [store.dataset(EVENTS.name).count_rows(filter=field("robot") == name) for name in "abcd"]
    assert found == [0, 1, 1, 1]
