"""From the spool to the store: every row once, as it was; problems are told, and end."""

import contextlib
import errno
import os
import sqlite3
import threading
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from gateway.wire.resource import ResourceSnapshot
from ml.store import Store, StoreError, StoreUnreachable, durable
from ml.store.labels import Label
from ml.store.tables import TELEMETRY, ColumnFacts
from server_gui.core.recording.columns import Columns
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts, label
from server_gui.core.recording.rows import Layout, Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send, upload
from server_gui.core.recording.uploader import Uploader
from tests.support.waiting import WAIT_S, until
from tests.unit.recording.robots import CHANNELS, batch, description, stamp_ns, value

HERE = TELEMETRY.location("exo-01", 1)


def upload_all(spool: Spool, store: Store) -> None:
    for number in spool.waiting():
        segment = spool.read(number)
        upload(segment, spool.id, store)
        segment.close()


def test_every_row_arrives_with_its_values_units_and_times(spool: Spool, store_url: str) -> None:
    store = Store(store_url)
    with Recorder(spool) as recorder:
        recorder.describe("exo-01", description("exo-01"))
        for seq in range(30):
            sent = batch(seq, rows=2, missing=CHANNELS[1:2] if seq % 2 else ())
            recorder.record("exo-01", 7, sent, clock_offset_ns=0)
    upload_all(spool, store)
    upload_all(spool, Store(store_url))  # all of it again
    found = store.dataset(HERE).to_table()
    assert found.num_rows == 60
    for row in found.to_pylist():
        seq, number = row["seq"], row["row"]
        assert row["robot"] == "exo-01"
        assert row["stream"] == 7
        assert row["stamp_ns"] == stamp_ns(seq, number)
        assert row["left_knee.position"] == value(seq, number, 0)
        assert row["left_knee.velocity"] == (None if seq % 2 else value(seq, number, 1))
    assert store.units(HERE)["left_knee.velocity"] == "rad/s"
    between = found.column("utc").to_pylist()
    apart = {(b - a).total_seconds() for a, b in zip(between, between[2:], strict=False)}
    assert max(apart) == pytest.approx(0.01, abs=0.005)  # UTC goes as the robot's clock does


def test_every_table_gets_its_rows_once(spool: Spool, store_url: str, snapshot: ResourceSnapshot) -> None:
    store = Store(store_url)
    with Recorder(spool) as recorder:
        session = recorder.begin("exo-01", Facts(operator="Ada", units={"left_knee.position": "rad"}))
        recorder.resources("exo-01", snapshot)
        recorder.mark("exo-01", "stumbled")
        recorder.journal(
            "exo-01", [{"n": 1, "hash": "h", "utc_ns": 5_000, "who": "ada", "what": "write", "to": 3}]
        )
        recorder.add(label(Label("exo-01", session, 1_000, 2_000, "walking", "ada")))
        said = {"robot": "exo-01", "session": session, "utc": 1_000, "model": "activity-3", "label": "walk"}
        recorder.add(Record("predictions", said | {"probability": 0.75}))
    for _ in range(2):
        upload_all(spool, store)
    rows = {
        name: store.dataset(name).to_table().to_pylist()
        for name in ("sessions", "resources", "events", "journal", "labels", "predictions")
    }
    assert {name: len(found) for name, found in rows.items()} == Counter(rows.keys()) + Counter(["sessions"])
    assert [row["ended"] is None for row in rows["sessions"]] == [True, False]
    assert rows["resources"][0]["processes"][0]["memory_bytes"] == 4096
    assert rows["events"][0]["text"] == "stumbled"
    assert '"to":3' in rows["journal"][0]["entry"]
    assert rows["labels"][0]["ended"].microsecond == 2
    assert (rows["predictions"][0]["label"], rows["predictions"][0]["probability"]) == ("walk", 0.75)
    assert {row["spool"] for found in rows.values() for row in found} == {spool.writer}


@pytest.fixture
def snapshot() -> ResourceSnapshot:
    found = {
        "stamp_ns": 9,
        "cpu": {"percent": 12.5, "per_core": [20.0, None], "load": [0.1, 0.2, 0.3]},
        "memory": {"total": 10, "available": 6, "used": 4, "swap_used": 0},
        "gateway": {"cpu_percent": None, "rss_bytes": 9000},
        "processes": [{"pid": 1, "name": "init", "cpu_percent": 0.5, "memory_bytes": 4096}],
    }
    return msgspec.convert(found, ResourceSnapshot)


