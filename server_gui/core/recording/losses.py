"""Lost data, by name: whose rows, how many, from when to when."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Final

from server_gui.core.recording.rows import JournalHead, Record, Run

Part = Run | Record | tuple[str, JournalHead]  # what is committed: rows, or up to where a journal is recorded
_ANY: Final = ""  # nobody knows of which table


@dataclass(slots=True)
class Loss:
    """So many rows, between two times where these are known; ns, UTC."""

    rows: int = 0
    times_ns: list[int] = field(default_factory=list)  # the first and the last

    def add(self, rows: int, times_ns: Iterable[int]) -> None:
        """Add so many more, of these times."""
        found = [*self.times_ns, *times_ns]
        self.rows += rows
        self.times_ns = [min(found), max(found)] if found else []


class Losses:
    """All that was lost and that no event tells yet; a robot "" is nobody knows whose."""

    def __init__(self) -> None:
        self._found: dict[str, dict[str, Loss]] = defaultdict(lambda: defaultdict(Loss))

    @property
    def rows(self) -> int:
        """Number of lost rows."""
        return sum(lost.rows for _, _, lost in self.each())

    def add(self, parts: Iterable[Part]) -> None:
        """Add these losses; unrecorded journals are read again, and not reported."""
        for part in parts:
            if isinstance(part, Run):
                times = (part.stamps_ns + part.utc_offset_ns).tolist()
                self._found[part.robot][f"telemetry, session {part.session}"].add(len(part), times)
            elif isinstance(part, Record):
                robot = str(part.fields.get("robot") or "")
                utc_ns = part.fields.get("utc")
                self._found[robot][part.table].add(1, [utc_ns] if isinstance(utc_ns, int) else [])

    def count(self, robot: str, rows: int, utc_ns: int) -> None:
        """Count so many of this robot, at about that time; nobody has looked of which table."""
        if rows:
            self._found[robot][_ANY].add(rows, [utc_ns])

    def robots(self) -> Iterator[tuple[str, Loss, str]]:
        """Yield each robot with all that it has lost, and that in words."""
        for robot, tables in self._found.items():
            whole = Loss()
            for lost in tables.values():
                whole.add(lost.rows, lost.times_ns)
            yield robot, whole, "; ".join(_told(table, lost) for table, lost in tables.items())

    def lines(self) -> list[str]:
        """Return a line a robot and table."""
        return [f"{robot or 'no robot'}: {_told(table, lost)}" for robot, table, lost in self.each()]

    def join(self, others: "Losses") -> None:
        """Add these."""
        for robot, table, lost in others.each():
            self._found[robot][table].add(lost.rows, lost.times_ns)

    def each(self) -> Iterator[tuple[str, str, Loss]]:
        """Robot, table, and what is lost of that."""
        for robot, tables in self._found.items():
            for table, lost in tables.items():
                yield robot, table, lost


def _told(table: str, lost: Loss) -> str:
    rows = "1 row" if lost.rows == 1 else f"{lost.rows} rows"
    of = f" of {table}" if table else ""
    span = ", {} to {}".format(*map(told_time, lost.times_ns)) if lost.times_ns else ""
    return rows + of + span


def told_time(utc_ns: int) -> str:
    """Return a time for people, in UTC."""
    return f"{datetime.fromtimestamp(utc_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S.%f}Z"
