"""A recorder that cannot keep all that comes: losses are counted, told and named, and it goes on."""

import collections
import errno
import json
import threading
import time
from pathlib import Path

import pytest

from ml.store.labels import Label
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.recorder import AGAIN_S, Alarm, AlarmKind, Recorder, RecorderSettings
from server_gui.core.recording.records import Facts, label
from server_gui.core.recording.rows import JournalHead
from server_gui.core.recording.spool import Spool
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import batch
from tests.unit.recording.spools import StuckSpool, events, kept, rows


def test_nobody_waits_for_the_disk_and_an_overflow_is_counted_told_and_recorded(tmp_path: Path) -> None:
    alarms: list[Alarm] = []
    with StuckSpool(tmp_path) as spool:
        with Recorder(spool, alarms.append, RecorderSettings(capacity=100)) as recorder:
            recorder.record("exo-01", 1, batch(0))
            assert spool.reached.wait(WAIT_S)
            for seq in range(1, 151):
                recorder.record("exo-01", 1, batch(seq))  # returns although the disk hangs
            assert not spool.let_go.is_set()
            assert recorder.state.lost == 50
            spool.let_go.set()
            assert recorder.flush(WAIT_S)
            assert recorder.state.lost == 50
        assert [alarm.kind for alarm in alarms] == [AlarmKind.OVERFLOW]
        assert len(rows(kept(spool)[0])) == 101
        (event,) = events(spool, "lost")
        assert json.loads(str(event["data"]))["rows"] == 50


def test_however_full_the_queue_is_rows_stay_with_their_session_and_labels_and_events_are_kept(
    tmp_path: Path,
) -> None:
    with StuckSpool(tmp_path) as spool:
        with Recorder(spool, settings=RecorderSettings(capacity=10)) as recorder:
            old = recorder.begin("exo-01", Facts())
            assert spool.reached.wait(WAIT_S)
            for seq in range(20):
                recorder.record("exo-01", 1, batch(seq))
            lost = recorder.state.lost
            recorder.end("exo-01")
            new = recorder.begin("exo-01", Facts())
            recorder.amend("exo-01", Facts(notes="after a reboot"))
            recorder.mark("exo-01", "here")
            recorder.add(label(Label("exo-01", new, 1, 2, "walk", "ada")))
            assert recorder.state.lost == lost == 10
            spool.let_go.set()
            assert recorder.flush(WAIT_S)
            recorder.record("exo-01", 1, batch(20))
        runs, records = kept(spool)
        assert {run.session: len(run) for run in runs} == {old: 10, new: 1}
        told = [record.fields for record in records if record.table == "sessions"]
        assert {each["session"] for each in told if each["ended"]} == {old, new}
        assert "after a reboot" in [each["notes"] for each in told if each["session"] == new]
        assert [event["text"] for event in events(spool, "marker")] == ["here"]
        assert [record.fields["label"] for record in records if record.table == "labels"] == ["walk"]


def test_what_the_disk_refused_is_tried_again(tmp_path: Path) -> None:
    alarms: list[Alarm] = []
    with StuckSpool(tmp_path) as spool:
        spool.let_go.set()
        spool.refusals = 1
        with Recorder(spool, alarms.append) as recorder:
            recorder.record("exo-01", 1, batch(0))
            assert recorder.flush(WAIT_S + AGAIN_S)
            assert recorder.state.alarms == ()
        assert [(alarm.kind, alarm.text) for alarm in alarms] == [
            (AlarmKind.SPOOL_FAILED, "the disk refuses")
        ]
        assert len(rows(kept(spool)[0])) == 1


def test_at_the_end_a_disk_that_refuses_is_tried_again(tmp_path: Path) -> None:
    with StuckSpool(tmp_path) as spool:
        with Recorder(spool) as recorder:
            assert recorder.flush(WAIT_S)
            recorder.record("exo-01", 1, batch(0, 7))
            assert spool.reached.wait(WAIT_S)
            recorder.record("exo-01", 1, batch(1, 8))
            spool.refusals = 3
            spool.let_go.set()
        assert recorder.state.lost == 0
        assert len(rows(kept(spool)[0])) == 15


def test_what_is_lost_at_the_end_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("server_gui.core.recording.recorder.LAST_S", 0.5)
    with StuckSpool(tmp_path) as spool:
        with Recorder(spool) as recorder:
            session = recorder.begin("exo-01", Facts())
            recorder.record("exo-01", 1, batch(0, 7))
            assert spool.reached.wait(WAIT_S)
            spool.refusals = 1_000
            spool.let_go.set()
        assert recorder.state.lost > 7
        assert kept(spool) == ([], [])
    said = [text for text in caplog.messages if text.startswith("the disk refuses; lost: exo-01: ")]
    assert any(f"7 rows of telemetry, session {session}, 20" in text for text in said)
    assert any("rows of sessions, 20" in text for text in said)


