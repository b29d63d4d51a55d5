"""Precedence of rows about the same fact: the latest is valid.

Each row but telemetry's has the spool that it came from, the batch in that and its number in the batch: of
one spool these say what came later, whatever the clocks said. Between several spools only the time does.

`spool` is the spool's id, a slash and what an opening of the spool is called, which begins with a time that
is later than those of all openings that it knows of. So where an older copy of a spool was put in its place,
and batches have numbers that were given before, the later opening's rows are later all the same.
"""

import re
from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Any, Final

OPENED: Final = r"/([0-9]{16})-"  # in `spool`: when, in us since 1970; older ones do not say
Row = Mapping[str, Any]


def last(rows: Iterable[Row], about: Callable[[Row], Hashable], time: Callable[[Row], Any]) -> list[Row]:
    """Return the last of the rows that are `about` the same; `time` orders those of several spools."""
    of_spools: dict[Hashable, Row] = {}
    for row in sorted(rows, key=lambda row: (*_place(row), time(row))):
        of_spools[about(row), spool(row)] = row
    return list({about(row): row for row in sorted(of_spools.values(), key=time)}.values())


def recorded_order(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows as they were recorded; those of several spools by `utc`."""
    newest: dict[str, Any] = {}
    found = []
    for row in sorted(rows, key=lambda row: (*_place(row), row["utc"])):
        whose = spool(row)
        newest[whose] = max(newest.get(whose, row["utc"]), row["utc"])
        found.append((newest[whose], row))
    return [row for _, row in sorted(found, key=lambda each: each[0])]


def spool(row: Row) -> str:
    """Return the spool of a row, without the name of its opening."""
    return str(row.get("spool") or "").partition("/")[0]


def opened_us(spool: str) -> int:
    """Return when this opening of a spool was, by its name; 0 where that does not say."""
    found = re.search(OPENED, spool)
    return int(found[1]) if found else 0


def _place(row: Row) -> tuple[int, int, int]:
    """Return its place in its spool."""
    return opened_us(str(row.get("spool") or "")), row.get("batch") or 0, row.get("number") or 0
