"""A store to which batches are brought again, whatever of them it has, and whatever it knows of them."""

import uuid
from collections.abc import Iterator
from typing import Any, Final

import pyarrow as pa

from ml.store.errors import NoSuchTable
from ml.store.fragments import DataFile
from ml.store.snapshot import Snapshot
from ml.store.store import Batches, Store
from ml.store.tables import TELEMETRY, Table
from server_gui.core.recording import missing_rows
from server_gui.core.recording.receipts import ReceiptPart

Whose = tuple[str, str | None, str | None]  # location; robot and session where rows of these lie together
NOBODYS: Final = (None, None)


def whose(of: DataFile | ReceiptPart) -> Whose:
    """Return where the rows lie that a file or a batch's part holds."""
    if isinstance(of, DataFile):
        return of.location, of.robot, of.session
    robot, session = (of.stream.robot, of.stream.session) if of.stream else NOBODYS
    return of.location, robot, session


class Again(Store):
    """Repeated upload: existing rows stay, missing ones are added, rows removed by retention stay away.

    Rows are looked for by their names: a copy of a store may have them and not the numbers of their batches.
    Where `closed`, because a damaged file stays there, nothing is looked for and nothing added.
    """

    def __init__(self, url: str | None = None, shards: int = 1, several_writers: bool = True) -> None:
        super().__init__(url, shards, several_writers)
        self.closed: frozenset[Whose] = frozenset()
        self.passed: set[str] = set()  # where that was so
        self.left: dict[str, None] = {}  # in words, what contradicts, in its order

    def append(
        self, table: Table, location: str, schema: pa.Schema, batches: Batches, writer: str, sequence: int
    ) -> bool:
        """As `Store.append`, but what is missing is added also where the number is known; always True."""
        super().append(table, location, schema, lambda: iter(()), writer, 0)  # its columns, and no rows
        before = len(self.passed) + len(self.left)
        rows = missing_rows.newer(self._lacking(table, location, schema, batches), self, location)
        is_whole = len(self.passed) + len(self.left) == before
        known = (self.table(location).transaction_version(writer) or 0) >= sequence
        if is_whole and not known:
            super().append(table, location, schema, lambda: iter(rows), writer, sequence)
        elif rows:
            named = f"{writer}/{sequence}.{uuid.uuid4().hex[:12]}"
            super().append(table, location, schema, lambda: iter(rows), named, 1)
        return True

    def _lacking(
        self, table: Table, location: str, schema: pa.Schema, batches: Batches
    ) -> list[pa.RecordBatch]:
        if table.name == TELEMETRY.name:
            return missing_rows.of_telemetry(self, location, self._open_ones(location, batches()), self._hear)
        if (location, *NOBODYS) in self.closed:
            self.passed.add(location)
            return []
        rows = pa.Table.from_batches(batches(), schema)
        found: list[pa.RecordBatch] = missing_rows.of_rows(self, table, rows, self._hear).to_batches()
        return found

    def _open_ones(self, location: str, runs: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        for run in runs:
            if (location, run["robot"][0].as_py(), run["session"][0].as_py()) in self.closed:
                self.passed.add(location)
            else:
                yield run

    def _hear(self, text: str) -> None:
        self.left[text] = None


class Untouched(Snapshot):
    """A store to which nothing is written: what would be brought is only counted.

    Each table is opened once, not three times for each batch.
    """

    def append(self, *wanted: Any) -> bool:
        """As if it had been written."""
        _table, _location, _schema, batches, *_ = wanted
        for _ in batches():
            pass
        return True

    def identity(self, location: str) -> str:
        """Nothing where the table is not there yet."""
        try:
            return super().identity(location)
        except NoSuchTable:
            return ""