def test_a_nearly_full_disk_stops_recording_with_an_alarm_and_it_goes_on_when_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.core.recording.recorder.AGAIN_S", 0.0)
    free = collections.deque([0])
    before_ns = time.time_ns() - 10**9  # a row without a clock is taken to have come without delay
    alarms: list[Alarm] = []
    with Spool(tmp_path, reserve_bytes=10, free_bytes=lambda folder: free[0]) as spool:
        with Recorder(spool, alarms.append) as recorder:
            recorder.record("exo-01", 1, batch(0))
            assert recorder.flush(WAIT_S)
            assert recorder.state.lost == 2  # the row, and the session that began with it
            assert [alarm.kind for alarm in recorder.state.alarms] == [AlarmKind.DISK_FULL]
            free[0] = 10
            recorder.record("exo-01", 1, batch(1))
            assert recorder.flush(WAIT_S)
            assert recorder.state.alarms == ()
        assert [alarm.kind for alarm in alarms] == [AlarmKind.DISK_FULL]
        runs, records = kept(spool)
        assert [row[3] for row in rows(runs)] == [1]
        [event] = events(spool, "lost")
        data = json.loads(str(event["data"]))
        assert data["rows"] == 2
        assert before_ns <= data["from"] <= data["to"] <= time.time_ns()
        assert f"1 row of telemetry, session {event['session']}, 20" in str(event["text"])
        assert "1 row of sessions, 20" in str(event["text"])
        # The session that began while nothing was kept is written again, before its first row and its end.
        told = [record.fields for record in records if record.table == "sessions"]
        assert [each["session"] for each in told] == [runs[0].session] * 2
        assert [each["ended"] is None for each in told] == [True, False]


def test_where_there_is_never_room_the_log_says_at_the_end_all_that_was_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("server_gui.core.recording.recorder.AGAIN_S", 0.0)
    with Spool(tmp_path, reserve_bytes=10, free_bytes=lambda folder: 0) as spool:
        with Recorder(spool) as recorder:
            for seq in range(9):
                recorder.record("exo-01", 1, batch(seq, 3))
                assert recorder.flush(WAIT_S)
        assert recorder.untold == recorder.state.lost > 27
    said = [text for text in caplog.messages if "is nearly full; lost: exo-01: " in text]
    assert any("27 rows of telemetry, session " in text for text in said)


def test_what_an_event_of_a_loss_was_to_tell_is_named_where_that_is_lost_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("server_gui.core.recording.recorder.AGAIN_S", 0.0)
    monkeypatch.setattr("server_gui.core.recording.recorder.LAST_S", 0.0)
    free = collections.deque([0])
    with Spool(tmp_path, reserve_bytes=10, free_bytes=lambda folder: free[0]) as spool:
        with Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(0, 3))
            assert recorder.flush(WAIT_S)
            monkeypatch.setattr(spool, "append", _refuses)
            free[0] = 10
            recorder.record("exo-01", 1, batch(1, 4))
        assert recorder.untold >= 7
    assert any("the disk refuses; lost: exo-01: 7 rows of telemetry" in text for text in caplog.messages)


def _refuses(*_: object) -> None:
    raise SpoolUnusable("the disk refuses")


