"""A store, the same on a folder and on an S3 server: appended once, whoever repeats what."""

import itertools
from collections.abc import Iterator
from typing import Any

import pyarrow as pa
import pytest

from ml.store import NoSuchTable, Store, StoreError, StoreUnreachable
from ml.store.objects import Objects
from ml.store.store import Batches
from ml.store.tables import EVENTS, TELEMETRY, field

HERE = TELEMETRY.location("exo-01", 1)
EVERY = 5  # commits, of which a checkpoint is made here


def telemetry(rows: int, begin: int = 0, **channels: str | None) -> tuple[pa.Schema, Batches]:
    """Rows of one robot, with these channels in these units; channel values are the row's number."""
    names = channels or {"left_knee.position": "rad"}
    schema = pa.schema(
        [*TELEMETRY.schema, *(field(name, pa.float64(), unit) for name, unit in names.items())]
    )
    numbers = list(range(begin, begin + rows))
    columns = {
        "robot": pa.repeat("exo-01", rows),
        "session": pa.repeat("s-1", rows),
        "utc": pa.array(numbers, pa.int64()).cast(pa.timestamp("us", "UTC")),
        "connection": pa.repeat("c-1", rows),
    }
    arrays = [
        columns.get(
            name.name, pa.array(numbers, pa.int64()).cast(name.type) if name.name not in columns else None
        )
        for name in schema
    ]
    batch = pa.record_batch(arrays, schema=schema)

    def batches() -> Iterator[pa.RecordBatch]:
        return iter([batch])

    return schema, batches


def numbers(store: Store, column: str = "stamp_ns") -> list[int | None]:
    values: list[int | None] = store.dataset(HERE).to_table(columns=[column]).column(0).to_pylist()
    return sorted(values, key=lambda value: -1 if value is None else value)


def test_a_repeated_append_changes_nothing(store_url: str) -> None:
    store = Store(store_url)
    assert store.append(TELEMETRY, HERE, *telemetry(5), "spool-a", 1)
    assert not store.append(TELEMETRY, HERE, *telemetry(5), "spool-a", 1)
    again = Store(store_url)
    assert not again.append(TELEMETRY, HERE, *telemetry(5), "spool-a", 1)
    assert again.append(TELEMETRY, HERE, *telemetry(5, 5), "spool-a", 2)
    assert not again.append(TELEMETRY, HERE, *telemetry(5), "spool-a", 1)
    assert again.append(TELEMETRY, HERE, *telemetry(2, 10), "spool-b", 1)
    assert numbers(again) == list(range(12))


def test_two_that_append_the_same_with_an_old_view_do_it_once(store_url: str) -> None:
    stores = [Store(store_url), Store(store_url)]
    for store in stores:
        store.append(TELEMETRY, HERE, *telemetry(1), "spool-a", 1)  # both have the table open now
    appended = [store.append(TELEMETRY, HERE, *telemetry(3, 1), "spool-a", 2) for store in stores]
    assert appended == [True, False]
    assert numbers(stores[0]) == [0, 1, 2, 3]


