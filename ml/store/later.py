"""Which of several rows that say something of the same was said last.

Each row but telemetry's has the spool that it came from, the batch in that and its number in the batch: of
one spool these say what came later, whatever the clocks said. Between several spools only the time does.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Any

Row = Mapping[str, Any]


def last(rows: Iterable[Row], about: Callable[[Row], Hashable], time: Callable[[Row], Any]) -> list[Row]:
    """Of the rows that are `about` the same the last one; `time` orders those of several spools."""
    of_spools: dict[Hashable, Row] = {}
    for row in sorted(rows, key=lambda row: (row.get("batch") or 0, row.get("number") or 0, time(row))):
        of_spools[about(row), spool(row)] = row
    return list({about(row): row for row in sorted(of_spools.values(), key=time)}.values())


def recorded_order(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows as they were recorded; those of several spools by `utc`."""
    newest: dict[str, Any] = {}
    found = []
    for row in sorted(rows, key=lambda row: (row.get("batch") or 0, row.get("number") or 0, row["utc"])):
        whose = spool(row)
        newest[whose] = max(newest.get(whose, row["utc"]), row["utc"])
        found.append((newest[whose], row))
    return [row for _, row in sorted(found, key=lambda each: each[0])]


def spool(row: Row) -> str:
    """Whose row it is, however often that spool was begun anew."""
    return str(row.get("spool") or "").partition("/")[0]
