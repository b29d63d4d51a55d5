"""Resource-processing over a recording: what each program took, and whether its memory surely grew."""

import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from server_gui.core.processing.regression import by_name
from server_gui.core.processing.resource import LEAK_FEWEST, WARM_UP_MINUTES, leaking
from server_gui.core.processing.trend import Slope

MINUTE_S = 60.0
MOST_BLOCKS = 480  # of a long recording: its trend is of eight hours' minutes, or as many longer blocks

Looks = Iterable[tuple[float, Sequence[Mapping[str, Any]]]]


@dataclass(frozen=True, slots=True)
class ProgramUse:
    """All processes of one name together: medians over the recording, and a leak in bytes an hour."""

    name: str
    cpu_percent: float | None  # of one core
    memory_bytes: float
    most_bytes: float
    leak: Slope | None
    idle: bool  # no look saw any memory or CPU of it


def looks(rows: Iterable[Mapping[str, Any]]) -> Iterator[tuple[float, Sequence[Mapping[str, Any]]]]:
    """Yield looks from rows of the store's table `resources`: when, in s of UTC, and the processes."""
    for row in rows:
        yield row["utc"].timestamp(), row["processes"] or ()


def used(seen: Looks) -> list[ProgramUse]:
    """Return the use of each program, the largest memory first."""
    programs: dict[str, list[tuple[float, dict[str, float]]]] = {}
    for time_s, processes in seen:
        for name, sums in by_name(processes).items():
            programs.setdefault(name, []).append((time_s, sums))
    found = [_program(name, kept) for name, kept in programs.items()]
    return sorted(found, key=lambda use: (-use.memory_bytes, use.name))


def _program(name: str, kept: list[tuple[float, dict[str, float]]]) -> ProgramUse:
    cpu = [sums["cpu_percent"] for _, sums in kept if "cpu_percent" in sums]
    memory = [(time_s, sums["memory_bytes"]) for time_s, sums in kept]
    sizes = [size for _, size in memory]
    return ProgramUse(
        name,
        statistics.median(cpu) if cpu else None,
        statistics.median(sizes),
        max(sizes),
        _leak(memory),
        idle=not any(cpu) and not any(sizes),
    )


def _leak(memory: list[tuple[float, float]]) -> Slope | None:
    """As live: medians of blocks, without a program's first minutes."""
    block_s = max(MINUTE_S, (memory[-1][0] - memory[0][0]) / MOST_BLOCKS)
    blocks: dict[int, list[float]] = {}
    for time_s, size in memory:
        if time_s - memory[0][0] >= WARM_UP_MINUTES * MINUTE_S:
            blocks.setdefault(int(time_s // block_s), []).append(size)
    medians = [(block * block_s, statistics.median(sizes)) for block, sizes in sorted(blocks.items())]
    return leaking(medians) if len(medians) >= LEAK_FEWEST else None
