"""Contents of store and spool, refreshed in a thread; an unreachable store is tried again."""

import time
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

import msgspec

from ml.store import NoSuchTable, Store, StoreError
from ml.store.objects import Object
from ml.store.sessions import UNTOLD, Session, in_order, sessions
from server_gui.core.cloud import spool_reader, usage
from server_gui.core.cloud.store_reach import StoreReach
from server_gui.core.cloud.usage import Usage
from server_gui.core.recording.errors import RecordingError
from server_gui.core.recording.receipts import RECEIPTS, Receipts
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.threads.background import Background

LOOK_S: Final = 10.0  # between looks, while somebody looks
AGAIN_S: Final = 5.0  # before a store that was away is tried again
LIST_S: Final = 300.0  # between looks while nobody looks


@dataclass(frozen=True, slots=True)
class Listing:
    """Sessions of store and spool; `problem` is the reason, in words, if the store's part is missing."""

    sessions: tuple[Session, ...] = ()  # newest first
    usage: tuple[Usage, ...] = ()
    size_bytes: int = 0
    problem: str | None = None
    is_empty: bool = False  # there is no store yet: nothing was uploaded
    is_reached: bool = True  # else `problem` is why not; a store that is reached may have a damaged list


class Library:
    """For the window's thread. `revision` rises with every look that has found something else."""

    def __init__(self, settings: ServerSettings, deliver: Deliver, reach: StoreReach | None = None) -> None:
        """`reach` is told what each look says of the store."""
        self.settings = settings
        self.reach = reach or StoreReach()
        self.found = Listing()
        self.revision = 0
        self.looked_s: float | None = None  # when the newest look came back, on our monotonic clock
        self.reading = Background("store")
        self._deliver = deliver
        self._looking = False
        self._look_again = False
        self._knocking = False
        self._knock_again = False
        self._known: dict[tuple[str, str], Session] = {}  # as they were when their store was last read

    def close(self, within_s: float) -> bool:
        """Look no more; False where a look under way hangs. Idempotent."""
        self._look_again = self._knock_again = False
        return self.reading.close(within_s)

    @property
    def is_looking(self) -> bool:
        """Whether a look is under way."""
        return self._looking

    @property
    def is_listed(self) -> bool:
        """Whether a look has listed the store not long ago; one that only knocks sees no damaged list."""
        return self.looked_s is not None and time.monotonic() - self.looked_s < LIST_S

    def look(self, *, now: bool = False) -> None:
        """Look again where it is time, or at once."""
        wait_s = LOOK_S if self.found.problem is None else AGAIN_S
        due = self.looked_s is None or time.monotonic() - self.looked_s >= wait_s
        if self._looking:
            self._look_again |= now  # what is under way may have begun before
            return
        if not (now or due):
            return
        self._looking = True
        settings = self.settings
        when_done(self.reading.do(lambda: look(settings)), self._deliver, self._looked, self._failed)

    def knock(self, *, now: bool = False) -> None:
        """See whether the store is there, where it is time or at once: one small file of it."""
        if self._knocking or self._looking:
            self._knock_again |= now  # what is under way may have begun before
            return
        if not (now or self.reach.is_due):
            return
        if self.reach.list_problem is not None:
            self.look(now=now)  # one file would not say whether its list is whole again
            return
        self._knocking = True
        settings = self.settings
        when_done(self.reading.do(lambda: knock(settings)), self._deliver, self._knocked, self._knock_failed)

    def session(self, robot: str, name: str) -> Session | None:
        """Return the session of this name, as the newest look has found it."""
        named = (each for each in self.found.sessions if (each.robot, each.session) == (robot, name))
        return next(named, None)

    def known_before(self, session: Session) -> Session | None:
        """Return it as it was when the store was last read; None where that was before it began."""
        return self._known.get((session.robot, session.session))

    def files(self, folder: str) -> "Future[list[Object]]":
        """Return every object of the store below a folder."""
        url = self.settings.store.url
        return self.reading.do(lambda: usage.below(Store.existing(url), folder))

    def _looked(self, found: Listing) -> None:
        self._looking, self.looked_s = False, time.monotonic()
        if (found.sessions, found.usage, found.problem) != (
            self.found.sessions,
            self.found.usage,
            self.found.problem,
        ) or self.revision == 0:
            self.revision += 1
        self.found = found
        if found.problem is None:
            self._known = {(each.robot, each.session): each for each in found.sessions}
        if found.is_reached:
            self.reach.listed(found.problem)
        again, self._look_again = self._look_again, False
        if again:
            self.look(now=True)
        self._reached(found)

    def _failed(self, error: Exception) -> None:
        self._looked(Listing(problem=f"internal error, {type(error).__name__}", is_reached=False))

    def _knocked(self, found: Listing) -> None:
        self._knocking = False
        self._reached(found)

    def _knock_failed(self, error: Exception) -> None:
        self._knocked(Listing(problem=f"internal error, {type(error).__name__}", is_reached=False))

    def _reached(self, found: Listing) -> None:
        self.reach.looked(None if found.is_reached else found.problem, is_empty=found.is_empty)
        again, self._knock_again = self._knock_again, False
        if again:
            self.knock(now=True)


