"""Labels of recorded sessions: added and taken back, kept once, whoever owns the spool.

A collector that runs is asked by its door; otherwise the label goes through the spool itself and at once into
the store. Where that cannot be reached, it waits in the spool as everything recorded does.
"""

import logging
import time
from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from typing import Final

import msgspec

from ml.store import StoreError
from ml.store.labels import ACTIVITIES, INSTANTS, Label, LabelSource, utc_ns
from ml.store.sessions import Session
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.fleet.collector import connect
from server_gui.core.fleet.control_socket import NobodyCollects, ask
from server_gui.core.recording import records
from server_gui.core.recording.errors import RecordingError
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import ServerSettings, Upload

log = logging.getLogger(__name__)

AT_ONCE: Final = 50  # labels in one question to a collector: a line of it has at most 64 KiB
LONGEST: Final = 100  # letters of a label's or an author's name


class BadLabel(ValueError):
    """A label that cannot be so; the message says why."""


class Where(Enum):
    """Place of new labels."""

    STORE = "store"
    SPOOL = "spool"  # safe on this computer, and in the store with the next upload


@dataclass(frozen=True, slots=True)
class Kept:
    """Result of labelling: the numbers of new labels, and of those that existed already."""

    new: int
    known: int
    where: Where
    problem: str = ""  # why they are not in the store yet, where something is wrong


class Labelling:
    """The labels of a server's sessions, in its store and its spool. Blocks; for any thread."""

    def __init__(self, settings: ServerSettings) -> None:
        self._settings = settings
        self._spool = settings.recorder.spool

    def session(self, name: str, robot: str | None = None) -> Session:
        """Find the session that alone is called or begins so, uploaded or not; raises `NoSuchSession`."""
        known = self._recordings()
        return known.counted(known.find(name, robot))

    def ls(self, session: Session) -> list[Label]:
        """Return the labels of a session that hold, in time's order."""
        return list(map(Label.of, self._recordings().labels(session)))

    def add(
        self,
        robot: str,
        session: str,
        label: str,
        began_utc_ns: int,
        ended_utc_ns: int,
        author: str,
        source: str = "person",
    ) -> Kept:
        """Add a label to a session; raises as `add_all`."""
        whole = self.session(session, robot).session
        return self.add_all(
            [Label(robot, whole, began_utc_ns, ended_utc_ns, label, author, LabelSource(source))]
        )

    def add_all(self, labels: Sequence[Label]) -> Kept:
        """Keep these labels of one session: all, or none where one cannot be so. Repeating changes nothing.

        Raises:
            BadLabel: one has no length, lies outside its session, or contradicts another one of its author.
            StoreError, RecordingError, NobodyCollects: it is not known which are kept; repeat it.

        """
        if not labels:
            return Kept(0, 0, Where.STORE)
        session = self.session(labels[0].session, labels[0].robot)
        known = set(self.ls(session))
        new = sorted(set(labels) - known)
        check(new, known, session)
        where, problem = self._keep(new) if new else (Where.STORE, "")
        return Kept(len(new), len(set(labels)) - len(new), where, problem)

    def remove(self, label: Label) -> Kept:
        """Take a label back: a row says that it holds no more, and the one before stays readable.

        Raises:
            BadLabel: it is none of its session.

        """
        if label not in self.ls(self.session(label.session, label.robot)):
            raise BadLabel(f"{_told(label)} is no label of {label.session} (gwrms label … --ls lists them)")
        return Kept(1, 0, *self._keep([label], removed=True))

    def _keep(self, labels: Sequence[Label], *, removed: bool = False) -> tuple[Where, str]:
        rows = [records.label(label, removed=removed) for label in labels]
        for at in range(0, len(rows), AT_ONCE):
            part = msgspec.json.encode(rows[at : at + AT_ONCE]).decode()
            try:
                kept = msgspec.json.decode(ask(self._spool, "keep", part), type=bool)
            except NobodyCollects:
                return self._keep_here(rows)
            if not kept:
                raise RecordingError(
                    "the collector that runs could not keep the labels (gwrms collect --status says why); "
                    "give them again: what is kept already is not doubled"
                )
        return Where.SPOOL, ""

    def _keep_here(self, rows: Sequence[Record]) -> tuple[Where, str]:
        """No collector owns the spool: so we do, for as long as this takes."""
        with Spool(self._spool) as spool:
            spool.append((), rows)
            spool.freeze()
            if self._settings.recorder.upload is Upload.MANUAL:
                return Where.SPOOL, ""
            try:
                store = connect(self._settings.store)
                for number in spool.waiting():
                    send(spool, number, store)
                for text in spool.notices:
                    log.error("%s", text)
            except StoreError as error:
                return Where.SPOOL, str(error)
        return Where.STORE, ""

    def _recordings(self) -> Recordings:
        found = Recordings(self._settings.store.url, self._spool)
        if found.problem is not None:  # what is said already must be known
            raise found.problem
        if found.unread is not None:
            raise found.unread
        return found


def check(new: Sequence[Label], known: Iterable[Label], session: Session) -> None:
    """Raise `BadLabel` where a new label cannot be so."""
    begins, ends = span(session)
    for label in new:
        if label.began_utc_ns < begins or label.ended_utc_ns > ends:
            raise BadLabel(
                f"{_told(label)} lies outside the session {session.session}, "
                f"which goes from {_time(begins)} to {_time(ends)}"
            )
        _check(label)
    for one, other in _contradictions([*known, *new], set(new)):
        raise BadLabel(f"{_told(one)} contradicts {_told(other)} by the same author; take one of them back")


def span(session: Session) -> tuple[int, int]:
    """Return from when to when the session goes, UTC in ns; one that has not ended goes until now."""
    begins = [utc_ns(time) for time in (session.began, session.first) if time is not None]
    ends = [utc_ns(time) for time in (session.ended, session.last) if time is not None]
    if session.ended is None:
        ends.append(time.time_ns())
    return min(begins, default=0), max(ends)


def _check(label: Label) -> None:
    length_ns = label.ended_utc_ns - label.began_utc_ns
    for name in (label.label, label.author):
        if not (name.strip() and name.isprintable() and len(name) <= LONGEST):
            raise BadLabel(
                f"{name!r} is no name: a label and its author have one, of up to {LONGEST} letters"
            )
    if label.label in INSTANTS and length_ns:
        raise BadLabel(f"{_told(label)}: this happens at one instant, so it begins and ends at one time")
    if label.label not in INSTANTS and length_ns <= 0:
        raise BadLabel(f"{_told(label)} has no length: it ends when, or before, it begins")


def _contradictions(labels: Sequence[Label], new: Set[Label]) -> Iterator[tuple[Label, Label]]:
    """Two activities of one author at one time, of which one is new."""
    until: dict[tuple[str, LabelSource], Label] = {}
    for label in sorted(each for each in labels if each.label in ACTIVITIES):
        before = until.get((label.author, label.source))
        if before is None or before.ended_utc_ns <= label.began_utc_ns:
            until[label.author, label.source] = label
        elif before.label != label.label and {label, before} & new:
            yield label, before
        elif before.ended_utc_ns < label.ended_utc_ns:
            until[label.author, label.source] = label


def _told(label: Label) -> str:
    if label.began_utc_ns == label.ended_utc_ns:
        return f"{label.label} at {_time(label.began_utc_ns)}"
    return f"{label.label} from {_time(label.began_utc_ns)} to {_time(label.ended_utc_ns)}"


def _time(instant_ns: int) -> str:
    return f"{datetime.fromtimestamp(instant_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S.%f}"[:-3]
