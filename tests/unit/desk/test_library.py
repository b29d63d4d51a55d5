"""What store and spool hold, and jobs on them: told, tried again, cancelled."""

import threading
import time
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ml.store import Store
from ml.store.sessions import find
from server_gui.core.archive.library import Library, _local, look
from server_gui.core.cloud import actions
from server_gui.core.cloud.jobs import Cancelled, Job, Jobs, JobState
from server_gui.core.cloud.selection import Choice
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from tests.support.waiting import WAIT_S, until
from tests.unit.cloud.recordings import BATCHES, ROWS, Recorded, record


@pytest.fixture
def settings(tmp_path: Path, folder_url: str) -> ServerSettings:
    return ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path / "spool"))


@pytest.fixture
def recorded(settings: ServerSettings) -> Recorded:
    return record(settings.store.url, settings.recorder.spool)


@pytest.fixture
def jobs() -> Iterator[Jobs]:
    made = Jobs()
    yield made
    assert made.close(WAIT_S)


def over(job: Job) -> Job:
    until(lambda: job.is_over)
    return job


def test_sessions_of_store_and_spool_are_one_list_newest_first(
    settings: ServerSettings, recorded: Recorded
) -> None:
    waits = record(settings.store.url, settings.recorder.spool, "exo-02", sent=False)
    found = look(settings)
    assert [(each.session, each.uploaded) for each in found.sessions] == [
        (waits.session, False),
        (recorded.session, True),
    ]
    assert {each.table for each in found.usage} >= {"telemetry", "sessions", "labels", "events"}
    assert found.size_bytes > 0
    assert found.problem is None


def test_who_asks_for_a_look_while_an_older_one_is_under_way_sees_what_came_since(
    settings: ServerSettings,
) -> None:
    """What had just been recorded was listed ten seconds later."""
    delivered: list[Callable[[], None]] = []
    library = Library(settings, delivered.append)
    library.look()
    until(lambda: delivered)  # of a store that is empty, which nobody has taken yet
    session = record(settings.store.url, settings.recorder.spool).session
    library.look(now=True)
    delivered.pop()()
    before = library.found
    until(lambda: delivered)
    delivered.pop()()
    assert (before.sessions, [one.session for one in library.found.sessions]) == ((), [session])
    assert not library.is_looking
    assert library.close(WAIT_S)


def test_no_store_yet_is_no_problem(settings: ServerSettings) -> None:
    found = look(settings)
    assert found.is_empty
    assert found.problem is None


def test_a_store_that_has_gone_is_not_one_that_was_never_there(
    settings: ServerSettings, recorded: Recorded, tmp_path: Path
) -> None:
    (tmp_path / "store").rename(tmp_path / "away")
    found = look(settings)
    assert not found.is_empty
    assert "any more; what was recorded until " in (found.problem or "")
    another = ServerSettings({}, StoreSettings(f"{settings.store.url}-2"), settings.recorder)
    assert look(another).is_empty


def test_a_store_that_is_away_is_said_tried_again_and_what_waits_is_shown(
    settings: ServerSettings, tmp_path: Path
) -> None:
    record(settings.store.url, settings.recorder.spool, sent=False)
    folder = tmp_path / "store"
    folder.rename(tmp_path / "away")
    folder.mkdir()
    (folder / "store.json").write_text("damaged")
    library = Library(settings, lambda call: call())
    library.look()
    until(lambda: library.looked_s)
    assert library.found.problem
    assert len(library.found.sessions) == 1
    (folder / "store.json").unlink()
    folder.rmdir()
    (tmp_path / "away").rename(folder)
    library.look()
    assert not library.is_looking, "too soon"
    library.look(now=True)
    until(lambda: not library.is_looking)
    assert library.found.problem is None
    assert library.revision == 2
    assert library.close(WAIT_S)


@pytest.mark.parametrize("kind", actions.FORMATS)
def test_a_span_is_exported_in_the_background(
    settings: ServerSettings, recorded: Recorded, jobs: Jobs, tmp_path: Path, kind: str
) -> None:
    session = find(recorded.store, recorded.session)
    file = tmp_path / f"walk.{kind}"
    job = over(jobs.add("export", actions.export(settings, session, Choice(), kind, file)))
    assert job.state is JobState.DONE, job.said
    assert (job.done, job.total, job.unit) == (BATCHES * ROWS, BATCHES * ROWS, "rows")
    assert file.stat().st_size > 100
    if kind == "parquet":
        assert pq.read_table(file).num_rows == BATCHES * ROWS
        assert session.first is not None
        none = Choice(end=session.first - timedelta(seconds=1))
        job = over(jobs.add("export", actions.export(settings, session, none, kind, file)))
        assert job.state is JobState.FAILED
        assert "has nothing from" in job.said
        assert pq.read_table(file).num_rows == BATCHES * ROWS