def test_who_cuts_a_batch_is_called_when_it_waits_also_where_the_disk_refused_at_first(
    spool: Spool, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused: list[str] = []
    freeze = spool.freeze

    def refuse_once() -> None:
        if not refused:
            refused.append("")
            raise SpoolUnusable("the disk is full")
        freeze()

    monkeypatch.setattr(spool, "freeze", refuse_once)
    called = threading.Event()
    waiting: list[list[int]] = []

    def then() -> None:
        waiting.append(spool.waiting())
        called.set()

    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
        recorder.cut(then)
        assert called.wait(WAIT_S)
        assert (refused, waiting) == ([""], [[1]])
        assert recorder.flush(WAIT_S)
        assert recorder.state.alarms == ()


def test_a_file_that_cannot_be_begun_is_one_alarm_while_recording_goes_on(
    spool: Spool, monkeypatch: pytest.MonkeyPatch
) -> None:
    alarms: list[Alarm] = []
    with Recorder(spool, alarms.append) as recorder:
        with monkeypatch.context() as patched:
            patched.setattr(spool, "freeze", _refuses)
            recorder.cut(lambda: None)
            for seq in range(3):
                recorder.record("exo-01", 1, batch(seq))
                assert recorder.flush(WAIT_S)
            assert [alarm.kind for alarm in recorder.state.alarms] == [AlarmKind.UNFROZEN]
        recorder.record("exo-01", 1, batch(3))
        assert recorder.flush(WAIT_S)
        assert (recorder.state.alarms, recorder.state.lost) == ((), 0)
    assert [alarm.kind for alarm in alarms] == [AlarmKind.UNFROZEN]


def test_what_no_file_takes_is_lost_alone_with_an_alarm(spool: Spool) -> None:
    alarms: list[Alarm] = []
    with Recorder(spool, alarms.append) as recorder:
        recorder._robots.heads["bad"] = JournalHead(2**63 + 5, "h")  # as if nobody had looked at it
        for robot in ("a", "b", "c"):
            recorder.record(robot, 1, batch(0))
        assert recorder.flush(WAIT_S)
        recorder.record("a", 1, batch(1))
        assert recorder.flush(WAIT_S)
    assert [alarm.kind for alarm in alarms] == [AlarmKind.BROKEN]
    found = rows(kept(spool)[0])
    assert len(found) == len(set(found)) == 4
    assert "bad" not in spool.heads


def test_where_no_room_can_be_made_recording_goes_on_with_an_alarm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.core.recording.recorder.AGAIN_S", 0.0)
    failing = [True]

    def free_bytes(_folder: Path) -> int:
        if failing[0]:
            raise OSError(errno.EIO, "Input/output error")
        return 1

    alarms: list[Alarm] = []
    with Spool(tmp_path, reserve_bytes=1, free_bytes=free_bytes) as spool:
        with Recorder(spool, alarms.append) as recorder:
            for seq in range(3):
                recorder.record("exo-01", 1, batch(seq))
                assert recorder.flush(WAIT_S)
            assert [alarm.kind for alarm in recorder.state.alarms] == [AlarmKind.UNCLEARED]
            failing[0] = False
            recorder.record("exo-01", 1, batch(3))
            assert recorder.flush(WAIT_S)
            assert (recorder.state.alarms, recorder.state.lost) == ((), 0)
        assert [row[3] for row in rows(kept(spool)[0])] == [0, 1, 2, 3]
    [alarm] = alarms
    assert alarm.text == (
        f"no room can be made in the spool {tmp_path}: Input/output error; what was uploaded stays in it"
    )


def test_a_mistake_of_ours_is_an_alarm_and_the_recorder_goes_on(
    spool: Spool, monkeypatch: pytest.MonkeyPatch
) -> None:
    alarms: list[Alarm] = []
    with Recorder(spool, alarms.append) as recorder:
        with monkeypatch.context() as broken:
            broken.setattr(spool, "make_room", lambda: 1 / 0)
            recorder._looked_s = -AGAIN_S
            recorder.record("exo-01", 1, batch(0))
            assert recorder.flush(WAIT_S)
        assert [alarm.kind for alarm in recorder.state.alarms] == [AlarmKind.BROKEN]
        assert recorder.state.lost > 0
        recorder.record("exo-01", 1, batch(1))
        assert recorder.flush(WAIT_S)
    assert [alarm.kind for alarm in alarms] == [AlarmKind.BROKEN]
    assert rows(kept(spool)[0])[-1][3] == 1


def test_what_is_lost_of_a_robot_of_which_nothing_was_kept_yet_is_told_in_its_recording(
    tmp_path: Path,
) -> None:
    with Spool(tmp_path, reserve_bytes=0) as spool:
        with Recorder(spool, settings=RecorderSettings(capacity=4)) as recorder:
            recorder.record("exo-01", 1, batch(0, rows=5))
            assert recorder.flush(WAIT_S)
        (event,) = events(spool, "lost")
        assert (event["robot"], json.loads(str(event["data"]))["rows"]) == ("exo-01", 5)


def test_the_flood_of_one_robot_takes_no_room_from_another_and_is_told_in_its_own_recording(
    tmp_path: Path,
) -> None:
    with StuckSpool(tmp_path) as spool:
        with Recorder(spool, lambda _alarm: None, RecorderSettings(capacity=100)) as recorder:
            recorder.record("good", 1, batch(0))
            assert spool.reached.wait(WAIT_S)
            for seq in range(500):
                recorder.record("bad", 1, batch(seq))
            for seq in range(1, 50):
                recorder.record("good", 1, batch(seq))
            assert recorder.state.lost == 450
            spool.let_go.set()
            assert recorder.flush(WAIT_S)
        (event,) = events(spool, "lost")
        assert (event["robot"], json.loads(str(event["data"]))["rows"]) == ("bad", 450)
        assert len(rows(kept(spool)[0])) == 100
