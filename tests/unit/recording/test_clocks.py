"""Clocks that are set while something is recorded: what came later stays later, each row in its place."""

import contextlib
import json
import shutil
import time
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from gateway.client import Batch
from ml.store import Store, sessions
from ml.store.labels import Label, holding
from ml.store.query import query
from ml.store.sessions import Session
from ml.store.tables import LABELS
from ml.training.recorded import Recorded, recorded
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts, label
from server_gui.core.recording.rows import Layout, Record, Run
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.support.waiting import WAIT_S

ROBOT, KNEE = "exo-01", "left_knee.position"
MS, S = 10**6, 10**9
ROW_NS = 10 * MS
PER_BATCH = 5
ROBOT_NS = 7_000 * S  # its monotonic clock minus ours


class Wall:
    """This server's wall clock, which may be set."""

    def __init__(self, real: Callable[[], int]) -> None:
        self._real = real
        self.set_by_ns = 0

    def time_ns(self) -> int:
        return self._real() + self.set_by_ns


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    found = Wall(time.time_ns)
    monkeypatch.setattr(time, "time_ns", found.time_ns)
    return found


class Robot:
    """A stream of rows, ten milliseconds apart on its own clock, each batch received as its newest row is."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._began_ns = time.monotonic_ns() - 60 * S
        self._rows = 0
        self._seq = 0
        self.link = 1

    def rows(self, count: int, robot_ns: int = ROBOT_NS) -> None:
        for first in range(self._rows, self._rows + count, PER_BATCH):
            at = range(first, first + PER_BATCH)
            stamps_ns = [self._began_ns + ROBOT_NS + row * ROW_NS for row in at]
            received_ns = stamps_ns[-1] - ROBOT_NS
            values: list[float | None] = [float(row) for row in at]
            batch = Batch(stamps_ns, {KNEE: values}, self._seq, 0, 0, self.link, received_ns)
            self._recorder.record(ROBOT, 1, batch, robot_ns)
            self._seq += 1
        self._rows += count

    def reconnect(self) -> None:
        """After a while in which nothing was seen."""
        self.link, self._seq = self.link + 1, 0
        self._rows += 100


@contextlib.contextmanager
def begun(spool: Spool, facts: Facts | None = None) -> Iterator[tuple[Recorder, Robot]]:
    """A session with ten rows, which goes on."""
    with Recorder(spool) as recorder:
        recorder.begin(ROBOT, facts or Facts())
        robot = Robot(recorder)
        robot.rows(10)
        yield recorder, robot


def stored(spool: Spool, url: str) -> tuple[Store, Session]:
    store = Store(url)
    for number in spool.waiting():
        send(spool, number, store)
    (session,) = sessions.sessions(store)
    return store, session


def exported(store: Store, session: Session) -> list[tuple[datetime, float]]:
    found = [row for table in sessions.telemetry(store, session, [KNEE]) for row in table.to_pylist()]
    return [(row["utc"], row[KNEE]) for row in found]


def rows_of(store: Store, session: Session) -> Recorded:
    return recorded(store, ROBOT, session.session, [KNEE])


def steps(store: Store, session: Session) -> list[dict[str, object]]:
    found = [row for row in sessions.rows_of(store, session) if row["kind"] == "clock_step"]
    return [json.loads(row["data"]) for row in found]


@pytest.mark.parametrize("by_ns", [-50 * MS, 50 * MS, -3_600 * S, 86_400 * S])
def test_a_clock_that_is_set_moves_no_row_and_no_label(
    spool: Spool, folder_url: str, wall: Wall, by_ns: int
) -> None:
    with begun(spool) as (_, robot):
        wall.set_by_ns += by_ns
        robot.rows(20)
    store, session = stored(spool, folder_url)
    found = exported(store, session)
    assert [value for _, value in found] == list(range(30))
    in_us = [int(utc.timestamp() * 1e6 + 0.5) for utc, _ in found]
    assert set(np.diff(in_us)) == {ROW_NS // 1000}
    rows = rows_of(store, session)
    assert rows.at_utc(rows.utc_ns[10:11]).tolist() == [rows.stamps_ns[10]]
    (step,) = steps(store, session)
    assert step["whose"] == "this server's clock"
    assert int(str(step["to"])) - int(str(step["from"])) == pytest.approx(by_ns, abs=5 * MS)


def test_the_next_connection_takes_a_clock_that_was_set_forward(
    spool: Spool, folder_url: str, wall: Wall
) -> None:
    with begun(spool) as (_, robot):
        wall.set_by_ns += 3_600 * S
        robot.reconnect()
        robot.rows(10)
    rows = rows_of(*stored(spool, folder_url))
    offsets = rows.utc_ns - rows.stamps_ns
    assert offsets[-1] - offsets[0] == pytest.approx(3_600 * S, abs=5 * MS)
    assert len(set(offsets // MS)) <= 4  # two, but for rounding


def test_one_that_was_set_back_only_with_the_next_session(spool: Spool, folder_url: str, wall: Wall) -> None:
    with begun(spool) as (recorder, robot):
        wall.set_by_ns -= 3_600 * S
        robot.reconnect()
        robot.rows(10)
        assert recorder.flush(WAIT_S)
        first = recorder.begin(ROBOT, Facts())
        robot.reconnect()
        robot.rows(10)
    store = Store(folder_url)
    for number in spool.waiting():
        send(spool, number, store)
    of_both = sorted(sessions.sessions(store), key=lambda each: each.session == first)
    before, after = (rows_of(store, each) for each in of_both)
    assert (np.diff(before.utc_ns) > 0).all()
    offsets = (after.utc_ns - after.stamps_ns)[0], (before.utc_ns - before.stamps_ns)[0]
    assert offsets[0] - offsets[1] == pytest.approx(-3_600 * S, abs=5 * MS)


def test_a_robots_clock_that_jumps_is_told(spool: Spool, folder_url: str) -> None:
    with Recorder(spool) as recorder:
        robot = Robot(recorder)
        robot.rows(10)
        robot.rows(10, ROBOT_NS + 5 * S)
    store, session = stored(spool, folder_url)
    (step,) = steps(store, session)
    assert step["whose"] == "the robot's monotonic clock"
    assert int(str(step["to"])) - int(str(step["from"])) == 5 * S
    assert (np.diff(rows_of(store, session).utc_ns) > 0).all()


def test_a_better_estimate_of_the_robots_clock_is_followed_and_nothing_goes_back(
    spool: Spool, folder_url: str
) -> None:
    with Recorder(spool) as recorder:
        robot = Robot(recorder)
        robot.rows(100)
        robot.rows(100, ROBOT_NS + MS // 10)
        robot.rows(100, ROBOT_NS + 30 * MS)
    rows = rows_of(*stored(spool, folder_url))
    assert (np.diff(rows.utc_ns) > 0).all()
    offsets = rows.utc_ns - rows.stamps_ns
    assert offsets[0] - offsets[199] == pytest.approx(MS // 10, abs=2_000)
    assert 0 < offsets[199] - offsets[-1] < 2 * MS


def test_events_and_resources_are_in_the_time_of_their_robots_rows(
    spool: Spool, folder_url: str, wall: Wall
) -> None:
    with begun(spool) as (recorder, _):
        assert recorder.flush(WAIT_S)
        wall.set_by_ns -= 3_600 * S
        recorder.mark(ROBOT, "here")
    store, session = stored(spool, folder_url)
    (marker,) = [row for row in sessions.rows_of(store, session) if row["kind"] == "marker"]
    assert session.began is not None
    assert session.ended is not None
    assert session.began <= marker["utc"] <= session.ended


def test_what_is_learned_after_a_clock_was_set_back_holds(spool: Spool, folder_url: str, wall: Wall) -> None:
    with begun(spool, Facts(parameters={"gain": 1.0})) as (recorder, _):
        assert recorder.flush(WAIT_S)
        wall.set_by_ns -= 3_600 * S
        recorder.amend(ROBOT, Facts(parameters={"gain": 2.0}))
    _, session = stored(spool, folder_url)
    assert session.parameters == {"gain": 2.0}
    assert session.began is not None
    assert session.ended is not None
    assert session.ended >= session.began


def test_a_label_that_was_taken_back_after_a_clock_was_set_back_is_gone(
    spool: Spool, folder_url: str, wall: Wall
) -> None:
    with Recorder(spool) as recorder:
        name = recorder.begin(ROBOT, Facts())
        now_ns = time.time_ns()
        walk = Label(ROBOT, name, now_ns, now_ns + S, "walk", "ada")
        recorder.add(label(walk))
        assert recorder.flush(WAIT_S)
        wall.set_by_ns -= 3_600 * S
        recorder.add(label(walk, removed=True))
    store, session = stored(spool, folder_url)
    assert len(sessions.rows_of(store, session, LABELS)) == 2
    assert sessions.labels(store, session) == []
    with query(store, "SELECT count(*) AS labels FROM labels") as found:
        assert next(found.batches).to_pylist() == [{"labels": 0}]


def test_between_two_spools_the_time_says_what_came_later_and_in_one_the_batch() -> None:
    def row(spool: str, batch: int, written: int, *, removed: bool) -> dict[str, object]:
        walk = Label(ROBOT, "s", S, 2 * S, "walk", "ada").row(written, removed=removed)
        return {**walk, "spool": spool, "batch": batch, "number": 0}

    given, taken = row("a/1", 1, 9, removed=False), row("a/2", 2, 5, removed=True)
    assert holding([given, taken]) == holding([taken, given]) == []
    assert holding([given, taken, row("b", 1, 7, removed=False)]) != []
    assert holding([given, taken, row("b", 1, 4, removed=False)]) == []


@pytest.mark.parametrize("says", ["removed last", "given last"])
@pytest.mark.parametrize("how", ["older copy", "clock set back"])
def test_the_later_opening_of_a_spool_says_what_holds(
    tmp_path: Path, folder_url: str, wall: Wall, how: str, says: str
) -> None:
    folder, store, removed = tmp_path / "spool", Store(folder_url), says == "removed last"
    walk = Label(ROBOT, "s", S, 2 * S, "walk", "ada")

    def say(batches: int, *, removed: bool) -> None:
        with Spool(folder, reserve_bytes=0) as spool:
            with Recorder(spool) as recorder:
                for _ in range(batches):
                    recorder.mark(ROBOT, "another batch")
                    recorder.cut(lambda: None)
                    assert recorder.flush(WAIT_S)
                recorder.add(label(walk, removed=removed))
            for number in spool.waiting():
                send(spool, number, store)

    say(0, removed=removed)
    if how == "older copy":
        shutil.copytree(folder, tmp_path / "copy")
    say(3, removed=not removed)
    if how == "older copy":
        shutil.rmtree(folder)
        (tmp_path / "copy").rename(folder)
    else:
        wall.set_by_ns -= 3_600 * S
    say(0, removed=removed)
    expected = [] if removed else ["walk"]
    assert [row["label"] for row in holding(store.dataset("labels").to_table().to_pylist())] == expected
    with query(store, "SELECT label FROM labels") as found:
        assert [row["label"] for rows in found.batches for row in rows.to_pylist()] == expected


def test_rows_whose_utc_went_back_come_in_the_order_of_the_robots_clock(
    spool: Spool, folder_url: str
) -> None:
    """As earlier versions recorded them."""
    layout = Layout((KNEE,), ("rad",))
    now_ns = time.time_ns()

    def run(first: int, set_by_ns: int) -> Run:
        places = np.arange(first, first + 10, dtype=np.int64)
        offset_ns = np.full(10, now_ns + set_by_ns)
        seqs = np.zeros(10, np.int64) + first
        values = places.astype(np.float64)[None]
        return Run(ROBOT, "s", "c", 1, layout, places * ROW_NS, seqs, places - first, offset_ns, values)

    began = {"robot": ROBOT, "session": "s", "utc": now_ns, "began": now_ns}
    spool.append([run(0, 0), run(10, -50 * MS), run(20, -3_600 * S)], [Record("sessions", began)])
    spool.freeze()
    found = exported(*stored(spool, folder_url))
    assert [value for _, value in found] == list(range(30))