def test_what_waits_is_uploaded_downloaded_and_verified(
    settings: ServerSettings, jobs: Jobs, tmp_path: Path
) -> None:
    made = record(settings.store.url, settings.recorder.spool, sent=False)
    assert "nothing waits" in over(jobs.add("upload", actions.upload(settings))).said
    whole = over(jobs.add("download", actions.download(settings.store.url, tmp_path / "whole")))
    assert whole.state is JobState.DONE, whole.said
    session = find(Store(settings.store.url), made.session)
    some = over(jobs.add("download", actions.download(settings.store.url, tmp_path / "some", [session])))
    assert f"{BATCHES * ROWS} rows" in some.said
    for name in ("whole", "some"):
        assert find(Store((tmp_path / name).as_uri()), made.session).rows == BATCHES * ROWS
    verified = over(jobs.add("verify", actions.check(settings, deep=True)))
    assert "is whole" in verified.said
    next((tmp_path / "store").rglob("*.parquet")).unlink()
    damaged = over(jobs.add("verify", actions.check(settings, deep=False)))
    assert damaged.state is JobState.FAILED
    assert "is not there" in damaged.said


def test_a_job_is_cancelled_and_leaves_nothing_behind(
    settings: ServerSettings, recorded: Recorded, jobs: Jobs, tmp_path: Path
) -> None:
    session = find(recorded.store, recorded.session)
    holding, running = threading.Event(), threading.Event()

    def hold(_: Job) -> str:
        running.set()
        holding.wait(WAIT_S)
        return ""

    first = jobs.add("first", hold)
    second = jobs.add("export", actions.export(settings, session, Choice(), "csv", tmp_path / "walk.csv"))
    assert running.wait(WAIT_S)
    second.cancel()
    holding.set()
    assert over(first).state is JobState.DONE
    assert over(second).state is JobState.CANCELLED
    assert not list(tmp_path.glob("*walk.csv*"))


def test_a_copy_under_way_is_cancelled(
    settings: ServerSettings, recorded: Recorded, jobs: Jobs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = find(recorded.store, recorded.session)
    advance = Job.advance

    def cancelled(job: Job, count: int) -> None:
        job.cancel()
        advance(job, count)

    monkeypatch.setattr(Job, "advance", cancelled)
    job = over(jobs.add("copy", actions.download(settings.store.url, tmp_path / "copy", [session])))
    assert (job.state, job.said) == (JobState.CANCELLED, "cancelled")


def test_a_mistake_stands_on_its_job_and_the_next_one_runs(jobs: Jobs) -> None:
    def mistaken(_: Job) -> str:
        raise KeyError("secret")

    failed = over(jobs.add("mistake", mistaken))
    assert (failed.state, failed.said) == (JobState.FAILED, "internal error, KeyError")
    assert over(jobs.add("next", lambda _: "fine")).state is JobState.DONE


def test_closing_does_not_wait_for_what_hangs() -> None:
    jobs, let_go = Jobs(), threading.Event()
    job = jobs.add("hangs", lambda _: str(let_go.wait(WAIT_S)))
    until(lambda: job.state is JobState.RUNNING)
    assert not jobs.close(0.01)
    with pytest.raises(Cancelled):
        job.check()
    let_go.set()
    assert jobs.close(WAIT_S)


def test_a_segment_that_is_just_being_made_is_no_problem(settings: ServerSettings) -> None:
    record(settings.store.url, settings.recorder.spool, sent=False)
    (settings.recorder.spool / "00000099.db").touch()
    assert len(look(settings).sessions) == 1


def test_what_waits_for_upload_is_exported_too_and_once(
    settings: ServerSettings, jobs: Jobs, tmp_path: Path
) -> None:
    record(settings.store.url, settings.recorder.spool, sent=False)
    waits = look(settings).sessions[0]
    export = actions.export(settings, waits, Choice(), "csv", tmp_path / "walk.csv")
    job = over(jobs.add("export", export))
    assert job.said.endswith(f"walk.csv: {BATCHES * ROWS} rows")
    over(jobs.add("upload", actions.upload(settings)))
    copied = tmp_path / "spool" / "00000001.uploaded.db"
    copied.rename(tmp_path / "spool" / "00000001.db")
    job = over(jobs.add("export", export))
    assert job.said.endswith(f"walk.csv: {BATCHES * ROWS} rows")


def test_times_of_today_are_told_as_the_clock_on_the_wall_and_others_with_their_day() -> None:
    now_s = time.time()
    now, before = (datetime.fromtimestamp(at_s).astimezone() for at_s in (now_s, now_s - 3 * 86_400))
    assert _local(now_s) == f"{now:%H:%M:%S}"
    assert _local(before.timestamp()) == f"{before:%Y-%m-%d %H:%M:%S}"
