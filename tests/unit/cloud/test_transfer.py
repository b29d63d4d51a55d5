"""A store copied to another place, from and to a folder and an S3 server; broken off, and gone on with."""

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from ml.store import NoSuchTable, Store, StoreError, UnsafeStore
from ml.store.objects import Object, Objects
from ml.store.sessions import find, sessions, telemetry
from ml.store.tables import EVENTS, TELEMETRY, field
from ml.store.upkeep import Pin, compact, pin, pins
from server_gui.core.cloud import partial_copy, transfer
from server_gui.core.cloud.transfer import Copied
from tests.stores import SeaweedFS
from tests.unit.cloud.recordings import BATCHES, ROWS, record
from tests.unit.store.test_access import fake_s3  # noqa: F401  # a fixture

KNEE = "left_knee.position"
ROW = EVENTS.rows([{"robot": "exo-01", "kind": "marker"}])


def copy(source: str, target: str, advance: Callable[[int], object] = lambda _: None) -> Copied:
    from_, to = Objects(source), Objects(target)
    return transfer.copy(from_, to, transfer.missing(from_, to), advance)


def values(store: Store, session: str) -> list[tuple[int, float]]:
    found = telemetry(store, find(store, session), [KNEE])
    return [(row["stamp_ns"], row[KNEE]) for table in found for row in table.to_pylist()]


@pytest.fixture
def way(new_store_url: str, tmp_path: Path) -> list[str]:
    """From a folder to the store under test, and from there to another folder."""
    return [(tmp_path / "from").as_uri(), new_store_url, (tmp_path / "to").as_uri()]


def test_a_copy_is_the_same_store_with_its_pins_and_what_was_appended(way: list[str], tmp_path: Path) -> None:
    recorded = record(way[0], tmp_path / "spool")
    version = recorded.store.table("events").version()
    pin(recorded.store, "events", version, "gait-3")
    recorded.store.append(EVENTS, "events", ROW.schema, ROW.to_reader, "spool-x", 1)
    compact(recorded.store)
    for source, target in itertools.pairwise(way):
        copy(source, target)
        copied = Store.existing(target)
        assert values(copied, recorded.session) == values(recorded.store, recorded.session)
        assert pins(copied) == [Pin("events", version, "gait-3")]
        assert copied.dataset("events", version).count_rows() == 2
        assert not Store(target).append(EVENTS, "events", ROW.schema, ROW.to_reader, "spool-x", 1)


def test_a_second_copy_brings_only_what_is_new(way: list[str], tmp_path: Path) -> None:
    sessions = [record(way[0], tmp_path / "one").session]
    for source, target in itertools.pairwise(way):
        copy(source, target)
        assert copy(source, target) == Copied()
    sessions.append(record(way[0], tmp_path / "two").session)
    for source, target in itertools.pairwise(way):
        done = copy(source, target)
        assert (done.by_checksum, done.by_size) == (2 * 4, 0)  # a file and a log entry of each table
        assert [len(values(Store.existing(target), session)) for session in sessions] == [BATCHES * ROWS] * 2


def test_a_copy_that_was_broken_off_is_no_store_until_it_is_gone_on_with(
    way: list[str], tmp_path: Path
) -> None:
    recorded = record(way[0], tmp_path / "spool")
    for source, target in itertools.pairwise(way):
        wanted = len(transfer.missing(Objects(source), Objects(target)))
        pieces = itertools.count(1)

        def cut(_: int, last: int = wanted - 2, pieces: Iterator[int] = pieces) -> None:
            if next(pieces) == last:  # in the middle of the logs
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            copy(source, target, cut)
        with pytest.raises(NoSuchTable):
            Store.existing(target)
        assert len(transfer.missing(Objects(source), Objects(target))) <= 4
        copy(source, target)
        assert values(Store.existing(target), recorded.session) == values(recorded.store, recorded.session)


