"""`gwrms cloud upload | download`: the spool into the store; a store, or parts of it, to another place."""

import argparse
import fnmatch
import functools
from collections.abc import Sequence
from pathlib import Path

from gateway.amounts import counted, size
from gateway.cli.text import say, say_json, warn
from ml.store import sessions
from ml.store.errors import StoreError
from ml.store.sessions import Session
from ml.store.store import Store
from ml.store.url import checked_url
from server_gui.cli.cloud_options import add_url, parser, progress, reach, url
from server_gui.core.cloud import exports, partial_copy, relocated_store, spool_upload, transfer
from server_gui.core.fleet.control_socket import NobodyCollects, ask, why_not_uploaded
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.receipts import RECEIPTS
from server_gui.core.recording.spool import Spool
from server_gui.core.settings.server_file import load

UPLOAD_EPILOG = """Without --from: pending data of this computer's spool goes to the store now. A running
collector owns the spool, and is asked to upload it.

With --from: a whole store is copied to URL, with its versions and its record of batches, so that the server
can continue there: end the collector, copy, write the new URL into the server's file, start the collector
again.

examples
  gwrms cloud upload
  gwrms cloud upload s3://bucket/gwrms --from file:///home/me/.local/share/gwrms/store"""
DOWNLOAD_EPILOG = """After an interruption, the same command continues. A whole store keeps its versions; each
file is compared by its MD5, if the service gives it, otherwise by its size (gwrms cloud verify --deep reads
everything). Robots and sessions are copied as rows, and counted.

examples
  gwrms cloud download s3://bucket/gwrms --out copy
  gwrms cloud download --out copy --robot 'exo-0*' --session 20261121T1530"""


def upload(argv: list[str]) -> int:
    """Run `gwrms cloud upload`."""
    made = parser("cloud upload", "Upload pending data of the spool, or copy a whole store.", UPLOAD_EPILOG)
    add_url(made, "url")
    made.add_argument("--from", dest="source", metavar="URL", help="the store to copy")
    arguments = made.parse_args(argv)
    if arguments.source is not None:
        exports.note_copy(checked_url(arguments.source))  # what goes on elsewhere has a copy there
        status = _copy(checked_url(arguments.source), checked_url(url(arguments)), arguments)
        _note(arguments)
        return status
    folder = load(arguments.config).recorder.spool
    if not folder.is_dir():
        raise SpoolUnusable(f"there is no spool at {folder}: nothing was recorded on this computer")
    try:
        waiting = int(ask(folder, "upload"))
    except NobodyCollects:
        return _empty(folder, arguments)
    if arguments.url is not None:
        raise SpoolUnusable(
            f"a collector owns the spool {folder} and uploads to its own store; end it, or leave the URL out"
        )
    problem = why_not_uploaded(folder)
    _tell(
        arguments,
        "the collector that runs uploads what it has; gwrms collect --status tells how that goes",
        uploaded=0,
        waiting=waiting,
    )
    if problem is None:
        return 0
    warn("cloud", f"it tries again, and could not the last time: {problem}")
    return 1


def _note(arguments: argparse.Namespace) -> None:
    """Note in the spool's receipts that its batches are in the copy too, so that a loss is noticed."""
    folder = load(arguments.config).recorder.spool
    if not (folder / RECEIPTS).exists():
        return
    try:
        with Spool(folder) as spool:
            relocated_store.note(spool, Store.existing(url(arguments)))
    except SpoolUnusable as error:
        warn("cloud", f"that batches of this computer are in the copy is not noted in its spool: {error}")


def _empty(folder: Path, arguments: argparse.Namespace) -> int:
    """Upload it here and now."""
    settings = load(arguments.config).store
    if arguments.url is None:
        there = functools.partial(Store, settings.url, settings.shards, settings.several_writers)
    else:
        there = functools.partial(Store, arguments.url)
    wanted = checked_url(arguments.url or settings.url)
    done = spool_upload.empty(folder, wanted, there, functools.partial(progress, "batches"))
    for problem in (*done.notes, *done.problems, *done.waits):
        warn("cloud", problem)
    batches = counted(done.uploaded, "batch", "batches")
    _tell(
        arguments,
        f"{batches} uploaded to {done.url}; {len(done.waits) or 'nothing'} waits",
        uploaded=done.uploaded,
        waiting=len(done.waits),
    )
    return 1 if done.problems or done.waits else 0


def download(argv: list[str]) -> int:
    """Run `gwrms cloud download`."""
    made = parser(
        "cloud download",
        "Download a store, or a part of it, to a folder, which is a store too.",
        DOWNLOAD_EPILOG,
    )
    add_url(made, "url")
    made.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="where to")
    made.add_argument("--robot", action="append", metavar="GLOB", help="only these; repeatable")
    made.add_argument("--session", action="append", metavar="NAME", help="only these; repeatable")
    arguments = made.parse_args(argv)
    target = arguments.out.absolute().as_uri()
    if arguments.robot is None and arguments.session is None:
        return _copy(reach(arguments).url, target, arguments)
    return _copy_parts(reach(arguments), Store(target), arguments)


def _copy(source: str, target: str, arguments: argparse.Namespace) -> int:
    """Return a whole store."""
    store = Store.existing(source)
    from_, to = store.objects, transfer.open_target(store, target)
    exports.note_copy(target)
    wanted = transfer.missing(from_, to)
    with progress("bytes", sum(found.size_bytes for found in wanted), bytes_=True) as advance:
        done = transfer.copy(from_, to, wanted, advance)
    text = (
        f"{target}: {len(wanted)} files copied, {size(done.size_bytes)}; "
        f"{done.by_checksum} compared by their MD5, {done.by_size} by their size"
    )
    return _tell(
        arguments,
        text,
        files=len(wanted),
        size_bytes=done.size_bytes,
        by_checksum=done.by_checksum,
        by_size=done.by_size,
    )


def _copy_parts(source: Store, target: Store, arguments: argparse.Namespace) -> int:
    wanted, robots = _chosen(source, arguments)
    exports.note_copy(target.url, {(each.robot, each.session) for each in wanted})
    with progress("rows", sum(session.rows for session in wanted)) as advance:
        rows = partial_copy.copy(source, target, wanted, robots, advance)
    text = f"{target.url}: {len(wanted)} sessions, {rows} rows of telemetry copied and counted"
    return _tell(arguments, text, sessions=len(wanted), rows=rows)


def _chosen(source: Store, arguments: argparse.Namespace) -> tuple[Sequence[Session], set[str]]:
    """Return the sessions that are wanted, and the robots of which everything is."""
    globs = arguments.robot or ("*",)
    known = [
        session
        for session in sessions.sessions(source)
        if any(fnmatch.fnmatchcase(session.robot, glob) for glob in globs)
    ]
    if not known:
        raise StoreError(f"{source.url} has no session of {', '.join(globs)}")
    if arguments.session is None:
        return known, {session.robot for session in known}
    return [sessions.among(known, name, source.url) for name in arguments.session], set()


def _tell(arguments: argparse.Namespace, text: str, **fields: object) -> int:
    if arguments.json:
        say_json(fields)
    else:
        say(f"{text}\n")
    return 0