def test_robots_are_spread_over_the_shards(spool: Spool, folder_url: str) -> None:
    store = Store(folder_url, shards=3)
    robots = [f"exo-{number}" for number in range(12)]
    with Recorder(spool) as recorder:
        for robot in robots:
            recorder.record(robot, 1, batch(0))
    upload_all(spool, store)
    found = {
        location: store.dataset(location).to_table(columns=["robot"]).column(0).to_pylist()
        for location in TELEMETRY.locations(3)
    }
    assert sorted(robot for robots in found.values() for robot in robots) == sorted(robots)
    assert all(TELEMETRY.location(robot, 3) == location for location in found for robot in found[location])


def test_values_in_different_units_never_share_a_column(spool: Spool, folder_url: str) -> None:
    store = Store(folder_url)
    with Recorder(spool) as recorder:
        recorder.describe("exo-01", description("exo-01"))
        recorder.record("exo-01", 1, batch(0))
    upload_all(spool, store)
    columns = Columns([Layout(("left_knee.position", "left_knee.torque"), ("°", "N·m"))], store.columns(HERE))
    assert {"left_knee.position@°", "left_knee.torque"} <= set(columns.schema.names)
    assert "left_knee.position" not in columns.schema.names


def test_a_column_that_was_written_without_a_unit_takes_none_later() -> None:
    layouts = [Layout(("knee",), (unit,)) for unit in ("rad", "°", None)]
    assert Columns(layouts, {"knee": ColumnFacts()}).schema.names[-3:] == ["knee@rad", "knee@°", "knee"]
    assert Columns([Layout(("knee",), (unit,)) for unit in (None, "rad")], {}).schema.names[-1] == "knee"


@pytest.mark.parametrize(
    "channels", [("seq", "robot"), ("Utc",), ("a.b", "A.b"), ("a b", "a,b;{}()=", "a/b", "é"), ("`x`", '"x"')]
)
def test_no_name_of_a_channel_keeps_a_batch_from_the_store(
    spool: Spool, folder_url: str, channels: tuple[str, ...]
) -> None:
    store = Store(folder_url)
    for seq in range(2):  # the second time the columns are there already
        with Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(seq, channels=channels))
        upload_all(spool, store)
    table = store.dataset(HERE).to_table().sort_by("seq")
    found = {tuple(table[name].to_pylist()) for name in table.column_names[len(TELEMETRY.schema) :]}
    assert found == {tuple(value(seq, 0, c) for seq in range(2)) for c in range(len(channels))}


def test_the_uploader_empties_the_spool(spool: Spool, store_url: str) -> None:
    with Uploader(spool, lambda: Store(store_url)) as uploader:
        with Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(0))
        uploader.now()
        until(lambda: uploader.state.uploaded == 1)
        until(lambda: uploader.state.waiting == 0)
        assert uploader.state.problem is None
    assert spool.waiting() == []
    assert Store(store_url).dataset(HERE).count_rows() == 1


def test_a_store_that_cannot_be_reached_is_told_and_tried_again(spool: Spool, folder_url: str) -> None:
    reachable = threading.Event()

    def connect() -> Store:
        if not reachable.is_set():
            raise StoreUnreachable("no network")
        return Store(folder_url)

    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
    with Uploader(spool, connect) as uploader:
        until(lambda: uploader.state.problem == "no network")
        assert spool.waiting() == [1]
        reachable.set()
        uploader.now()
        until(lambda: uploader.state.uploaded == 1)
        assert uploader.state.problem is None


@pytest.mark.parametrize("part", ["header", "schema", "record", "run"])
def test_a_damaged_batch_keeps_none_after_it_from_the_store(
    spool: Spool, folder_url: str, part: str, caplog: pytest.LogCaptureFixture
) -> None:
    with Recorder(spool) as recorder:
        for seq in range(3):
            recorder.record("exo-01", 7, batch(seq))
            recorder.mark("exo-01", f"{seq}")
            recorder.cut(lambda: None)
            assert recorder.flush(WAIT_S)
    batches = len(spool.waiting())
    damage(spool.folder / "00000002.db", part)
    with Uploader(spool, lambda: Store(folder_url)) as uploader:
        assert uploader.drain(WAIT_S)
        assert [Path(file).name for file in uploader.state.damaged] == ["00000002.damaged.db"]
        assert uploader.state.uploaded == batches - 1
    assert "batch 2 is not uploaded as a whole: " in caplog.text
    texts = Store(folder_url).dataset("events").to_table()["text"].to_pylist()
    seqs = sorted(Store(folder_url).dataset(HERE).to_table()["seq"].to_pylist())
    lost, rows, kept = {
        "header": (["the spool's file "], ["0", "2"], [0, 2]),
        "schema": (["the spool's file "], ["0", "2"], [0, 1, 2]),  # its runs had gone before
        "record": (["row 0 of batch 2, of exo-01, from about 20"], ["0", "2"], [0, 1, 2]),
        "run": (["1 rows of exo-01, stream 7 from notification 1 on, were"], ["0", "1", "2"], [0, 2]),
    }[part]
    assert (sorted(text for text in texts if len(text) == 1), seqs) == (rows, kept)
    assert [text[: len(lost[0])] for text in texts if len(text) > 1] == lost


