"""What the store has at the end of a play, each table read once."""

from collections import defaultdict
from functools import cached_property
from typing import Any

from ml.store import Store, reading
from ml.store.tables import EVENTS, TELEMETRY, Table
from server_gui.core.recording.batching import EventKind
from tests.explore_store.robots import COUNT
from tests.explore_store.server import Server

LENGTH_OF_AN_ID = 36
Line = dict[str, Any]


class There:
    """The tables of a store to which nobody writes any more."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._lines: dict[str, list[Line]] = {}

    def lines(self, table: Table) -> list[Line]:
        """Every row of a table."""
        if table.name not in self._lines:
            self._lines[table.name] = rows_of(self.store, table)
        return self._lines[table.name]

    def events(self, kind: EventKind) -> list[Line]:
        """Those of one kind."""
        return [line for line in self.lines(EVENTS) if line["kind"] == kind.value]

    @cached_property
    def rows(self) -> dict[int, list[Line]]:
        """The telemetry by the rows' numbers; 0 where they have none."""
        found: dict[int, list[Line]] = defaultdict(list)
        for line in self.lines(TELEMETRY):
            found[number_of(line) or 0].append(line)
        return found

    @cached_property
    def units(self) -> dict[str, str | None]:
        """Of the telemetry's columns."""
        return reading.units(self.store, TELEMETRY)


def rows_of(store: Store, table: Table) -> list[Line]:
    found: list[Line] = reading.dataset(store, table).to_table().to_pylist()
    return found


def number_of(line: Line) -> int | None:
    """Which row of the ledger it is."""
    return next((int(v) for name, v in line.items() if v is not None and name.startswith(COUNT)), None)


def values_of(line: Line, channel: str) -> dict[str, float]:
    """What a channel's columns have."""
    return {name: value for name, value in line.items() if value is not None and name.startswith(channel)}


def spool_of(line: Line) -> str:
    """Whose row it is: the spool's own name, without that of its opening."""
    return str(line["spool"])[:LENGTH_OF_AN_ID]


def identity(server: Server) -> str:
    """What its spool is called; nothing where that was lost."""
    file = server.folder / "id"
    return file.read_text().strip() if file.exists() else ""
