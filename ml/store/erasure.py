"""A wearer's rows found in a store, deleted from every version of its tables, and looked for again.

A wearer is known by the session's own field or by a label, however that is spelled (`labels.person`).
"""

import contextlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Final
from urllib.parse import unquote

import pyarrow.compute as pc
import pyarrow.dataset
import pyarrow.parquet as pq

from ml.store import reading, tables, upkeep
from ml.store.errors import NoSuchTable, StoreError
from ml.store.labels import holding, person, wearer
from ml.store.store import Store
from ml.store.tables import EVENTS, LABELS, PREDICTIONS, RESOURCES, SESSIONS, TELEMETRY, Table
from ml.store.translation import translated
from ml.store.upkeep import Pin, pins

# What says whose a session is goes last, so that an interrupted deletion is found again and goes on.
TABLES: Final = (TELEMETRY, RESOURCES, EVENTS, PREDICTIONS, LABELS, SESSIONS)
AT_ONCE: Final = 50  # sessions in one deletion
Name = tuple[str, str]  # of a session: its robot, and what it is called


@dataclass(frozen=True, slots=True)
class Worn:
    """Somebody's sessions; `shared` are those of which somebody else is said to have worn the robot, too."""

    sessions: tuple[Name, ...]
    shared: tuple[Name, ...]


def worn(rows: Iterable[dict[str, object]], labels: Iterable[dict[str, object]], name: str) -> Worn:
    """Return the wearer's sessions by the given rows of `sessions` and `labels`."""
    people: dict[Name, set[str]] = {}
    for row in rows:
        if said := str(row.get("wearer") or ""):
            people.setdefault(_name(row), set()).add(person(said))
    for row in holding(labels):
        if worn_by := wearer(str(row["label"])):
            people.setdefault(_name(row), set()).add(person(worn_by))
    mine = {session: who for session, who in people.items() if person(name) in who}
    shared = sorted(session for session, who in mine.items() if len(who) > 1)
    return Worn(tuple(sorted(mine)), tuple(shared))


def told(store: Store, table: Table) -> list[dict[str, object]]:
    """Return the rows of `sessions` or `labels`."""
    with translated(f"{store.url}/{table.name} cannot be read"):
        found: list[dict[str, object]] = reading.dataset(store, table).to_table().to_pylist()
    return found


def writers(store: Store) -> set[str]:
    """Return the spools that have brought sessions, events or labels, by the names of their folders."""
    found: set[str] = set()
    for table in (SESSIONS, EVENTS, LABELS):
        with translated(f"{store.url}/{table.name} cannot be read"):
            rows = reading.dataset(store, table).to_table(columns=["spool"])
        found.update(name.partition("/")[0] for name in pc.unique(rows["spool"]).to_pylist() if name)
    return found


def counted(store: Store, sessions: Sequence[Name]) -> dict[str, int]:
    """Return the number of these sessions' rows in the newest version of each location."""
    found: Counter[str] = Counter()
    for location, mine in _locations(store, sessions):
        with contextlib.suppress(NoSuchTable), translated(f"{store.url}/{location} cannot be read"):
            found[location] += store.dataset(location).count_rows(filter=_of(mine))
    return {location: rows for location, rows in found.items() if rows}


def pinned(store: Store, sessions: Sequence[Name]) -> list[Pin]:
    """Return the pinned versions of models that hold rows of these sessions."""
    by_location = dict(_locations(store, sessions))
    return [
        named
        for named in pins(store)
        if named.location in by_location and _has(store, named, by_location[named.location])
    ]


def _has(store: Store, named: Pin, sessions: Sequence[Name]) -> bool:
    with translated(f"{store.url}/{named.location}, version {named.version}, cannot be read"):
        return bool(store.dataset(named.location, named.version).count_rows(filter=_of(sessions)))


def delete(store: Store, sessions: Sequence[Name]) -> None:
    """Delete the rows from the newest versions, and every file that only older ones need.

    No other server may write to these tables meanwhile: its files that no log names yet would go too.

    Raises:
        StoreError: it is not known what is deleted; call it again.

    """
    there = {location: mine for location, mine in _locations(store, sessions) if _is_there(store, location)}
    for location, mine in there.items():
        store.mend(location)
        with translated(f"{store.url}/{location} cannot be changed"):
            for at in range(0, len(mine), AT_ONCE):
                upkeep.remove(store, location, _is_of(mine[at : at + AT_ONCE]))
    concerned = [
        table for table in TABLES if not there.keys().isdisjoint(table.locations(store.about.shards))
    ]
    upkeep.vacuum(store, concerned, timedelta(0))
    for path in left(store, sessions):
        store.objects.remove(path)


def _is_of(sessions: Sequence[Name]) -> str:
    """In SQL."""
    return " OR ".join(
        f"(robot = {_quoted(robot)} AND session = {_quoted(name)})" for robot, name in sessions
    )


def left(store: Store, sessions: Sequence[Name]) -> list[str]:
    """Return every data file in the store that has rows of these sessions, whichever version needs it.

    Raises:
        StoreError: the newest version of a table still does; or a file cannot be read.

    """
    if still := counted(store, sessions):
        raise StoreError(f"{', '.join(still)} in {store.url} still have rows of theirs: somebody wrote them")
    newest = (file for table in tables.TABLES.values() for file in reading.files(store, table))
    needed = {f"{file.location}/{file.path}" for file in newest}
    files = (found.path for found in store.objects.listing() if found.path.endswith(".parquet"))
    others = (path for path in files if not needed & {path, unquote(path)})
    return [path for path in others if _holds(store, path, sessions)]


def _holds(store: Store, path: str, sessions: Sequence[Name]) -> bool:
    if "/_delta_log/" in path:
        return False
    folders = unquote(unquote(path))
    if "/robot=" in folders:
        return any(f"/robot={robot}/session={name}/" in folders for robot, name in sessions)
    with translated(f"{store.url}/{path} cannot be read"):
        schema = pq.read_schema(path, filesystem=store.files)
        if not {"robot", "session"} <= set(schema.names):
            return False
        rows = pq.read_table(path, filesystem=store.files, columns=["robot", "session"], partitioning=None)
        return bool(rows.filter(_of(sessions)).num_rows)


def _locations(store: Store, sessions: Sequence[Name]) -> Iterator[tuple[str, Sequence[Name]]]:
    """Yield where rows of theirs may be if there is such a table, and of which of them."""
    for table in TABLES:
        by_location: dict[str, list[Name]] = {}
        for robot, name in sessions:
            by_location.setdefault(table.location(robot, store.about.shards), []).append((robot, name))
        yield from sorted(by_location.items())


def _is_there(store: Store, location: str) -> bool:
    try:
        store.table(location)
    except NoSuchTable:
        return False
    return True


def _of(sessions: Sequence[Name]) -> pyarrow.dataset.Expression:
    column, wanted = pyarrow.dataset.field, pc.scalar(False)
    for robot, name in sessions:
        wanted = wanted | ((column("robot") == robot) & (column("session") == name))
    return wanted


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


def _name(row: dict[str, object]) -> Name:
    return str(row["robot"]), str(row["session"])