@pytest.mark.parametrize("column", ["data", "session", "layout.description"])
def test_one_flipped_bit_in_a_run_arrives_as_no_value_but_as_a_loss(
    spool: Spool, folder_url: str, column: str
) -> None:
    with Recorder(spool) as recorder:
        for seq in range(3):
            recorder.record("exo-01", 7, batch(seq, channels=CHANNELS[: seq + 1]))
    [number] = spool.waiting()
    flip(spool.folder / f"{number:08}.db", column)
    with pytest.raises(Damaged, match=r"1 rows of exo-01, stream 7 from notification 1 on, were damaged"):
        send(spool, number, Store(folder_url))
    assert [file.name for file in spool.damaged()] == [f"{number:08}.damaged.db"]
    store = Store(folder_url)
    assert sorted(store.dataset(HERE).to_table()["seq"].to_pylist()) == [0, 2]
    [lost] = [row for row in store.dataset("events").to_table().to_pylist() if row["kind"] == "lost"]
    assert (lost["robot"], msgspec.json.decode(lost["data"])) == (
        "exo-01",
        {"rows": 1, "stream": 7, "seq": 1},
    )


def test_a_segment_from_before_there_were_checksums_arrives(spool: Spool, folder_url: str) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 7, batch(0))
    with contextlib.closing(sqlite3.connect(spool.folder / "00000001.db")) as database, database:
        database.execute("ALTER TABLE run DROP COLUMN crc")
    send(spool, 1, Store(folder_url))
    assert Store(folder_url).dataset(HERE).to_table()["seq"].to_pylist() == [0]


