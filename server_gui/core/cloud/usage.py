"""Contents of a store: its tables, and the space that each robot takes."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

from ml.store import reading
from ml.store.fragments import DataFile, Extent
from ml.store.objects import Object
from ml.store.store import Store
from ml.store.tables import TABLES


@dataclass(frozen=True, slots=True)
class Usage:
    """A table's, or a robot's in it, in the newest version; `robot` is None where rows are not kept apart."""

    table: str
    robot: str | None
    files: int
    rows: int
    size_bytes: int
    first: datetime | None
    last: datetime | None


def by_table(store: Store) -> list[Usage]:
    """Return each table that something was written to."""
    found = {name: list(reading.files(store, table)) for name, table in TABLES.items()}
    return [_usage(name, None, files) for name, files in found.items() if files]


def by_robot(store: Store) -> Iterator[Usage]:
    """Yield each table's robots, where they have files of their own."""
    for name, table in TABLES.items():
        files: dict[str | None, list[DataFile]] = defaultdict(list)
        for file in reading.files(store, table):
            files[file.robot].append(file)
        for robot, of_robot in sorted(files.items(), key=str):
            yield _usage(name, robot, of_robot)


def below(store: Store, prefix: str) -> list[Object]:
    """Return every object there."""
    return sorted(store.objects.listing(prefix), key=lambda found: found.path)


def _usage(table: str, robot: str | None, files: Sequence[DataFile]) -> Usage:
    held = Extent(files)
    return Usage(table, robot, len(files), held.rows, held.size_bytes, held.first, held.last)
