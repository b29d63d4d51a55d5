"""The recorder keeps everything, never decimated; what is unfit is refused, gaps are told."""

import dataclasses
import json
import math
from typing import Any

import pytest

from gateway.client import Batch
from ml.store.labels import Label
from server_gui.core.recording.recorder import Recorder, RecorderSettings
from server_gui.core.recording.records import Facts, label
from server_gui.core.recording.rows import JournalHead, Record
from server_gui.core.recording.spool import Spool
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import CHANNELS, batch, description, stamp_ns, value
from tests.unit.recording.spools import events, kept, rows


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
        "left calls itself exo in its own file: give it one name, in [robot] there or here (exo=HOST:PORT)",
        "exo and left both call themselves exo",
    ]


def test_a_name_that_a_robot_has_given_up_is_free(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for robot, name in (("exo-01", "exo-02"), ("exo-01", "exo-01"), ("exo-02", "exo-02")):
            recorder.describe(robot, description(name))
    assert [event["text"] for event in events(spool, "name")] == [
        (
            "exo-01 calls itself exo-02 in its own file: give it one name, in [robot] there or here "
            "(exo-02=HOST:PORT)"
        )
    ]


def test_a_robot_that_was_removed_shares_its_name_with_nobody(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.describe("left", description("exo"))
        recorder.leave("left")
        recorder.describe("exo", description("exo"))
        recorder.describe("left", description("exo"))
    assert [event["text"] for event in events(spool, "name")] == [
        "left calls itself exo in its own file: give it one name, in [robot] there or here (exo=HOST:PORT)",
        "left calls itself exo in its own file: give it one name, in [robot] there or here (exo=HOST:PORT)",
        "left and exo both call themselves exo",
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


def test_a_gap_says_whether_the_link_or_this_computer_has_lost_it(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for each in (batch(0), batch(4, missed=3), batch(8), batch(14, missed=2)):
            recorder.record("exo-01", 1, each)
    came = "but this computer was too busy to keep them"
    assert [event["text"] for event in events(spool, "gap")] == [
        "3 notifications were lost on the link to the robot",
        f"3 notifications were not recorded: all came, {came}",
        f"5 notifications were not recorded: 2 were lost on the link to the robot, the others came, {came}",
    ]


def test_what_comes_while_nobody_wants_it_recorded_is_no_gap(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        for seq in (0, 400):
            recorder.begin("exo-01", Facts())
            for stream in (1, 2):
                recorder.record("exo-01", stream, batch(seq, dropped=seq))
            recorder.end("exo-01")
        recorder.begin("exo-01", Facts())
        recorder.record("exo-01", 1, batch(0, link=2))
        assert recorder.flush(WAIT_S)
        assert events(spool, "gap", "dropped") == [], "of what was not wanted"
        recorder.record("exo-01", 1, batch(3, missed=2, link=2))
    (gap,) = events(spool, "gap")
    assert json.loads(str(gap["data"]))["missed"] == 2


def test_a_stream_that_comes_no_more_after_a_rest_hides_no_link_that_was_lost(spool: Spool) -> None:
    with Recorder(spool) as recorder:
        recorder.begin("exo-01", Facts())
        for stream in (1, 2):
            recorder.record("exo-01", stream, batch(0))
        recorder.end("exo-01")
        recorder.begin("exo-01", Facts())
        recorder.record("exo-01", 1, batch(1))
        recorder.record("exo-01", 1, batch(0, link=2))
    assert len(events(spool, "gap")) == 1
