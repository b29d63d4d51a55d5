"""The common part of the store's commands: arguments, store, times, progress on a terminal."""

import argparse
import contextlib
import sys
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from gateway.cli.text import warn
from ml.store import StoreError
from ml.store.sessions import Session
from ml.store.store import Store
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.settings.server_file import load

Advance = Callable[[int], object]
NO_SPOOL: Final = Path("/dev/null/spool")  # of a store that another server writes


def parser(command: str, what: str, epilog: str = "") -> argparse.ArgumentParser:
    """Return the arguments that all have: `--config` and `--json`."""
    made = argparse.ArgumentParser(
        prog=f"gwrms {command}",
        description=what,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("--config", type=Path, metavar="FILE", help="the server's file, which names the store")
    made.add_argument("--json", action="store_true", help="print JSON, for programs")
    return made


def add_url(made: argparse.ArgumentParser, name: str = "--url") -> None:
    """Add the argument for a store other than that of the server's file."""
    made.add_argument(
        name,
        nargs="?",
        metavar="URL",
        help="file:///folder or s3://bucket/prefix (default: of the server's file)",
    )


def url(arguments: argparse.Namespace) -> str:
    """Return the store's URL: given, of the server's file, or the default."""
    return str(arguments.url or load(arguments.config).store.url)


def reach(arguments: argparse.Namespace) -> Store:
    """Return the store to look into; raises `StoreError` where there is none."""
    return Store.existing(url(arguments))


def spool(arguments: argparse.Namespace) -> Path:
    """Return the spool of the server on this computer."""
    return load(arguments.config).recorder.spool


def recordings(command: str, arguments: argparse.Namespace) -> Recordings:
    """Return the recordings in the server's store and spool, or in another store by its URL.

    Says so where the store cannot be reached.
    """
    found = Recordings(url(arguments), NO_SPOOL if arguments.url else spool(arguments))
    if found.problem is not None:
        warn(command, f"{found.problem}; here is what this computer's spool has")
    return found


def instant(text: str) -> datetime:
    """Return a date or time as ISO 8601 writes it; UTC where it does not say otherwise."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no time: write 2026-11-21 or 2026-11-21T15:30:00"
        ) from error
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def instant_or_seconds(text: str) -> datetime | float:
    """Return the same, or seconds since a session's first sample."""
    try:
        return float(text)
    except ValueError:
        return instant(text)


def absolute(session: Session, time: datetime | float | None) -> datetime | None:
    """Return a time; raises `StoreError` where there is no first sample to count seconds from."""
    if not isinstance(time, float):
        return time
    if session.first is None:
        raise StoreError(f"the session {session.session} has no telemetry: there is nothing to count from")
    return session.first + timedelta(seconds=time)


def when(time: datetime | None) -> str:
    """Return a time for people, in UTC."""
    return "–" if time is None else f"{time.astimezone(UTC):%Y-%m-%d %H:%M:%S}"


@contextlib.contextmanager
def progress(what: str, total: int, *, bytes_: bool = False) -> Iterator[Advance]:
    """Return a bar on stderr that goes on with each call, where that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    counts = DownloadColumn() if bytes_ else MofNCompleteColumn()
    columns = (TextColumn("{task.description}"), BarColumn(), counts, TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda count: bar.advance(task, count)
