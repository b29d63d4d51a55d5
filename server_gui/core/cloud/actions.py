"""Actions on recordings in the window: export, upload, copy to another place, verify."""

import contextlib
import dataclasses
import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Final

import pyarrow as pa

from gateway.amounts import counted, size
from ml.store import Store, StoreError
from ml.store.sessions import Session
from ml.store.snapshot import Snapshot
from ml.store.url import checked_url
from server_gui.core.cloud import exports, partial_copy, spool_upload, transfer, verify
from server_gui.core.cloud.jobs import Job, Work
from server_gui.core.cloud.mcap import write_mcap
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.cloud.selection import Choice, SelectedRecording, choose
from server_gui.core.cloud.tabular import write_csv, write_parquet
from server_gui.core.fleet.collector import connect
from server_gui.core.recording.errors import Damaged
from server_gui.core.settings.server_file import ServerSettings

FORMATS: Final[dict[str, Callable[[Path, SelectedRecording], int]]] = {
    "csv": write_csv,
    "parquet": write_parquet,
    "mcap": write_mcap,
}
PROBLEMS_TOLD: Final = 3


def export(settings: ServerSettings, session: Session, choice: Choice, kind: str, file: Path) -> Work:
    """Export a session, or a part of it, as one of `FORMATS`: whole or not at all."""

    def work(job: Job) -> str:
        known = Recordings(settings.store.url, settings.recorder.spool)
        recorded = known.open(known.find(session.session, session.robot))
        job.expect(recorded.session.rows, "rows")
        chosen = choose(known, recorded, choice)
        counted = dataclasses.replace(chosen, tables=_counted(chosen.tables, job))
        with exports.noted(file, (session.robot, session.session)):
            count = FORMATS[kind](file, counted)
        more = f"; of this computer's spool alone: {known.problem}" if known.problem else ""
        return f"{file}: {count} {'messages' if kind == 'mcap' else 'rows'}{more}"

    return work


def upload(settings: ServerSettings) -> Work:
    """Upload what waits in a spool that nobody records into."""

    def work(job: Job) -> str:
        url = checked_url(settings.store.url)
        there = functools.partial(connect, settings.store)
        done = spool_upload.empty(settings.recorder.spool, url, there, _steps(job, "batches"))
        if done.waits:
            raise StoreError("; ".join((*done.waits, *done.problems)))
        if done.problems:
            raise Damaged("; ".join(done.problems))
        return f"{counted(done.uploaded, 'batch', 'batches')} uploaded to {done.url}; nothing waits"

    return work


def download(url: str, folder: Path, wanted: Sequence[Session] = ()) -> Work:
    """Copy a store into a folder: whole with its versions, or these sessions of it."""

    def work(job: Job) -> str:
        source, target = Store.existing(url), folder.absolute().as_uri()
        exports.note_copy(target, {(each.robot, each.session) for each in wanted} or None)
        if wanted:
            job.expect(sum(session.rows for session in wanted), "rows")
            rows = partial_copy.copy(source, Store(target), wanted, (), job.advance)
            return f"{folder}: {len(wanted)} sessions, {rows} rows of telemetry copied and counted"
        to = transfer.open_target(source, target)
        missing = transfer.missing(source.objects, to)
        job.expect(sum(found.size_bytes for found in missing), "bytes")
        done = transfer.copy(source.objects, to, missing, job.advance)
        return f"{folder}: {len(missing)} files copied, {size(done.size_bytes)}"

    return work


def check(settings: ServerSettings, *, deep: bool) -> Work:
    """Check that every file of the store is whole, and every batch there that the spool has sent."""

    def work(job: Job) -> str:
        store = Snapshot.existing(settings.store.url)
        found = verify.whole(store, settings.recorder.spool, _steps(job, "steps"), deep=deep)
        if found.problems:
            told = "; ".join(found.problems[:PROBLEMS_TOLD])
            raise StoreError(f"{len(found.problems)} problems: {told} (gwrms cloud verify lists them)")
        return f"{store.url} is whole: {found.text}"

    return work


def _steps(job: Job, unit: str) -> Callable[[int], AbstractContextManager[Callable[[int], object]]]:
    """Return a context that reports the number of steps, and then each."""

    @contextlib.contextmanager
    def expect(steps: int) -> Iterator[Callable[[int], object]]:
        job.expect(steps, unit)
        yield job.advance

    return expect


def _counted(tables: Iterable[pa.Table], job: Job) -> Iterator[pa.Table]:
    for each in tables:
        yield each
        job.advance(each.num_rows)
