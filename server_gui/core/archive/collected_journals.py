"""Robots' journals as they were collected: also of robots that are away, and what is older than their own."""

import functools
import operator
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import msgspec
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset

from ml.store import NoSuchTable, Store, StoreError, reading
from ml.store.tables import JOURNAL
from ml.store.translation import translated
from server_gui.core.audit import chains
from server_gui.core.audit.chains import Entry
from server_gui.core.cloud import spool_reader
from server_gui.core.recording.errors import RecordingError
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.answers import Deliver, when_done

KEPT: Final = 2000  # entries of each robot by each spool, the newest
LOOK_S: Final = 60.0  # between looks, while somebody looks
AGAIN_S: Final = 5.0  # before a store that was away is tried again


@dataclass(frozen=True, slots=True)
class CollectedJournal:
    """One robot's journal as far as it was collected: stretches without a hole, oldest first."""

    stretches: tuple[list[Entry], ...]
    problem: str | None  # where it was altered

    @property
    def verdict(self) -> str:
        """In words, how far it can be believed."""
        if self.problem is not None:
            return f"what was collected is NOT INTACT: {self.problem}"
        count, holes = sum(map(len, self.stretches)), len(self.stretches) - 1
        entries = "1 entry" if count == 1 else f"{count} entries"
        whole = "without a hole" if not holes else "with 1 hole" if holes == 1 else f"with {holes} holes"
        return f"collected were {entries}, unaltered, {whole}"


@dataclass(frozen=True, slots=True)
class JournalsFound:
    """Journals by the robot's name in the store; `problem` is the reason if none could be read."""

    by_robot: Mapping[str, CollectedJournal] = field(default_factory=lambda: MappingProxyType({}))
    problem: str | None = None


class KeptJournals:
    """For the window's thread; `do` looks in another one. `revision` rises with every look that came back."""

    def __init__(
        self,
        settings: ServerSettings,
        do: Callable[[Callable[[], JournalsFound]], "Future[JournalsFound]"],
        deliver: Deliver,
    ) -> None:
        self.found = JournalsFound()
        self.revision = 0
        self._settings = settings
        self._do = do
        self._deliver = deliver
        self._looking = False
        self._looked_s: float | None = None

    def look(self) -> None:
        """Look again where it is time."""
        wait_s = LOOK_S if self.found.problem is None else AGAIN_S
        due = self._looked_s is None or time.monotonic() - self._looked_s >= wait_s
        if self._looking or not due:
            return
        self._looking = True
        work = functools.partial(look, self._settings)
        when_done(self._do(work), self._deliver, self._came, self._failed)

    def _came(self, found: JournalsFound) -> None:
        self._looking, self._looked_s = False, time.monotonic()
        if found.problem is not None:  # what was read before is still so
            found = JournalsFound(self.found.by_robot, found.problem)
        self.found = found
        self.revision += 1

    def _failed(self, error: Exception) -> None:
        self._came(JournalsFound(problem=f"internal error, {type(error).__name__}"))


def look(settings: ServerSettings) -> JournalsFound:
    """Return the journals in store and spool; blocks."""
    entries: dict[str, list[Entry]] = {}
    try:
        waiting = spool_reader.rows(settings.recorder.spool, JOURNAL)
    except RecordingError:
        waiting = []
    try:
        rows = [*_stored(settings.store.url), *waiting]
    except StoreError as error:
        return JournalsFound(problem=str(error))
    for row in rows:
        entries.setdefault(row["robot"], []).append(msgspec.json.decode(row["entry"]))
    return JournalsFound({robot: _kept(found) for robot, found in sorted(entries.items())})


def _kept(entries: Iterable[Entry]) -> CollectedJournal:
    stretches = chains.chained(entries)
    return CollectedJournal(tuple(stretches), chains.problem(stretches))


def _stored(url: str) -> list[dict[str, Any]]:
    """Return the newest rows of each robot."""
    try:
        store = Store.existing(url)
    except NoSuchTable:
        return []
    with translated(f"{url}/{JOURNAL.name} cannot be read"):
        table = reading.dataset(store, JOURNAL)
        known = table.to_table(columns=["robot", "spool", "batch", "number"])
        wanted = [_newest(part) for part in _parts(known)]
        if not wanted:
            return []
        newest = functools.reduce(operator.or_, wanted)
        found: list[dict[str, Any]] = table.to_table(columns=["robot", "entry"], filter=newest).to_pylist()
    return found


def _parts(rows: pa.Table) -> list[pa.Table]:
    """Return those of each robot that came by one spool, however often that was begun anew."""
    whose = pc.replace_substring_regex(rows["spool"], "/.*", "")
    rows = rows.append_column("whose", whose)
    keys = rows.group_by(["robot", "whose"]).aggregate([]).to_pylist()
    column = pyarrow.dataset.field
    return [
        rows.filter((column("robot") == key["robot"]) & (column("whose") == key["whose"])) for key in keys
    ]


def _newest(rows: pa.Table) -> pyarrow.dataset.Expression:
    """Return the condition for the newest of these rows, whatever the robot's clock said."""
    column = pyarrow.dataset.field
    wanted = (column("robot") == rows["robot"][0]) & column("spool").isin(rows["spool"].unique())
    if len(rows) > KEPT:
        by_place = rows.sort_by([("batch", "descending"), ("number", "descending")])
        batch, number = (by_place[name][KEPT - 1] for name in ("batch", "number"))
        later = (column("batch") == batch) & (column("number") >= number)
        wanted &= (column("batch") > batch) | later
    return wanted