def flip(file: Path, column: str) -> None:
    """One bit of the second run, in its middle; or of its layout."""
    table, _, column = column.rpartition(".")
    key, at = ("id", 2) if table else ("seq", 1)
    table = table or "run"
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        [value] = database.execute(f"SELECT {column} FROM {table} WHERE {key} = ?", [at]).fetchone()
        raw = bytearray(value.encode() if isinstance(value, str) else value)
        raw[len(raw) // 2] ^= 1
        new = raw.decode() if isinstance(value, str) else bytes(raw)
        database.execute(f"UPDATE {table} SET {column} = ? WHERE {key} = ?", [new, at])


def damage(file: Path, part: str) -> None:
    if part == "header":
        file.write_bytes(b"x" * 10_000)
        return
    if part == "schema":  # a column's name, as one flipped bit leaves it
        file.write_bytes(file.read_bytes().replace(b"content BLOB", b"contemt BLOB"))
        return
    column = {"record": "content", "run": "data"}[part]
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        database.execute(f"UPDATE {part} SET {column} = x'c1'")


def test_nothing_is_uploaded_before_it_is_wanted_unless_asked(spool: Spool, folder_url: str) -> None:
    asked = threading.Event()

    def wanted() -> bool:
        asked.set()
        return False

    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
    with Uploader(spool, lambda: Store(folder_url), wanted) as uploader:
        assert asked.wait(WAIT_S)
        assert spool.waiting() == [1]
        uploader.now()
        until(lambda: uploader.state.uploaded == 1)


def test_an_uploader_is_emptied_at_the_end_whatever_is_wanted(spool: Spool, folder_url: str) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
    with Uploader(spool, lambda: Store(folder_url), lambda: False) as uploader:
        assert uploader.drain(WAIT_S)
        assert spool.waiting() == []
        assert uploader.drain(0.0)


def test_emptying_a_spool_ends_when_the_store_cannot_be_reached(spool: Spool) -> None:
    def connect() -> Store:
        raise StoreUnreachable("no network")

    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
    with Uploader(spool, connect) as uploader:
        assert not uploader.drain(WAIT_S)
        assert spool.waiting() == [1]


def test_whoever_waits_for_an_emptied_spool_can_be_told_to_wait_no_more(spool: Spool) -> None:
    asked, let_go = threading.Event(), threading.Event()

    def connect() -> Store:
        asked.set()
        let_go.wait(WAIT_S)
        raise StoreUnreachable("no network")

    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
    with Uploader(spool, connect) as uploader, ThreadPoolExecutor(1) as pool:
        emptied = pool.submit(uploader.drain, WAIT_S)
        assert asked.wait(WAIT_S)
        uploader.hurry()
        assert emptied.result(WAIT_S / 2) is False
        let_go.set()
    assert spool.waiting() == [1]


def test_what_a_library_raises_is_no_end_and_quotes_nothing(spool: Spool, folder_url: str) -> None:
    raised = threading.Event()

    def connect() -> Store:
        if not raised.is_set():
            raised.set()
            raise RuntimeError("the key is 0123456789")
        return Store(folder_url)

    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
    with Uploader(spool, connect) as uploader:
        until(lambda: uploader.state.problem == "internal error, RuntimeError")
        uploader.now()
        until(lambda: uploader.state.uploaded == 1)


@pytest.mark.parametrize(
    ("kind", "words"), [(StoreError, "a file is gone"), (ValueError, "internal error, ValueError")]
)
def test_a_batch_that_cannot_be_completed_keeps_no_other_from_the_store(
    spool: Spool, folder_url: str, monkeypatch: pytest.MonkeyPatch, kind: type[Exception], words: str
) -> None:
    failing = {1, 2}

    def fails(spool: Spool, number: int, store: Store) -> None:
        if number in failing:
            raise kind("a file is gone")
        send(spool, number, store)

    monkeypatch.setattr("server_gui.core.recording.uploader.send", fails)
    with Recorder(spool) as recorder:
        for seq in range(4):
            recorder.record("exo-01", 7, batch(seq))
            recorder.cut(lambda: None)
            assert recorder.flush(WAIT_S)
    last = spool.waiting()[-1]
    uploader = Uploader(spool, lambda: Store(folder_url))
    assert not uploader._empty(asked=True)
    assert spool.waiting() == [1, 2]
    assert (uploader.state.uploaded, uploader.state.waiting) == (last - 2, 2)
    problem = f"batch 1 is not in the store yet: {words} (and 1 other likewise)"
    assert uploader.state.problem == problem
    failing.clear()
    assert uploader._empty(asked=True)
    assert uploader.state == replace(uploader.state, problem=None, waiting=0)
    assert sorted(Store(folder_url).dataset(HERE).to_table()["seq"].to_pylist()) == [0, 1, 2, 3]


def test_a_spool_that_cannot_be_listed_is_told_and_ends_no_uploader(
    spool: Spool, folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuses(_folder: Path) -> Iterator[Path]:
        raise OSError(errno.EIO, "Input/output error")

    uploader = Uploader(spool, lambda: Store(folder_url))
    with monkeypatch.context() as failing:
        failing.setattr(Path, "iterdir", refuses)
        assert not uploader._empty(asked=True)
    assert uploader.state.problem == f"the spool {spool.folder} cannot be read: Input/output error"
    assert uploader._empty(asked=True)


def test_the_first_upload_after_a_power_cut_mends_the_log_and_compares(spool: Spool, folder_url: str) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 7, batch(1), clock_offset_ns=0)
    store = Store(folder_url)
    upload_all(spool, store)
    assert store.folder is not None
    entry = max((store.folder / HERE / durable.LOG).glob("*.json"))
    torn = entry.read_bytes()[:50]
    entry.unlink()
    entry.write_bytes(torn)
    os.utime(entry, (0, 0))
    uploader = Uploader(spool, lambda: Store(folder_url))
    assert uploader._empty(asked=True)
    assert uploader.state.problem is None
    assert uploader._compared
    assert store.dataset(HERE).count_rows() == len(batch(1).stamps_ns)


def test_a_store_that_cannot_be_compared_is_uploaded_to_and_compared_later(
    spool: Spool, folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 7, batch(1), clock_offset_ns=0)
    uploader = Uploader(spool, lambda: Store(folder_url))

    def away(*_: object) -> list[str]:
        raise StoreUnreachable("no answer")

    with monkeypatch.context() as failing:
        failing.setattr("server_gui.core.recording.uploader.ahead", away)
        assert uploader._empty(asked=True)
    uploader._reach()
    assert uploader._compared
