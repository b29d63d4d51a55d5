"""SQL over a store: every table is one view, only what is needed is read, and nothing but the tables is."""

import datetime
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from ml.store import Store, StoreError, StoreRefused
from ml.store.query import QueryError, query
from ml.store.tables import EVENTS, TABLES, TELEMETRY, field
from tests.stores import KEY, SeaweedFS
from tests.support.waiting import until

HOUR_US = 3_600_000_000
ENDLESS = "SELECT count(*) FROM range(100000000000) numbers(n) WHERE n % 7 = 3"
SCHEMA = pa.schema([*TELEMETRY.schema, field("left_knee.position", pa.float64(), "rad")])


def fill(store: Store, robot: str, hours: int = 1, rows: int = 3) -> None:
    """A file an hour from 1970 on."""
    location = TELEMETRY.location(robot, store.about.shards)
    for hour in range(hours):
        numbers = range(hour * HOUR_US, hour * HOUR_US + rows)

        def batches(numbers: range = numbers) -> Iterator[pa.RecordBatch]:
            named = {"robot": robot, "session": "s-1", "connection": "c-1"}
            columns = [
                pa.repeat(named[each.name], rows) if each.name in named else pa.array(numbers).cast(each.type)
                for each in SCHEMA
            ]
            yield pa.record_batch(columns, schema=SCHEMA)

        store.append(TELEMETRY, location, SCHEMA, batches, robot, hour + 1)


def ask(store: Store, sql: str, robot: str | None = None) -> list[dict[str, Any]]:
    with query(store, sql, robot) as found:
        return [row for batch in found.batches for row in batch.to_pylist()]


def test_tables_are_views_and_a_table_that_nobody_wrote_is_empty(store_url: str) -> None:
    store = Store(store_url)
    fill(store, "exo-01", rows=5)
    found = ask(
        store, 'SELECT robot, max("left_knee.position") AS top, count(*) AS n FROM telemetry GROUP BY 1'
    )
    assert found == [{"robot": "exo-01", "top": 4.0, "n": 5}]
    assert ask(store, "SELECT * FROM labels") == []
    assert {row["name"] for row in ask(store, "SHOW TABLES")} == set(TABLES)
    [first] = ask(store, "SELECT utc FROM TELEMETRY ORDER BY seq LIMIT 1")
    assert first["utc"] == datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


def test_shards_are_one_table_and_a_robot_needs_only_its_own(folder_url: str) -> None:
    store = Store(folder_url, shards=4)
    robots = [f"exo-{number:02}" for number in range(8)]
    for robot in robots:
        fill(store, robot)
    found = ask(store, "SELECT robot, count(*) AS n FROM telemetry GROUP BY 1 ORDER BY 1")
    assert found == [{"robot": robot, "n": 3} for robot in robots]
    mine = TELEMETRY.location("exo-03", 4)
    assert store.folder is not None
    for location in set(TELEMETRY.locations(4)) - {mine}:
        for entry in (store.folder / location / "_delta_log").glob("*.json"):
            entry.write_text("damaged")
    assert ask(store, "SELECT DISTINCT robot FROM telemetry", "exo-03") == [{"robot": "exo-03"}]
    with pytest.raises(StoreError):
        ask(store, "SELECT DISTINCT robot FROM telemetry")


@pytest.mark.parametrize(
    "where",
    [
        "robot = 'exo-01' AND utc < '1970-01-01 00:30Z'",
        "utc >= '1970-01-01 00:00Z' AND utc < '1970-01-01 00:30Z'",
    ],
)
def test_files_of_other_robots_and_other_times_are_not_read(folder_url: str, where: str) -> None:
    store = Store(folder_url)
    fill(store, "exo-01", hours=3)
    assert store.folder is not None
    files = sorted(
        (store.folder / "telemetry/000").rglob("*.parquet"), key=lambda file: file.stat().st_mtime_ns
    )
    for file in files[1:]:
        file.unlink()
    assert ask(store, f"SELECT count(*) AS n FROM telemetry WHERE {where}") == [{"n": 3}]
    with pytest.raises(StoreError, match="cannot be read"):
        ask(store, 'SELECT sum("left_knee.position") FROM telemetry')


