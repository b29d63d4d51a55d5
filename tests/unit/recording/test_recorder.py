"""The recorder: everything, never decimated; what is lost is told; nobody waits for the disk."""

import collections
import dataclasses
import errno
import json
import math
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from gateway.client import Batch
from ml.store.labels import Label
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.recorder import AGAIN_S, Alarm, AlarmKind, Recorder, RecorderSettings
from server_gui.core.recording.records import Facts, label
from server_gui.core.recording.rows import JournalHead, Record, Run
from server_gui.core.recording.spool import Spool
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import CHANNELS, batch, description, stamp_ns, value


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    with Spool(tmp_path / "spool", reserve_bytes=0) as opened:
        yield opened


def kept(spool: Spool) -> tuple[list[Run], list[Record]]:
    """Everything in the frozen segments."""
    runs: list[Run] = []
    records: list[Record] = []
    for number in spool.waiting():
        segment = spool.read(number)
        runs += segment.runs()
        records += segment.records()
        segment.close()
    return runs, records


def rows(runs: Sequence[Run]) -> list[tuple[str, str, int, int, int]]:
    return [
        (run.robot, run.connection, run.stream, int(seq), int(row))
        for run in runs
        for seq, row in zip(run.seqs, run.rows, strict=True)
    ]


def events(spool: Spool, *kinds: str) -> list[dict[str, object]]:
    return [
        record.fields
        for record in kept(spool)[1]
        if record.table == "events" and record.fields["kind"] in kinds
    ]