def test_a_large_file_goes_on_in_its_middle(
    store_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ml.store.objects.PIECE_BYTES", 1_000)
    monkeypatch.setattr("server_gui.core.cloud.transfer.PIECE_BYTES", 1_000)
    source, target = Objects(store_url), Objects((tmp_path / "copy").as_uri())
    content = bytes(range(256)) * 16
    source.create("table/large", content)
    [large] = [found for found in source.listing() if found.path == "table/large"]
    arrived = 0

    def cut(count: int) -> None:
        nonlocal arrived
        arrived += count
        if arrived == 3_000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        transfer.copy(source, target, [large], cut)
    assert target.read("table/large") is None
    read: list[int] = []

    def counted(self: Objects, found: Object, offset: int = 0) -> Iterator[bytes]:
        read.append(offset)
        return pieces(self, found, offset)

    pieces = Objects.pieces
    monkeypatch.setattr(Objects, "pieces", counted)
    transfer.copy(source, target, [large], lambda _: None)
    assert target.read("table/large") == content
    assert read[0] >= 2_000
    assert target.names("table") == ["table/large"]


@pytest.mark.parametrize("backend", ["s3"], indirect=True)
@pytest.mark.parametrize("direction", ["up", "down"])
def test_what_is_altered_on_its_way_is_noticed(
    backend: SeaweedFS, store_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, direction: str
) -> None:
    content = b"values" * 1000
    ends = Objects(store_url), Objects((tmp_path / "folder").as_uri())
    source, target = ends if direction == "down" else ends[::-1]
    source.create("table/file", content)
    [found] = [each for each in source.listing() if each.path == "table/file"]
    with monkeypatch.context() as network:
        if direction == "down":
            network.setattr(Objects, "pieces", _altered_once(Objects.pieces))
        else:
            write = Objects.write
            network.setattr(
                Objects, "write", lambda self, path, pieces: write(self, path, map(_altered, pieces))
            )
        with pytest.raises(StoreError, match="altered on its way"):
            transfer.copy(source, target, [found], lambda _: None)
    assert target.read("table/file") is None
    transfer.copy(source, target, [found], lambda _: None)
    assert target.read("table/file") == content


def _altered(piece: bytes) -> bytes:
    return piece.replace(b"v", b"w", 1)


def _altered_once(pieces: Callable[..., Iterator[bytes]]) -> Callable[..., Iterator[bytes]]:
    times = iter([_altered])

    def made(*arguments: Any) -> Iterator[bytes]:
        return map(next(times, bytes), pieces(*arguments))

    return made


def test_a_place_where_something_else_was_written_is_refused(store_url: str, tmp_path: Path) -> None:
    target = (tmp_path / "folder").as_uri()
    record(store_url, tmp_path / "one")
    record(target, tmp_path / "two")
    before = Objects(target).names("")
    with pytest.raises(StoreError, match="something else was written there"):
        copy(store_url, target)
    assert Objects(target).names("") == before


@pytest.mark.parametrize("other", [b"as long", b"or of another length"])
@pytest.mark.parametrize("path", ["models/serving/falling/_all/000001.json", "pins/0123.json"])
def test_another_pointer_or_pin_by_the_same_name_is_refused(
    store_url: str, tmp_path: Path, path: str, other: bytes
) -> None:
    source, target = Objects(store_url), Objects((tmp_path / "folder").as_uri())
    source.create(path, b"another")
    source.create("models/new/model.json", b"{}")
    target.create(path, other)
    with pytest.raises(StoreError, match=f"has other contents than .* in {path}: nothing was copied"):
        copy(store_url, target.url)
    assert target.read(path) == other
    assert target.names("") == [path]


def test_sessions_are_copied_alone_with_everything_that_belongs_to_them(
    store_url: str, tmp_path: Path
) -> None:
    first = record(store_url, tmp_path / "one")
    second = record(store_url, tmp_path / "two", "exo-02")
    target = Store((tmp_path / "part").as_uri())
    wanted = [find(first.store, first.session)]
    for again in (BATCHES * ROWS, 0):  # the second time it is there
        assert partial_copy.copy(first.store, target, wanted, (), lambda _: None) == again
        assert [session.session for session in sessions(target)] == [first.session]
        assert values(target, first.session) == values(first.store, first.session)
        assert target.dataset("events").count_rows() == 2
        assert target.dataset("labels").count_rows() == 1
        assert target.units("telemetry/000")[KNEE] == "rad"
    partial_copy.copy(first.store, target, [find(first.store, second.session)], {"exo-02"}, lambda _: None)
    assert sorted(session.robot for session in sessions(target)) == ["exo-01", "exo-02"]
    assert target.dataset("events").count_rows() == 4


def all_of(source: Store, target: Store, robot: str = "exo-01") -> int:
    return partial_copy.copy(source, target, sessions(source, robot), {robot}, lambda _: None)


def test_a_robots_rows_of_two_stores_come_together_in_one_folder(store_url: str, tmp_path: Path) -> None:
    first = record(store_url, tmp_path / "one")
    second = record((tmp_path / "second").as_uri(), tmp_path / "two")
    target = Store((tmp_path / "both").as_uri())
    for again in (BATCHES * ROWS, 0):
        assert [all_of(each.store, target) for each in (first, second)] == [again, again]
        assert {each.session for each in sessions(target)} == {first.session, second.session}
        for each in (first, second):
            assert values(target, each.session) == values(each.store, each.session)
        assert target.dataset("labels").count_rows() == 2
        assert target.dataset("events").count_rows() == 4


def test_what_came_later_is_added_to_a_copy_of_a_robot(folder_url: str, tmp_path: Path) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    target = Store((tmp_path / "part").as_uri())
    all_of(recorded.store, target)
    rows = EVENTS.rows([{"robot": "exo-01", "session": recorded.session, "kind": "marker"}])  # of no spool
    recorded.store.append(EVENTS, "events", rows.schema, rows.to_reader, "spool-x", 1)
    for _ in range(2):
        all_of(recorded.store, target)
        assert target.dataset("events").count_rows() == 3


@pytest.mark.parametrize(
    ("table", "change", "named"),
    [
        ("labels", {"label": "'sit'"}, "labels has other contents .* batch 1, number"),
        ("sessions", {"began": "began + INTERVAL 1 DAY"}, "sessions has other contents"),
        ("telemetry/000", {f'"{KNEE}"': f'"{KNEE}" + 1'}, "telemetry has other contents .* seq 0, row 0"),
    ],
)
def test_other_contents_by_the_same_name_are_refused_and_nothing_is_copied(
    folder_url: str, tmp_path: Path, table: str, change: dict[str, str], named: str
) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    record(folder_url, tmp_path / "later")
    target = Store((tmp_path / "part").as_uri())
    partial_copy.copy(recorded.store, target, [find(recorded.store, recorded.session)], (), lambda _: None)
    target.table(table).update(change)
    before = {name: target.table(name).version() for name in ("sessions", "labels", "telemetry/000")}
    with pytest.raises(StoreError, match=named):
        all_of(recorded.store, target)
    assert {name: target.table(name).version() for name in before} == before


def test_a_column_of_another_unit_is_refused(folder_url: str, tmp_path: Path) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    target = Store((tmp_path / "part").as_uri())
    degrees = pa.schema([*TELEMETRY.schema, field(KNEE, pa.float64(), "°")])
    target.append(TELEMETRY, "telemetry/000", degrees, lambda: iter(()), "spool-x", 1)
    with pytest.raises(StoreError, match=rf"has {KNEE} in °, and .* in rad: copy to a folder of its own"):
        all_of(recorded.store, target)


@pytest.mark.usefixtures("fake_s3")
def test_a_copy_goes_nowhere_where_several_servers_would_overwrite_each_other(
    folder_url: str, tmp_path: Path
) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    with pytest.raises(UnsafeStore):
        transfer.open_target(recorded.store, "s3://bucket/x")
    alone = Store((tmp_path / "alone").as_uri(), several_writers=False)
    assert transfer.open_target(alone, "s3://bucket/x").url == "s3://bucket/x"
