"""Selection of a session's data for an export."""

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import pyarrow as pa

from ml.store.errors import StoreError
from ml.store.sessions import Channel, Session
from server_gui.core.cloud.recordings import Recorded, Recordings

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Choice:
    """Channels by names or globs, and the time from `begin` to before `end`."""

    channels: Sequence[str] = ("*",)
    begin: datetime | None = None
    end: datetime | None = None

    def of(self, known: Sequence[Channel]) -> list[Channel]:
        """Return the channels that are wanted; raises `StoreError` where a name or glob means none."""
        names = [each.name for each in known]
        for glob in self.channels:
            if not any(fnmatch.fnmatchcase(name, glob) for name in names):
                raise StoreError(f"the session has no channel {glob!r} (gwrms sessions show lists them)")
        return [each for each in known if any(fnmatch.fnmatchcase(each.name, glob) for glob in self.channels)]

    def check(self, session: Session) -> None:
        """Check that the session has data of the time; raises `StoreError`."""
        first, last = session.first, session.last
        begin, end = self.begin or first, self.end or last
        if first is None or last is None or begin is None or end is None:
            return
        if begin >= end or begin >= last or end <= first:
            times = [f"{time.astimezone(UTC):%Y-%m-%d %H:%M:%S}" for time in (begin, end, first, last)]
            raise StoreError(
                f"the session {session.session} has nothing from {times[0]} to {times[1]}: "
                f"it goes from {times[2]} to {times[3]} UTC, {session.length.total_seconds():.0f} s"
            )

    def holds(self, row: Row) -> bool:
        """Return whether the row's time is wanted."""
        utc = row["utc"]
        return (self.begin is None or utc >= self.begin) and (self.end is None or utc < self.end)


@dataclass(frozen=True, slots=True)
class SelectedRecording:
    """A session or a part of it. `tables` are its rows in time's order: `utc`, `stamp_ns`, the channels."""

    session: Session
    channels: Sequence[Channel]
    tables: Iterable[pa.Table]
    events: Sequence[Row]
    labels: Sequence[Row]


def choose(recordings: Recordings, recorded: Recorded, choice: Choice) -> SelectedRecording:
    """Return the chosen part of an open session; telemetry is read while `tables` is iterated.

    Raises:
        StoreError: there is nothing of it or of that time, or the store cannot be read.
        SpoolUnusable: the spool cannot be read.

    """
    session = recorded.session
    if not recorded.channels:
        raise StoreError(f"the session {session.session} of {session.robot} has no telemetry")
    choice.check(session)
    channels = choice.of(recorded.channels)
    names = [each.name for each in channels]
    return SelectedRecording(
        session,
        channels,
        recorded.telemetry(names, choice.begin, choice.end),
        list(filter(choice.holds, recordings.rows_of(session))),
        list(filter(choice.holds, recordings.labels(session))),
    )
