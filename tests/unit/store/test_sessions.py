"""Sessions in a store: what is known of each, and its telemetry in time's order."""

from datetime import timedelta
from pathlib import Path

import pytest

from ml.store import Store
from ml.store.sessions import NoSuchSession, channels, find, labels, rows_of, sessions, telemetry
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.cloud.recordings import BATCHES, PARAMETERS, ROWS, UNITS, record
from tests.unit.recording.robots import batch, stamp_ns, value

KNEE = "left_knee.position"


def test_a_session_is_found_with_everything_that_is_known_of_it(store_url: str, tmp_path: Path) -> None:
    recorded = record(store_url, tmp_path / "spool")
    [session] = sessions(recorded.store)
    assert (session.robot, session.session) == ("exo-01", recorded.session)
    assert (session.operator, session.notes) == ("anna", "first")
    assert session.parameters == PARAMETERS
    assert session.ended is not None
    assert session.rows == BATCHES * ROWS
    assert {each.name: (each.unit, each.samples) for each in channels(recorded.store, session)} == {
        name: (unit, BATCHES * ROWS) for name, unit in UNITS.items()
    }
    assert [event["kind"] for event in rows_of(recorded.store, session)] == ["gap", "marker"]
    assert [row["label"] for row in labels(recorded.store, session)] == ["walk"]


def test_a_channels_samples_are_what_it_has_and_no_other_robots_channels(
    folder_url: str, tmp_path: Path
) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            for seq in range(4):
                recorder.record("exo-01", 1, batch(seq, missing=("left_knee.velocity",) if seq else ()))
                recorder.record("exo-02", 1, batch(seq, channels=("trunk.tilt_forward",)))
        store = Store(folder_url)
        send(spool, 1, store)
    found = {each.robot: channels(store, each) for each in sessions(store)}
    assert {each.name: each.samples for each in found["exo-01"]} == {
        "left_knee.position": 4,
        "left_knee.velocity": 1,
        "trunk.tilt_forward": 4,
    }
    assert [each.name for each in found["exo-02"]] == ["trunk.tilt_forward"]


def test_telemetry_comes_in_times_order_whatever_the_files(folder_url: str, tmp_path: Path) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    other = record(folder_url, tmp_path / "other")  # of the same robot: must not be mixed in
    session = find(recorded.store, recorded.session)
    assert other.session != recorded.session
    tables = list(telemetry(recorded.store, session, [KNEE]))
    rows = [row for table in tables for row in table.to_pylist()]
    assert tables[0].column_names == ["utc", "stamp_ns", KNEE]
    assert [row["utc"] for row in rows] == sorted(row["utc"] for row in rows)
    seqs = [seq for seq in range(BATCHES + 1) if seq != 10]
    expected = {stamp_ns(seq, row): value(seq, row, 0) for seq in seqs for row in range(ROWS)}
    assert {row["stamp_ns"]: row[KNEE] for row in rows} == expected


def test_telemetry_between_two_times_is_what_is_asked_for(folder_url: str, tmp_path: Path) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    session = find(recorded.store, recorded.session)
    whole = [row["utc"] for table in telemetry(recorded.store, session, [KNEE]) for row in table.to_pylist()]
    begin, end = whole[10], whole[20]
    part = [
        row["utc"]
        for table in telemetry(recorded.store, session, [KNEE], begin, end)
        for row in table.to_pylist()
    ]
    assert part == [utc for utc in whole if begin <= utc < end]
    later = whole[-1] + timedelta(seconds=1)
    assert sum(table.num_rows for table in telemetry(recorded.store, session, [KNEE], later)) == 0


def test_a_session_is_named_by_how_its_name_begins(folder_url: str, tmp_path: Path) -> None:
    first = record(folder_url, tmp_path / "one")
    second = record(folder_url, tmp_path / "two", "exo-02")
    assert find(first.store, first.session[:-1]).session == first.session
    assert find(first.store, second.session).robot == "exo-02"
    assert [session.robot for session in sessions(first.store, "exo-02")] == ["exo-02"]
    with pytest.raises(NoSuchSession, match="2 sessions begin with '2'"):
        find(first.store, "2")
    with pytest.raises(NoSuchSession, match="no session 'x'"):
        find(first.store, "x")


def test_shards_hold_every_robots_sessions(folder_url: str, tmp_path: Path) -> None:
    Store(folder_url, shards=3)
    robots = [f"exo-{number}" for number in range(4)]
    recorded = [record(folder_url, tmp_path / robot, robot) for robot in robots]
    found = sessions(recorded[0].store)
    assert sorted(session.robot for session in found) == robots
    for session in found:
        rows = telemetry(recorded[0].store, session, [KNEE])
        assert sum(table.num_rows for table in rows) == session.rows == BATCHES * ROWS
