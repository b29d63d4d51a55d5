"""Found events against true ones: each true event is matched by at most one found event of its kind."""

import bisect
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

TOLERANCE_NS = 50_000_000


@dataclass
class Score:
    """How events of one kind were found; `errors_ns` are found − true."""

    true: int = 0
    found: int = 0
    errors_ns: list[float] = field(default_factory=list)

    @property
    def f1(self) -> float:
        return 2 * len(self.errors_ns) / max(1, self.true + self.found)

    @property
    def median_ms(self) -> float:
        return statistics.median(self.errors_ns) / 1e6 if self.errors_ns else 0.0

    def add(self, other: "Score") -> None:
        self.true += other.true
        self.found += other.found
        self.errors_ns += other.errors_ns


def matched(
    true_ns: Sequence[float], found_ns: Iterable[float], tolerance_ns: float = TOLERANCE_NS
) -> dict[float, float | None]:
    """Each found time with the true time that it matches, None where there is none."""
    left = sorted(true_ns)
    pairs: dict[float, float | None] = {}
    for found in sorted(found_ns):
        place = bisect.bisect(left, found)
        near = [time for time in left[max(0, place - 1) : place + 1] if abs(time - found) <= tolerance_ns]
        best = min(near, key=lambda time: abs(time - found), default=None)
        pairs[found] = best
        if best is not None:
            left.remove(best)
    return pairs


def score(true_ns: Sequence[float], found_ns: Sequence[float], tolerance_ns: float = TOLERANCE_NS) -> Score:
    pairs = matched(true_ns, found_ns, tolerance_ns)
    errors = [found - true for found, true in pairs.items() if true is not None]
    return Score(len(true_ns), len(found_ns), errors)
