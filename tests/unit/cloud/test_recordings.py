"""Recordings of which the store has all, a part or nothing: whole, and every row once."""

import sqlite3
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pytest

from ml.store import Store, StoreUnreachable
from ml.store.sessions import NoSuchSession
from ml.store.tables import EVENTS
from server_gui.core.cloud.recordings import Recorded, Recordings
from server_gui.core.cloud.selection import Choice, choose
from server_gui.core.cloud.tabular import write_csv
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send, upload
from tests.support.waiting import WAIT_S
from tests.unit.cloud.recordings import BATCHES, ROWS, UNITS, record
from tests.unit.recording.robots import CHANNELS, batch, described, description, value

ALL = sorted(value(seq, row, 0) for seq in range(21) if seq != 10 for row in range(ROWS))
NOWHERE = "s3://nowhere/lab"


def sole(known: Recordings) -> Recorded:
    [session] = known.sessions()
    return known.open(session)


def values(recorded: Recorded, channel: str = CHANNELS[0]) -> list[float]:
    tables = list(recorded.telemetry([channel]))
    utc = pa.concat_tables(tables)["utc"].to_pylist()
    assert utc == sorted(utc)
    return [number for table in tables for number in table[channel].to_pylist()]


def in_pieces(spool: Spool, url: str, after: Callable[[int, Store], object]) -> None:
    """A session in four batches; `after` each, which is frozen, something is done with it."""
    store = Store(url)
    with Recorder(spool) as recorder:
        recorder.describe("exo-01", description("exo-01"))
        recorder.begin("exo-01", Facts(operator="anna"))
        for seq in range(BATCHES + 1):
            if seq != 10:
                recorder.record("exo-01", 1, batch(seq, ROWS))
            if seq % 6 == 5:
                recorder.mark("exo-01", f"{seq}")
                recorder.cut(lambda: None)
                assert recorder.flush(WAIT_S)
                after(seq // 6, store)


def test_what_only_the_spool_has_is_exported_as_from_the_store(folder_url: str, tmp_path: Path) -> None:
    files = []
    recorded = record(folder_url, tmp_path / "spool", sent=False)
    for name in ("waiting", "stored"):
        known = Recordings(folder_url, tmp_path / "spool")
        whole = sole(known)
        files.append(tmp_path / f"{name}.csv")
        assert write_csv(files[-1], choose(known, whole, Choice())) == BATCHES * ROWS
        assert whole.waiting == (BATCHES * ROWS if name == "waiting" else 0)
        assert {each.name: each.unit for each in whole.channels} == UNITS
        assert {each.samples for each in whole.channels} == {BATCHES * ROWS}
        assert [row["kind"] for row in known.rows_of(whole.session)] == ["gap", "marker"]
        assert [row["label"] for row in known.labels(whole.session)] == ["walk"]
        with Spool(tmp_path / "spool") as spool:
            for number in spool.waiting():
                send(spool, number, recorded.store)
    assert files[0].read_text() == files[1].read_text()
    assert len(files[0].read_text().splitlines()) == BATCHES * ROWS + 1


def test_a_session_half_in_the_store_is_whole_and_every_row_is_there_once(
    folder_url: str, tmp_path: Path
) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:

        def half(piece: int, store: Store) -> None:
            if piece == 0:
                send(spool, spool.waiting()[0], store)
            if piece == 1:  # killed after the store had it, before the spool knew
                upload(spool.read(spool.waiting()[0]), spool.id, store)
            whole = sole(known := Recordings(folder_url, spool.folder))
            assert len(values(whole)) == whole.session.rows
            assert {each.samples for each in whole.channels} == {whole.session.rows}
            assert [row["text"] for row in known.rows_of(whole.session) if row["kind"] == "marker"] == [
                f"{6 * each + 5}" for each in range(piece + 1)
            ]

        in_pieces(spool, folder_url, half)
    known = Recordings(folder_url, tmp_path / "spool")
    whole = sole(known)
    assert sorted(values(whole)) == ALL
    assert 0 < whole.waiting < len(ALL)
    assert whole.session.ended is not None  # which only the spool knows
    assert len(values(whole)) == whole.session.rows


def test_a_batch_that_a_later_one_has_overtaken_is_read_in_the_spool(folder_url: str, tmp_path: Path) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:

        def overtake(piece: int, store: Store) -> None:
            if piece == 1:  # the first one was left behind by an error of its own
                send(spool, spool.waiting()[1], store)
                whole = sole(known := Recordings(folder_url, spool.folder))
                assert len(values(whole)) == whole.session.rows == 11 * ROWS
                assert whole.waiting == 6 * ROWS
                texts = [row["text"] for row in known.rows_of(whole.session) if row["kind"] == "marker"]
                assert texts == ["5", "11"]
                assert whole.session.operator == "anna"

        in_pieces(spool, folder_url, overtake)


def test_what_is_uploaded_while_somebody_reads_is_there_once(folder_url: str, tmp_path: Path) -> None:
    recorded = record(folder_url, tmp_path / "spool", sent=False)
    before = Recordings(folder_url, tmp_path / "spool")
    assert before.find(recorded.session).uploaded is False
    with Spool(tmp_path / "spool") as spool:
        for number in spool.waiting():
            send(spool, number, recorded.store)
    for known in (before, Recordings(folder_url, tmp_path / "spool")):
        whole = sole(known)
        assert sorted(values(whole)) == ALL
        assert len(known.rows_of(whole.session, EVENTS)) == 2


def test_what_was_removed_while_somebody_reads_is_not_left_out_silently(
    folder_url: str, tmp_path: Path
) -> None:
    recorded = record(folder_url, tmp_path / "spool", sent=False)
    known = Recordings(folder_url, tmp_path / "spool")
    whole = sole(known)
    with Spool(tmp_path / "spool", reserve_bytes=0, keep_bytes=0) as spool:
        for number in spool.waiting():
            send(spool, number, recorded.store)
        spool.make_room()
    with pytest.raises(SpoolUnusable, match="ask again"):
        list(whole.telemetry([CHANNELS[0]]))


def test_columns_of_the_spool_are_those_that_the_store_will_have(folder_url: str, tmp_path: Path) -> None:
    """A unit that another robot has by the same name, and a channel that no other has."""
    record(folder_url, tmp_path / "other", "exo-02")
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.describe("exo-01", described("exo-01", {"left_knee.position": "deg", "new": "N"}))
        recorder.begin("exo-01", Facts())
        recorder.record("exo-01", 1, batch(0, ROWS, channels=("left_knee.position", "new")))
    known = Recordings(folder_url, tmp_path / "spool")
    session = next(each for each in known.sessions() if each.robot == "exo-01")
    whole = known.open(session)
    assert {each.name: each.unit for each in whole.channels} == {"left_knee.position@deg": "deg", "new": "N"}
    assert len(values(whole, "new")) == ROWS
    with Spool(tmp_path / "spool") as spool:
        for number in spool.waiting():
            send(spool, number, Store(folder_url))
    stored = Recordings(folder_url, tmp_path / "spool").open(session)
    assert [each.name for each in stored.channels] == ["left_knee.position@deg", "new"]


@pytest.mark.parametrize("sent", [0, 1])
def test_a_channel_without_a_dimension_is_one_channel_in_whatever_batches_it_waits(
    folder_url: str, tmp_path: Path, sent: int
) -> None:
    store = Store(folder_url)
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.describe("exo-01", described("exo-01", {"state": "", "knee": "rad"}))
        for seq in range(3):
            recorder.record("exo-01", 1, batch(seq, channels=("state", "knee")))
            recorder.cut(lambda: None)
            assert recorder.flush(30.0)
        for number in spool.waiting()[:sent]:
            send(spool, number, store)
        whole = sole(Recordings(folder_url, spool.folder))
        assert [(each.name, each.unit, each.samples) for each in whole.channels] == [
            ("knee", "rad", 3),
            ("state", "", 3),
        ]
        assert values(whole, "state") == [value(seq, 0, 0) for seq in range(3)]


def test_what_waits_is_read_under_the_names_that_it_has_where_it_arrives(
    folder_url: str, tmp_path: Path
) -> None:
    """Another robot in the same batch, and a unit that was not known at first."""
    store = Store(folder_url)
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            recorder.describe("exo-02", described("exo-02", {"knee": "rad"}))
            recorder.record("exo-02", 1, batch(0, channels=("knee",)))
            recorder.flush(30.0)
            recorder.describe("exo-01", described("exo-01", {"knee": "deg"}))
            recorder.record("exo-01", 1, batch(0, channels=("knee", "hip")))
            recorder.cut(lambda: None)
            assert recorder.flush(30.0)
            recorder.describe("exo-01", described("exo-01", {"knee": "deg", "hip": "rad"}))
            recorder.record("exo-01", 1, batch(1, channels=("knee", "hip")))
        found = []
        for _ in range(2):
            known = Recordings(folder_url, spool.folder)
            whole = known.open(next(each for each in known.sessions() if each.robot == "exo-01"))
            names = [each.name for each in whole.channels]
            found.append((whole.channels, [each.to_pylist() for each in whole.telemetry(names)]))
            for number in spool.waiting():
                send(spool, number, store)
        assert found[0] == found[1]
        assert [each.name for each in found[0][0]] == ["hip", "hip@rad", "knee@deg"]


def test_where_the_store_is_away_what_this_computer_has_is_found(
    folder_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = record(folder_url, tmp_path / "spool")  # sent, and kept as a second copy
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "key")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    known = Recordings(NOWHERE, tmp_path / "spool")
    assert isinstance(known.problem, StoreUnreachable)
    assert "Connection refused; check the network" in str(known.problem)
    assert sorted(values(known.open(known.find(recorded.session)))) == ALL
    with pytest.raises(StoreUnreachable):  # it may well be there
        known.find("2020")
    with pytest.raises(StoreUnreachable):
        Recordings(NOWHERE, tmp_path / "empty")


def test_a_name_that_is_nowhere_and_a_damaged_batch_are_told(folder_url: str, tmp_path: Path) -> None:
    recorded = record(folder_url, tmp_path / "spool", sent=False)
    known = Recordings(folder_url, tmp_path / "spool")
    with pytest.raises(NoSuchSession, match="no session '2020'"):
        known.find("2020")
    file = tmp_path / "spool" / "00000001.db"
    with sqlite3.connect(file) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    database.close()
    file.write_bytes(b"x" * 20_000)
    with pytest.raises(SpoolUnusable, match=r"00000001\.db is damaged.*gwrms cloud upload"):
        Recordings(folder_url, tmp_path / "spool").find(recorded.session)


def test_records_are_read_also_where_the_column_of_their_numbers_has_lost_its_type(
    folder_url: str, tmp_path: Path
) -> None:
    """By one flipped bit: what is no INTEGER PRIMARY KEY is no name of the rowid, and reads as null."""
    record(folder_url, tmp_path / "spool", sent=False)
    [file] = [each for each in (tmp_path / "spool").glob("0*.db") if b"marker" in each.read_bytes()]
    file.write_bytes(file.read_bytes().replace(b"number INTEGER", b"number INTEFER"))
    known = Recordings(folder_url, tmp_path / "spool")
    assert [row["kind"] for row in known.rows_of(sole(known).session)] == ["gap", "marker"]
    assert [row["label"] for row in known.labels(sole(known).session)] == ["walk"]
