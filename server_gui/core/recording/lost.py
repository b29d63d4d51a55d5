"""What was to be kept and could not be, by name: whose rows, how many, from when to when."""

from collections import defaultdict
from collections.abc import Iterable
from datetime import UTC, datetime

from server_gui.core.recording.rows import JournalHead, Record, Run

Part = Run | Record | tuple[str, JournalHead]  # what is committed: rows, or up to where a journal is recorded


def told(parts: Iterable[Part]) -> list[str]:
    """A line a robot and table; journals that were not recorded are seen again, and not told."""
    counts: dict[tuple[str, str], int] = defaultdict(int)
    times: dict[tuple[str, str], list[int]] = defaultdict(list)
    for part in parts:
        if isinstance(part, Run):
            whose = (part.robot, f"telemetry, session {part.session}")
            counts[whose] += len(part)
            times[whose] += (part.stamps_ns + part.utc_offset_ns).tolist()
        elif isinstance(part, Record):
            whose = (str(part.fields.get("robot") or "no robot"), part.table)
            counts[whose] += 1
            times[whose] += [utc_ns for utc_ns in [part.fields.get("utc")] if isinstance(utc_ns, int)]
    return [
        f"{robot}: {count} rows of {table}{_span(times[robot, table])}"
        for (robot, table), count in counts.items()
    ]


def _span(times: list[int]) -> str:
    return f", {_time(min(times))} to {_time(max(times))}" if times else ""


def _time(utc_ns: int) -> str:
    return f"{datetime.fromtimestamp(utc_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S.%f}Z"