def test_an_append_whose_answer_is_lost_is_there_once(
    store_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    commit = Store._commit

    def lost(*given: Any) -> None:
        commit(*given)
        raise OSError("timed out")

    with monkeypatch.context() as broken:
        broken.setattr(Store, "_commit", lost)
        with pytest.raises(StoreUnreachable, match="timed out"):
            Store(store_url).append(TELEMETRY, HERE, *telemetry(3), "spool-a", 1)
    assert not Store(store_url).append(TELEMETRY, HERE, *telemetry(3), "spool-a", 1)
    assert numbers(Store(store_url)) == [0, 1, 2]


@pytest.mark.parametrize("unit", ["°", None])
def test_a_column_that_another_has_just_added_in_another_unit_is_refused(
    store_url: str, unit: str | None
) -> None:
    stores = [Store(store_url), Store(store_url)]
    for number, store in enumerate(stores):
        store.append(TELEMETRY, HERE, *telemetry(1), f"spool-{number}", 1)  # both have the table open now
    stores[0].append(TELEMETRY, HERE, *telemetry(1, 1, tilt="rad"), "spool-0", 2)
    with pytest.raises(StoreError, match=f"has tilt in rad, and it was to be written in {unit or 'no unit'}"):
        stores[1].append(TELEMETRY, HERE, *telemetry(1, 2, tilt=unit), "spool-1", 2)
    assert stores[1].units(HERE)["tilt"] == "rad"
    assert stores[1].append(TELEMETRY, HERE, *telemetry(1, 2, tilt="rad"), "spool-1", 2)


def test_new_channels_become_columns_and_keep_their_units(store_url: str) -> None:
    store = Store(store_url)
    store.append(TELEMETRY, HERE, *telemetry(2), "spool-a", 1)
    store.append(
        TELEMETRY,
        HERE,
        *telemetry(2, 2, **{"trunk.tilt_side": "rad", "left_insole.force": "N"}),
        "spool-a",
        2,
    )
    store.append(TELEMETRY, HERE, *telemetry(1, 4), "spool-a", 3)
    assert numbers(store, "left_insole.force") == [None, None, None, 2, 3]
    assert numbers(store, "left_knee.position") == [None, None, 0, 1, 4]
    for units in (store.units(HERE), Store(store_url).units(HERE)):
        assert units["left_insole.force"] == "N"
        assert units["trunk.tilt_side"] == "rad"
        assert units["stamp_ns"] == "ns"
        assert units["robot"] is None


def test_two_writers_that_bring_new_columns_at_once_both_succeed(store_url: str) -> None:
    stores = [Store(store_url), Store(store_url)]
    for name, store in zip("ab", stores, strict=True):
        store.append(TELEMETRY, HERE, *telemetry(1), f"spool-{name}", 1)
    for name, store in zip("ab", stores, strict=True):
        store.append(TELEMETRY, HERE, *telemetry(1, 1, **{f"{name}.force": "N"}), f"spool-{name}", 2)
    assert numbers(stores[0]) == [0, 0, 1, 1]
    assert {"a.force", "b.force"} <= set(stores[1].units(HERE))


def test_an_old_version_can_be_read_as_it_was(store_url: str) -> None:
    store = Store(store_url)
    store.append(TELEMETRY, HERE, *telemetry(2), "spool-a", 1)
    version = store.table(HERE).version()
    store.append(TELEMETRY, HERE, *telemetry(2, 2), "spool-a", 2)
    assert store.dataset(HERE, version).count_rows() == 2
    assert store.dataset(HERE).count_rows() == 4


def test_a_table_that_nobody_wrote_is_named(store_url: str) -> None:
    store = Store(store_url)
    with pytest.raises(NoSuchTable, match=f"{store_url}/events"):
        store.dataset("events")
    assert store.units("events") == {}
    store.append(TELEMETRY, HERE, *telemetry(2), "spool-a", 1)
    with pytest.raises(NoSuchTable):
        store.table(HERE, version=99)


def test_after_many_commits_there_is_a_checkpoint_and_every_row(
    store_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ml.store.store.CHECKPOINT_EVERY", EVERY)
    store = Store(store_url)
    data = EVENTS.rows([{"robot": "exo-01", "utc": 1_000_000, "kind": "marker", "number": 0}])
    for sequence in range(1, EVERY + 3):
        store.append(EVENTS, "events", data.schema, data.to_reader, "spool-a", sequence)
    assert any(name.endswith(".checkpoint.parquet") for name in store.objects.names("events/_delta_log"))
    assert Store(store_url).dataset("events").count_rows() == EVERY + 2
    assert Store(store_url).table("events").transaction_version("spool-a") == EVERY + 2


def test_what_a_store_was_made_with_stays(new_store_url: str) -> None:
    assert Store(new_store_url, shards=4).about.shards == 4
    assert Store(new_store_url).about.shards == 4
    assert TELEMETRY.locations(4) == [f"telemetry/{shard:03}" for shard in range(4)]
    spread = {TELEMETRY.location(f"exo-{robot}", 4) for robot in range(50)}
    assert spread == set(TELEMETRY.locations(4))


def test_a_store_for_one_writer_takes_no_second(new_store_url: str) -> None:
    Store(new_store_url, several_writers=False)
    with pytest.raises(StoreError, match="for one writer alone"):
        Store(new_store_url)


@pytest.mark.parametrize(("content", "said"), [(b'{"format": 2}', "has format 2"), (b"{", "is damaged")])
def test_a_store_of_a_newer_format_or_damaged_is_refused(
    new_store_url: str, content: bytes, said: str
) -> None:
    Objects(new_store_url).create("store.json", content)
    with pytest.raises(StoreError, match=said):
        Store(new_store_url)


def test_objects_are_created_once_read_listed_and_removed(store_url: str) -> None:
    objects = Store(store_url).objects
    assert objects.create("pins/a", b"1")
    assert not objects.create("pins/a", b"2")
    assert objects.read("pins/a") == b"1"
    assert objects.names("pins") == ["pins/a"]
    for _ in range(2):
        objects.remove("pins/a")
    assert objects.read("pins/a") is None


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("s3://key:secret@bucket/x", "no keys in it"),
        ("s3://bucket/x?secret=1", "no keys in it"),
        ("http://somewhere/x", "is no store"),
        ("/srv/store", "is no store"),
        ("file://host/x", "is no store"),
        ("file:x", "is no store"),
        ("s3:/bucket/x", "is no store"),
        ("s3://", "is no store"),
    ],
)
def test_a_url_that_is_no_store_is_refused_in_words(url: str, said: str) -> None:
    with pytest.raises(StoreError, match=said) as refused:
        Store(url)
    assert "secret" not in str(refused.value)