@pytest.mark.parametrize(
    "sql",
    [
        "DELETE FROM events",
        "CREATE TABLE mine (a INT)",
        "INSERT INTO events SELECT * FROM events",
        "UPDATE events SET text = ''",
        "SELECT 1; SELECT 2",
        "",
        "ATTACH '{file}' AS other",
        "COPY (SELECT 1) TO '{file}'",
        "SET threads = 1",
        "INSTALL httpfs",
        "LOAD httpfs",
        "PRAGMA database_list",
        "CALL pragma_version()",
        "EXPORT DATABASE '{file}'",
    ],
)
def test_whatever_does_more_than_read_is_refused(folder_url: str, tmp_path: Path, sql: str) -> None:
    file = tmp_path / "file"
    with pytest.raises(QueryError):
        ask(Store(folder_url), sql.format(file=file))
    assert not file.exists()


@pytest.mark.parametrize(
    "source",
    [
        "read_text('{file}')",
        "read_csv('{file}')",
        "'{file}'",
        "glob('{file}')",
        "read_blob('{file}')",
        "secret_rows",
    ],
)
def test_nothing_outside_the_store_can_be_read(folder_url: str, tmp_path: Path, source: str) -> None:
    file = tmp_path / "file.csv"
    file.write_text("secret\n1\n")
    secret_rows = pa.table({"a": [1]})
    assert secret_rows.num_rows == 1
    with pytest.raises(QueryError):
        ask(Store(folder_url), f"SELECT * FROM {source.format(file=file)}")


def test_errors_are_told_in_words_with_the_place(folder_url: str) -> None:
    store = Store(folder_url)
    fill(store, "exo-01")
    with pytest.raises(QueryError) as said:
        ask(store, "SELECT utc, nothing FROM telemetry")
    assert "nothing" in str(said.value)
    assert str(said.value).splitlines()[-2:] == [
        "LINE 1: SELECT utc, nothing FROM telemetry",
        " " * 20 + "^" * 7,
    ]
    with pytest.raises(QueryError, match='in double quotes, "left_knee'):
        ask(store, "SELECT left_knee.position FROM telemetry")
    with pytest.raises(QueryError, match="Could not convert"):
        ask(store, "SELECT CAST(connection AS INT) FROM telemetry")


def test_a_robots_name_cannot_leave_its_quotes(folder_url: str) -> None:
    store = Store(folder_url)
    data = EVENTS.rows([{"robot": "o'hara", "kind": "marker"}, {"robot": "exo-01", "kind": "marker"}])
    store.append(EVENTS, "events", data.schema, data.to_reader, "spool-a", 1)
    assert [row["robot"] for row in ask(store, "SELECT robot FROM events", "o'hara")] == ["o'hara"]
    assert ask(store, "SELECT robot FROM events", "' OR '1'='1") == []


@pytest.fixture
def heeds_ctrl_c() -> Iterator[None]:
    """A process that was started in the background ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeds_ctrl_c")
def test_ctrl_c_ends_a_query_that_takes_long(folder_url: str) -> None:
    def runs() -> bool:
        return any(thread.name == "query" and thread.is_alive() for thread in threading.enumerate())

    def press() -> None:
        until(runs, "the query runs")
        os.kill(os.getpid(), signal.SIGINT)

    presser = threading.Thread(target=press)
    presser.start()
    with pytest.raises(KeyboardInterrupt):
        ask(Store(folder_url), ENDLESS)
    presser.join()
    assert not runs()


@pytest.mark.parametrize("begun", [True, False])
def test_ctrl_c_while_the_query_starts_leaves_no_thread(
    folder_url: str, monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    start = threading.Thread.start

    def pressed(thread: threading.Thread) -> None:
        if begun:
            start(thread)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", pressed)
        with pytest.raises(KeyboardInterrupt):
            ask(Store(folder_url), ENDLESS)
    assert all(thread.name != "query" for thread in threading.enumerate())


def test_python_reads_no_file_for_arrow(store_url: str) -> None:
    """It would still be asked to when the process ends, and hang or crash then."""
    store = Store(store_url)
    fill(store, "exo-01")
    kinds = {fragment.filesystem.type_name for fragment in store.dataset("telemetry/000").get_fragments()}
    assert kinds
    assert all(not kind.startswith("py") for kind in kinds)


@pytest.mark.parametrize("backend", ["s3"], indirect=True)
def test_keys_that_may_not_read_the_files_are_refused_in_words(
    backend: SeaweedFS, store_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(store_url)
    fill(store, "exo-01")
    with monkeypatch.context() as wrong:
        wrong.setenv("AWS_SECRET_ACCESS_KEY", "wJalrXUtnFEMI-example-secret")
        assert store.files.type_name  # connected with these
    with pytest.raises(StoreRefused, match="check AWS_PROFILE") as said:
        ask(store, "SELECT * FROM telemetry")
    assert KEY not in str(said.value)
    assert "wJalrXUtnFEMI" not in str(said.value)