def look(settings: ServerSettings) -> Listing:
    """Return what there is now; blocks."""
    waiting, store = _waiting(settings), _opened(settings)
    if isinstance(store, Listing):
        here = waiting if store.problem is None else spool_reader.with_store_away(waiting)
        return replace(store, sessions=_joined([], here))
    try:
        stored = sessions(store)
        used = tuple(usage.by_robot(store))
        size_bytes = sum(each.size_bytes for each in store.objects.listing())
    except StoreError as error:
        return Listing(_joined([], spool_reader.with_store_away(waiting)), problem=str(error))
    return Listing(_joined(stored, waiting), used, size_bytes)


def knock(settings: ServerSettings) -> Listing:
    """Return only whether the store is reached; blocks."""
    store = _opened(settings)
    return store if isinstance(store, Listing) else Listing()


def _opened(settings: ServerSettings) -> Store | Listing:
    """Return the store, of which one small file has been read; else why there is none."""
    try:
        return Store.existing(settings.store.url)
    except NoSuchTable:
        gone = _gone(settings)
        return Listing(problem=gone, is_empty=gone is None, is_reached=gone is None)
    except StoreError as error:
        return Listing(problem=str(error), is_reached=False)


def _gone(settings: ServerSettings) -> str | None:
    """Return why there should be a store: this computer has brought something to it."""
    newest, url = Receipts(settings.recorder.spool / RECEIPTS).newest(), settings.store.url
    if newest is None or newest.url != url:
        return None
    ends = [part.end_us for part in newest.parts if part.end_us is not None]
    what = f"what was recorded until {_local(max(ends) / 1e6)}" if ends else "what was recorded"
    return f"there is no store at {url} any more; {what} was uploaded to it and is not kept here"


def _local(utc_s: float) -> str:
    """Return a time as the clock on the wall has it, with its day where that is not today."""
    then = datetime.fromtimestamp(utc_s).astimezone()
    is_today = then.date() == datetime.now().astimezone().date()
    return f"{then:%H:%M:%S}" if is_today else f"{then:%Y-%m-%d %H:%M:%S}"


def _waiting(settings: ServerSettings) -> list[Session]:
    try:
        return spool_reader.sessions(settings.recorder.spool)
    except RecordingError:
        return []


def _completed(stored: Session, told: Mapping[tuple[str, str], Session]) -> Session:
    """Complete a session of which the store has only the rows, from the spool."""
    found = told.get((stored.robot, stored.session))
    if found is None or stored.notes != UNTOLD:
        return stored
    held = {name: getattr(stored, name) for name in ("first", "last", "rows", "size_bytes", "uploaded")}
    return msgspec.structs.replace(found, **held)


def _joined(stored: list[Session], waiting: list[Session]) -> tuple[Session, ...]:
    """Merge sessions of store and spool, newest first; the spool knows whether one has ended."""
    told = {(each.robot, each.session): each for each in waiting}
    known = told | {(each.robot, each.session): _completed(each, told) for each in stored}
    return tuple(reversed(in_order(known.values())))
