"""Telemetry whose session's own row was lost is listed, exported and learned from like any other."""

import collections
import contextlib
import csv
import sqlite3
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import pytest

from gateway.main import main
from ml.store import Store
from ml.store import sessions as stored
from ml.store.sessions import UNREAD, UNTOLD, Session
from ml.training.recorded import recorded
from server_gui.core.archive.library import look
from server_gui.core.cloud import spool_reader
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.cloud.tape import Tape, as_time
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from server_gui.views.recordings.sessions import facts_text
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import CHANNELS, batch, description

ROWS = 50
AWAY = "s3://nowhere/store"
REFUSED = {
    "AWS_ENDPOINT_URL": "http://127.0.0.1:9",
    "AWS_ACCESS_KEY_ID": "key",
    "AWS_SECRET_ACCESS_KEY": "secret",
}


def record(folder: Path) -> str:
    """A session whose rows are damaged in the spool, but for its telemetry; its name."""
    with Spool(folder, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.describe("exo-01", description("exo-01"))
        session = recorder.begin("exo-01", Facts(parameters={"gain": 2.0}))
        recorder.record("exo-01", 1, batch(0, ROWS))
    with contextlib.closing(sqlite3.connect(folder / "00000001.db")) as database, database:
        database.execute("UPDATE record SET content = zeroblob(length(content))")
    return session


def upload(folder: Path, url: str) -> None:
    with Spool(folder, reserve_bytes=0) as spool:
        for number in spool.waiting():
            with contextlib.suppress(Damaged):
                send(spool, number, Store(url))


def test_while_it_waits_it_is_listed_and_can_be_exported(tmp_path: Path, folder_url: str) -> None:
    name = record(tmp_path)
    known = Recordings(folder_url, tmp_path)  # there is no store yet
    [session] = known.sessions()
    assert (session.session, session.notes, session.uploaded) == (name, UNTOLD, False)
    assert [each.session for each in spool_reader.sessions(tmp_path)] == [name]
    [rows] = known.open(session).telemetry(CHANNELS)
    assert rows.num_rows == ROWS


def test_in_the_store_it_is_listed_exported_and_learned_from(
    tmp_path: Path, folder_url: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name = record(tmp_path)
    upload(tmp_path, folder_url)
    store = Store(folder_url)
    [session] = stored.sessions(store)
    assert (session.session, session.rows, session.notes) == (name, ROWS, UNTOLD)
    assert len(recorded(store, "exo-01", name, CHANNELS).stamps_ns) == ROWS
    assert main(["sessions", "ls", "--url", folder_url]) == 0
    assert name in capsys.readouterr().out
    out = tmp_path / "out.csv"
    assert main(["sessions", "export", name, "--url", folder_url, "--out", str(out)]) == 0
    with out.open() as lines:
        assert len(list(csv.reader(lines))) == 1 + ROWS


def test_a_session_that_is_told_of_in_the_spool_is_listed_once(tmp_path: Path, folder_url: str) -> None:
    record(tmp_path)
    upload(tmp_path, folder_url)
    with Spool(tmp_path, reserve_bytes=0) as spool:
        [untold] = stored.sessions(Store(folder_url))
        spool.append((), [_row(untold)])
        spool.freeze()
    [session] = Recordings(folder_url, tmp_path).sessions()
    assert (session.rows, session.notes, session.uploaded) == (ROWS, "", True)
    [shown] = look(ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path))).sessions
    assert (shown.rows, shown.notes, shown.uploaded) == (ROWS, "", True)


def clock(at_ns: int) -> str:
    return f"{as_time(at_ns).astimezone():%H:%M:%S}"


def test_while_the_store_is_away_the_rest_of_a_session_is_not_called_lost(
    tmp_path: Path, folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, settings = (
        record(tmp_path),
        ServerSettings({}, StoreSettings(AWAY), RecordingSettings(spool=tmp_path)),
    )
    for variable, value in REFUSED.items():
        monkeypatch.setenv(variable, value)
    [shown] = look(settings).sessions
    assert (shown.session, shown.notes) == (name, UNREAD)
    [session] = Recordings(AWAY, tmp_path).sessions()
    assert session.notes == UNREAD
    tape = Tape.open(settings, shown)
    assert tape.is_partial
    said = facts_text(shown, tape, "", ())
    began = datetime.strptime(name.partition("-")[0], "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
    assert f"Began: {began.astimezone():%Y-%m-%d %H:%M:%S}" in said, "its name tells"
    assert "Length: not known while the store is not reached" in said
    assert f"Here: only {clock(tape.first_ns)} to {clock(tape.last_ns)} of it are on this computer; " in said
    assert "the rest is in the store, which is not reached" in said
    assert "first" not in said, "what is left is the last part of it, as far as anybody knows"
    assert "Notes: not known while the store is not reached" in said, "they are the user's words alone"
    before = msgspec.structs.replace(shown, notes="P01, stairs", operator="Ada", wearer="P01")
    said = facts_text(shown, tape, "", (), words=before)
    assert "Operator: Ada\nWearer: P01\nNotes: P01, stairs\nHere: only" in said
    assert "no gaps" not in said
    here = ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path))
    assert not Tape.open(here, shown).is_partial, "nothing was uploaded yet, so all of it is here"
    said = facts_text(shown, Tape.open(here, shown), "", ())
    assert "no gaps" not in said, "of what was listed while the store was away, nobody knows all"


def _row(session: Session) -> Record:
    fields = {"robot": session.robot, "session": session.session, "utc": 1_000, "began": 1_000}
    return Record("sessions", fields)


def test_rows_of_a_boot_that_began_while_the_disk_was_full_are_in_its_session(
    tmp_path: Path, folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.core.recording.recorder.AGAIN_S", 0.0)
    free = collections.deque([10])
    with (
        Spool(tmp_path, reserve_bytes=10, free_bytes=lambda folder: free[0]) as spool,
        Recorder(spool) as recorder,
    ):
        old = recorder.begin("exo-01", Facts(parameters={"gain": 1.0}))
        recorder.record("exo-01", 1, batch(0, 10))
        assert recorder.flush(WAIT_S)
        free[0] = 0
        new = recorder.begin("exo-01", Facts(parameters={"gain": 2.0}))
        recorder.record("exo-01", 1, batch(0, 7, link=2))
        assert recorder.flush(WAIT_S)
        free[0] = 10
        recorder.record("exo-01", 1, batch(1, 15, link=2))
        recorder.cut(lambda: None)
        assert recorder.flush(WAIT_S)
        for number in spool.waiting():  # before its end tells of the session once more
            send(spool, number, Store(folder_url))
    found = {each.session: each for each in stored.sessions(Store(folder_url))}
    assert {name: (each.rows, each.parameters["gain"]) for name, each in found.items()} == {
        old: (10, 1.0),
        new: (15, 2.0),
    }


def test_rows_that_are_damaged_where_they_wait_are_not_shown(tmp_path: Path, folder_url: str) -> None:
    with Spool(tmp_path, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0, 5))
        recorder.flush(WAIT_S)
        recorder.record("exo-01", 1, batch(1, 5))
    with contextlib.closing(sqlite3.connect(tmp_path / "00000001.db")) as database, database:
        database.execute("UPDATE run SET data = zeroblob(length(data)) WHERE seq = 1")
    known = Recordings(folder_url, tmp_path)
    [session] = known.sessions()
    assert known.open(session).waiting == 5