def test_every_row_of_every_robot_is_kept_with_its_values(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for robot in ("exo-01", "exo-02"):
            recorder.describe(robot, description(robot))
            for seq in range(20):
                recorder.record(robot, 4, batch(seq, rows=3, missing=CHANNELS[1:2]))
    runs, _ = kept(spool)
    found = rows(runs)
    assert len(found) == len(set(found)) == 2 * 20 * 3
    assert runs[0].layout.channels == CHANNELS
    assert runs[0].layout.units == ("rad", "rad/s", "rad")
    for run in runs:
        for i, (seq, row) in enumerate(zip(run.seqs, run.rows, strict=True)):
            assert run.stamps_ns[i] == stamp_ns(seq, row)
            assert run.values[0, i] == value(seq, row, 0)
            assert math.isnan(run.values[1, i])
            assert run.values[2, i] == value(seq, row, 2)


def test_acknowledged_means_on_the_disk(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        number = recorder.record("exo-01", 1, batch(0))
        assert recorder.flush(WAIT_S)
        assert recorder.acknowledged >= number
        assert recorder.state.recorded >= 1
        assert spool.rows >= 1


def test_a_stream_that_changes_its_columns_goes_on_in_another_run(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
        recorder.record("exo-01", 1, batch(1, channels=CHANNELS[:1]))
    assert sorted(run.layout.channels for run in kept(spool)[0]) == [CHANNELS[:1], CHANNELS]


def test_a_new_link_is_a_new_connection_and_a_gap(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0, link=1))
        recorder.record("exo-01", 1, batch(0, rows=2, link=2))
    runs, _ = kept(spool)
    assert len({run.connection for run in runs}) == 2
    (gap,) = events(spool, "gap")
    assert [gap["connection"]] == [run.connection for run in runs if len(run) == 2]


def test_missing_notifications_and_dropped_rows_are_events(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0, dropped=2))
        recorder.record("exo-01", 1, batch(4, dropped=2, missed=3))
        recorder.record("exo-01", 1, batch(5, dropped=9))
    found = [(event["kind"], json.loads(str(event["data"]))) for event in events(spool, "gap", "dropped")]
    assert found == [
        ("dropped", {"stream": 1, "seq": 0, "rows": 2}),
        ("gap", {"stream": 1, "seq": 4, "missed": 3}),
        ("dropped", {"stream": 1, "seq": 5, "rows": 7}),
    ]


def test_times_in_utc_follow_the_clock_offset(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        first = batch(0)
        recorder.record("exo-01", 1, first, clock_offset_ns=first.stamps_ns[0] - first.received_ns - 1_000)
        recorder.record("exo-01", 1, batch(1), clock_offset_ns=None)
    (run,) = kept(spool)[0]
    assert len(set(run.utc_offset_ns)) == 2


def test_a_session_begins_by_itself_and_ends_with_the_recorder(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
        recorder.begin("exo-01", Facts(operator="Ada", parameters={"gait.step_length": 0.4}))
        recorder.record("exo-01", 1, batch(1))
    runs, records = kept(spool)
    sessions = [record.fields for record in records if record.table == "sessions"]
    assert [(session["operator"], session["ended"] is not None) for session in sessions] == [
        ("", False),
        ("", True),
        ("Ada", False),
        ("Ada", True),
    ]
    assert [run.session for run in runs] == [sessions[0]["session"], sessions[2]["session"]]


def test_a_name_that_differs_or_repeats_is_an_event(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.describe("left", description("exo"))
        recorder.describe("exo", description("exo"))
    assert [event["text"] for event in events(spool, "name")] == [
        "left in the server's file calls itself exo",
        "exo and left both call themselves exo",
    ]


def test_a_name_that_a_robot_has_given_up_is_free(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for robot, name in (("exo-01", "exo-02"), ("exo-01", "exo-01"), ("exo-02", "exo-02")):
            recorder.describe(robot, description(name))
    assert [event["text"] for event in events(spool, "name")] == [
        "exo-01 in the server's file calls itself exo-02"
    ]


def test_a_reboot_is_no_clock_that_was_set(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for link, offset_ns in ((1, 10**15), (2, -(10**12))):
            recorder.record("exo-01", 1, batch(0, link=link), offset_ns)
    assert len(events(spool, "gap")) == 1
    assert events(spool, "clock_step") == []


def test_journal_entries_are_kept_once(spool: Spool) -> None:
    entries = [{"n": n, "hash": f"h{n}", "utc_ns": n, "who": "ada", "what": "write"} for n in range(1, 8)]
    with Recorder(spool) as recorder:
        recorder.journal("exo-01", entries[:2])
        recorder.journal("exo-01", entries[:3])
        assert recorder.flush(WAIT_S)
        recorder.journal("exo-01", entries[1:4])
        recorder.journal("exo-01", entries[5:7])
    numbers = [record.fields["n"] for record in kept(spool)[1] if record.table == "journal"]
    assert numbers == [1, 2, 3, 4, 6, 7]
    assert spool.heads["exo-01"] == JournalHead(7, "h7")
    (gap,) = events(spool, "journal_gap")
    assert json.loads(str(gap["data"])) == {"missing": 1}


def test_markers_and_labels_are_kept(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.mark("exo-01", "stumbled", foot="left")
        recorder.add(label(Label("exo-01", "s", 1, 2, "walking", "ada")))
    (marker,) = events(spool, "marker")
    assert (marker["text"], json.loads(str(marker["data"]))) == ("stumbled", {"foot": "left"})
    assert [record.fields["label"] for record in kept(spool)[1] if record.table == "labels"] == ["walking"]


@pytest.mark.parametrize("table", ["telemetry", "robots"])
def test_a_row_that_no_upload_would_take_is_refused(spool: Spool, table: str) -> None:
    fields = {"robot": "exo-01", "session": "s", "utc": 1, "stamp_ns": 1}
    with Recorder(spool) as recorder, pytest.raises(ValueError, match=f"no table {table} that takes single"):
        recorder.add(Record(table, fields))
    assert spool.waiting() == []


class StuckSpool(Spool):
    """A spool whose disk answers only when it is let go, or refuses."""

    def __init__(self, folder: Path) -> None:
        self.let_go = threading.Event()
        self.reached = threading.Event()
        self.refusals = 0
        super().__init__(folder, reserve_bytes=0)

    def append(self, *args: object, **more: object) -> None:
        self.reached.set()
        self.let_go.wait(WAIT_S)
        if self.refusals:
            self.refusals -= 1
            raise SpoolUnusable("the disk refuses")
        super().append(*args, **more)  # type: ignore[arg-type]


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


def test_a_batch_is_frozen_when_it_is_long_enough(spool: Spool) -> None:
    with Recorder(spool, settings=RecorderSettings(batch_rows=10)) as recorder:
        recorder.record("exo-01", 1, batch(0, rows=12))
        assert recorder.flush(WAIT_S)
        assert spool.waiting() == [1]


def test_a_notification_without_rows_still_tells_what_was_lost(spool: Spool) -> None:
    empty = Batch([], {name: [] for name in CHANNELS}, 3, 5, 0, 1, 1)
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, empty)
    assert len(events(spool, "dropped")) == 1


def test_what_a_robot_sends_wrongly_is_refused_and_told_once_and_disturbs_no_other(spool: Spool) -> None:
    ragged = Batch([1, 2], {"a.b": [0.5]}, 0, 0, 0, 1, 1)
    huge = Batch([2**63], {"a.b": [0.5]}, 1, 0, 0, 1, 1)
    unnamed = Batch([1], {"a\x00b": [0.5]}, 1, 0, 0, 1, 1)
    with Recorder(spool) as recorder:
        for wrong in (ragged, huge, unnamed, ragged):
            recorder.record("bad", 1, wrong)
        recorder.journal("bad", [{"nonsense": True}])
        recorder.record("good", 1, batch(0))
        assert recorder.flush(WAIT_S)
        assert recorder.state.lost == 2 + 1 + 1 + 2 + 1
    assert [row[0] for row in rows(kept(spool)[0])] == ["good"]
    (event,) = events(spool, "refused")
    assert event["text"] == "bad sent what cannot be kept: 2 stamps, but 1 values of a channel"


def test_numbers_that_begin_anew_without_a_new_link_keep_their_rows_apart(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for seq in (0, 1, 0, 0):
            recorder.record("exo-01", 1, batch(seq))
    found = rows(kept(spool)[0])
    assert len(found) == len(set(found)) == 4
    assert len(events(spool, "gap")) == 2


def test_what_is_missing_between_the_link_and_the_recorder_is_a_gap_too(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for seq in (0, 1, 5, 6):
            recorder.record("exo-01", 1, batch(seq))
    (gap,) = events(spool, "gap")
    assert json.loads(str(gap["data"])) == {"stream": 1, "seq": 5, "missed": 3}


def test_a_session_of_which_more_becomes_known_is_told_again_under_its_name(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.amend("exo-01", Facts(operator="nobody"))  # there is none
        name = recorder.begin("exo-01", Facts(operator="Ada"))
        recorder.amend("exo-01", Facts(operator="Ada", parameters={"gait.step_length": 0.4}))
    sessions = [record.fields for record in kept(spool)[1] if record.table == "sessions"]
    assert {session["session"] for session in sessions} == {name}
    assert [json.loads(str(session["parameters"])) for session in sessions] == [
        {},
        *2 * [{"gait.step_length": 0.4}],
    ]


def test_a_description_that_comes_between_rows_changes_the_units_of_those_after_it(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
        recorder.describe("exo-01", description("exo-01"))
        recorder.record("exo-01", 1, batch(1))
    found = {int(seq): run.layout.units for run in kept(spool)[0] for seq in run.seqs}
    assert found == {0: (None, None, None), 1: ("rad", "rad/s", "rad")}


def test_a_robot_that_sends_fewer_rows_to_save_work_is_told(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for seq, shed in enumerate((1, 1, 4, 4, 1)):
            recorder.record("exo-01", 1, dataclasses.replace(batch(seq), shed=shed))
    told = [json.loads(str(event["data"])) for event in events(spool, "shed")]
    assert [(found["seq"], found["shed"]) for found in told] == [(2, 4), (4, 1)]


@pytest.mark.parametrize(
    "lie",
    [
        {"n": 1, "hash": {"a": 1}},
        {"n": 1, "hash": None},
        {"n": 2**63 + 5, "hash": "h"},
        {"n": 2**70, "hash": "h"},
    ],
)
def test_a_journal_that_lies_keeps_nothing_of_any_robot_from_the_disk(
    spool: Spool, lie: dict[str, Any]
) -> None:
    with Recorder(spool) as recorder:
        recorder.journal("bad", [{"n": 1, "hash": "h1"}])
        recorder.journal("bad", [lie])
        for seq in range(3):
            recorder.record("good", 1, batch(seq))
            assert recorder.flush(WAIT_S)
        recorder.journal("bad", [{"n": 1, "hash": "h1"}, {"n": 2, "hash": "h2"}])
        assert recorder.flush(WAIT_S)
        assert recorder.state.alarms == ()
    found = kept(spool)
    assert [row[3] for row in rows(found[0])] == [0, 1, 2]
    assert [record.fields["n"] for record in found[1] if record.table == "journal"] == [1, 2]
    assert spool.heads["bad"] == JournalHead(2, "h2")
    assert len(events(spool, "refused")) == 1


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
        f"no room can be made in the spool {tmp_path}: Input/output error; "
        "recording goes on as long as there is room"
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


@pytest.mark.parametrize(
    "value",
    [math.inf, -math.inf, math.nan, "1", [1.0], 10**400],
    ids=["inf", "-inf", "nan", "text", "list", "large"],
)
@pytest.mark.parametrize("missing", [(), CHANNELS[:1]])
def test_a_value_that_is_no_finite_number_is_refused_and_disturbs_no_other_robot(
    spool: Spool, value: Any, missing: tuple[str, ...]
) -> None:
    unfit = batch(0, rows=2, missing=missing)
    unfit.columns[CHANNELS[0]][1] = value
    with Recorder(spool) as recorder:
        recorder.record("good", 1, batch(0))
        recorder.record("bad", 1, unfit)
        recorder.record("bad", 1, batch(1, missing=missing))
    assert sorted((row[0], row[3]) for row in rows(kept(spool)[0])) == [("bad", 1), ("good", 0)]
    [event] = events(spool, "refused")
    assert f"bad sent what cannot be kept: a value of '{CHANNELS[0]}' is no number" in str(event["text"])


def test_a_first_notification_that_is_unfit_begins_no_session_that_nobody_is_told_of(spool: Spool) -> None:
    unfit = batch(0)
    unfit.columns[CHANNELS[0]].append(1.0)
    with Recorder(spool) as recorder:
        recorder.record("exo-01", 1, unfit)
        assert recorder.flush(WAIT_S)
        recorder.record("exo-01", 1, batch(1))
        recorder.cut(lambda: None)
        assert recorder.flush(WAIT_S)
        runs, records = kept(spool)  # before its end, which is told again
    told = {record.fields["session"] for record in records if record.table == "sessions"}
    assert told == {run.session for run in runs}


def test_a_prediction_has_the_utc_of_the_rows_of_its_own_session(spool: Spool) -> None:
    """One that comes late, when the robot's computer has started anew."""
    with Recorder(spool) as recorder:
        sessions = []
        for link, offset_ns in ((1, 0), (2, -(10**15))):
            sessions.append(recorder.begin("exo-01", Facts()))
            recorder.record("exo-01", 1, batch(0, link=link), offset_ns)
        for session in (*sessions, "another"):
            fields = {"robot": "exo-01", "session": session, "utc": 7, "stamp_ns": stamp_ns(0, 0)}
            recorder.add(Record("predictions", fields))
    runs, records = kept(spool)
    rows_ns = {run.session: int(run.stamps_ns[0] + run.utc_offset_ns[0]) for run in runs}
    said_ns = {each.fields["session"]: each.fields["utc"] for each in records if each.table == "predictions"}
    assert said_ns == {**rows_ns, "another": 7}


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