def test_rows_that_are_none_of_the_table_are_refused() -> None:
    with pytest.raises(ValueError, match="has no colour"):
        EVENTS.rows([{"colour": 1}])
    with pytest.raises(ValueError, match="not a row of the table events"):
        EVENTS.rows([{"kind": 1}])
    assert set(
        itertools.chain.from_iterable(row.items() for row in EVENTS.rows([{"kind": "x"}]).to_pylist())
    ) >= {
        ("kind", "x"),
        ("utc", None),
    }


def test_what_does_not_fit_a_table_is_refused_before_anything_is_written(store_url: str) -> None:
    store = Store(store_url)
    store.append(TELEMETRY, HERE, *telemetry(2), "spool-a", 1)
    kept = store.objects.names(HERE)
    schema, batches = telemetry(2, 2)
    at = schema.get_field_index("left_knee.position")
    text = schema.set(at, pa.field("left_knee.position", pa.string()))
    with pytest.raises(StoreError, match=r"has left_knee\.position of another type"):
        store.append(TELEMETRY, HERE, text, batches, "spool-a", 2)
    (batch,) = batches()
    mixed = pa.record_batch([pa.array(["exo-01", "exo-02"]), *batch.columns[1:]], schema=schema)
    with pytest.raises(StoreError, match="rows of one robot, session only"):
        store.append(TELEMETRY, HERE, schema, lambda: iter([mixed]), "spool-a", 2)
    assert store.objects.names(HERE) == kept


def test_any_name_can_be_a_partition(store_url: str) -> None:
    store = Store(store_url)
    schema, batches = telemetry(3)
    (batch,) = batches()
    named = pa.record_batch([pa.repeat("Ada's exo: ä/%20=1", 3), *batch.columns[1:]], schema=schema)
    store.append(TELEMETRY, HERE, schema, lambda: iter([named]), "spool-a", 1)
    found = Store(store_url).dataset(HERE).to_table(columns=["robot", "stamp_ns"])
    assert found.to_pylist() == [{"robot": "Ada's exo: ä/%20=1", "stamp_ns": number} for number in range(3)]
    assert store.table(HERE).to_pyarrow_table().num_rows == 3
