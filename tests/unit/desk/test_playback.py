"""A recorded session played: from store and spool, row by row, never live and never twice."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest

from ml.store import Store, StoreError
from server_gui.core.archive import playback as module
from server_gui.core.archive.playback import Playback
from server_gui.core.cloud import spool_reader
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.cloud.tape import Rows, Tape
from server_gui.core.desk.desk import Shown
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from tests.support.waiting import WAIT_S
from tests.unit.cloud.recordings import UNITS
from tests.unit.recording.robots import CHANNELS, batch, described, description

BATCHES, ROWS = 100, 5


@pytest.fixture
def settings(tmp_path: Path, folder_url: str) -> ServerSettings:
    return ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path / "spool"))


def record(settings: ServerSettings, *, sent: bool = True) -> None:
    """`BATCHES` notifications, 10 ms after each other, the UTC of which is as regular as their stamps."""
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            recorder.describe("exo-01", description("exo-01"))
            recorder.begin("exo-01", Facts(units=UNITS))
            for seq in range(BATCHES):
                recorder.record("exo-01", 1, batch(seq + (seq >= 10), ROWS), 0)
            recorder.mark("exo-01", "here")
        for number in spool.waiting() if sent else ():
            send(spool, number, Store(settings.store.url))


def tape_of(settings: ServerSettings) -> Tape:
    found = Recordings(settings.store.url, settings.recorder.spool).sessions()
    return Tape.open(settings, found[-1])


def at_once(work: Callable[[], Rows]) -> "Future[Rows]":
    future: Future[Rows] = Future()
    try:
        future.set_result(work())
    except StoreError as error:
        future.set_exception(error)
    return future


def player(tape: Tape, read: "Callable[[Callable[[], Rows]], Future[Rows]]" = at_once) -> Playback:
    made = Playback(read, lambda call: call(), Shown())
    made.open(tape)
    return made


def settle(playback: Playback) -> None:
    for _ in range(20):
        playback.step()
    assert not playback.is_loading


@pytest.mark.parametrize("sent", [True, False])
def test_every_row_is_there_whether_it_is_uploaded_or_waits(settings: ServerSettings, sent: bool) -> None:
    record(settings, sent=sent)
    tape = tape_of(settings)
    rows = tape.read(tape.first_ns, tape.last_ns)
    assert len(rows) == BATCHES * ROWS
    assert (np.diff(rows.stamps_ns) > 0).all()
    assert dict(tape.units) == UNITS
    assert {event["kind"] for event in tape.events} == {"gap", "marker"}


def test_a_session_half_in_the_store_and_half_in_the_spool_is_whole_and_nothing_is_there_twice(
    settings: ServerSettings,
) -> None:
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.describe("exo-01", description("exo-01"))
        recorder.begin("exo-01", Facts())
        for seq in range(10):
            recorder.record("exo-01", 1, batch(seq, ROWS), 0)
        recorder.cut(lambda: None)
        assert recorder.flush(WAIT_S)
        before = Tape.open(settings, spool_reader.sessions(settings.recorder.spool)[0])
        send(spool, spool.waiting()[0], Store(settings.store.url))
        for seq in range(10, 20):
            recorder.record("exo-01", 1, batch(seq, ROWS), 0)
        assert recorder.flush(WAIT_S)
        tape = tape_of(settings)
        rows = tape.read(tape.first_ns, tape.last_ns)
        assert rows.columns[CHANNELS[0]].tolist() == [
            seq + row / 1000 for seq in range(20) for row in range(ROWS)
        ]
        assert len(before.read(tape.first_ns, tape.last_ns)) == 10 * ROWS
        for file in settings.recorder.spool.glob("*.uploaded.db*"):  # as where room was needed
            file.unlink()
        assert len(before.read(before.first_ns, before.last_ns)) == 10 * ROWS


def test_values_in_two_units_are_two_channels_and_each_is_one_wherever_its_rows_are(
    settings: ServerSettings,
) -> None:
    store = Store(settings.store.url)
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.describe("exo-02", described("exo-02", {"knee": "rad"}))
        recorder.record("exo-02", 1, batch(0, channels=("knee",)), 0)
        recorder.begin("exo-01", Facts())
        for seq, unit in enumerate(("deg", "deg", "rad")):
            recorder.describe("exo-01", described("exo-01", {"knee": unit}))
            recorder.record("exo-01", 1, batch(seq, channels=("knee",)), 0)
            recorder.cut(lambda: None)
            assert recorder.flush(30.0)
        found = []
        for sent in (0, 1, 2):
            for number in spool.waiting()[:1] if sent else ():
                send(spool, number, store)
            known = Recordings(settings.store.url, settings.recorder.spool).sessions()
            tape = Tape.open(settings, next(each for each in known if each.robot == "exo-01"))
            rows = tape.read(tape.first_ns, tape.last_ns)
            found.append(
                (tape.units, {name: np.nan_to_num(each).tolist() for name, each in rows.columns.items()})
            )
        expected = {"knee": [0.0, 0.0, 2.0], "knee@deg": [0.0, 1.0, 0.0]}
        assert found == 3 * [({"knee": "rad", "knee@deg": "deg"}, expected)]


def test_a_session_without_telemetry_is_refused_with_a_sentence(settings: ServerSettings) -> None:
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.begin("exo-01", Facts())
    with pytest.raises(StoreError, match="has no telemetry, neither in the store nor in the spool"):
        tape_of(settings)


def test_a_jump_shows_what_was_until_that_instant_and_nothing_later(settings: ServerSettings) -> None:
    record(settings)
    tape = tape_of(settings)
    rows = tape.read(tape.first_ns, tape.last_ns)
    playback = player(tape)
    for share in (0.5, 0.2, 1.0):
        wanted_ns = tape.first_ns + round(share * (tape.last_ns - tape.first_ns))
        playback.seek(wanted_ns)
        settle(playback)
        before = int(np.searchsorted(rows.utc_ns, wanted_ns))
        station = playback.desk.stations[0]
        assert station.robot.values[CHANNELS[0]] == rows.columns[CHANNELS[0]][before - 1]
        assert len(station.rings.times(100.0)) >= before


def test_a_recording_begins_with_its_first_row_instead_of_nothing(settings: ServerSettings) -> None:
    record(settings)
    tape = tape_of(settings)
    playback = player(tape)
    settle(playback)
    robot, rows = playback.desk.stations[0].robot, tape.read(tape.first_ns, tape.last_ns)
    assert playback.position_ns == tape.first_ns
    assert robot.values[CHANNELS[0]] == rows.columns[CHANNELS[0]][0]
    assert not robot.is_stale()


def test_playing_goes_on_with_time_and_stops_at_the_end(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(settings)
    playback = player(tape_of(settings))
    settle(playback)
    now_s = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    playback.speed = 2.0
    playback.play(on=True)
    seen = [playback.position_ns]
    for _ in range(120):
        now_s[0] += 0.01
        playback.step()
        seen.append(playback.position_ns)
    assert seen == sorted(seen)
    assert seen[11] - seen[1] == pytest.approx(0.2e9, rel=1e-3)  # ten frames of 10 ms, twice as fast
    tape = playback.tape
    assert tape is not None
    assert playback.position_ns == tape.last_ns
    assert not playback.playing
    playback.play(on=True)
    assert playback.position_ns == tape.first_ns, "it begins again"


def test_data_of_a_recording_grow_old_in_its_own_time(settings: ServerSettings) -> None:
    record(settings)
    playback = player(tape_of(settings))
    settle(playback)
    playback.seek(playback.position_ns + 100_000_000)
    settle(playback)
    robot = playback.desk.stations[0].robot
    assert not robot.is_stale(time.monotonic_ns() + 10**12)
    robot.shown_ns += 10**9  # type: ignore[attr-defined]
    assert robot.is_stale()


def test_what_cannot_be_read_is_said_and_tried_again_with_the_next_jump(settings: ServerSettings) -> None:
    record(settings)
    tape = tape_of(settings)
    away = [True]

    def read(work: Callable[[], Rows]) -> "Future[Rows]":
        def fail() -> Rows:
            raise StoreError("the store cannot be reached")

        return at_once(fail if away[0] else work)

    playback = player(tape, read)
    playback.step()
    assert playback.problem == "the store cannot be reached"
    away[0] = False
    playback.seek(tape.last_ns)
    settle(playback)
    assert playback.problem == ""


def test_nothing_can_be_asked_of_a_recording(settings: ServerSettings) -> None:
    record(settings)
    playback = player(tape_of(settings))
    station = playback.desk.stations[0]
    station.stop("by mistake")
    assert "NOT CONFIRMED" in station.stopping.text
    assert "this is a recording" in station.stopping.text


def test_memory_is_bounded_however_long_the_session_is(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PIECE_NS", 10_000_000)
    monkeypatch.setattr(module, "LEAD_NS", 20_000_000)
    record(settings)
    playback = player(tape_of(settings))
    tape = playback.tape
    assert tape is not None
    for position_ns in range(tape.first_ns, tape.last_ns, 15_000_000):
        playback.seek(position_ns)
        settle(playback)
    assert len(playback._pieces) <= module.PIECES
