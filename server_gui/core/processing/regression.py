"""Regressions: what a new version of the software costs more than the one before, process by process."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from server_gui.core.processing.trend import rank_sum_p

Floats = npt.NDArray[np.float64]

MEASURES = {"cpu_percent": 1.0, "memory_bytes": 2.0 * (1 << 20)}  # each with the least difference that counts
RATIO = 1.10  # less than a tenth more is not worth a word
P = 0.01  # of the rank-sum test, divided by the number of comparisons (Bonferroni)
BLOCK_S = 60.0  # samples of one minute are one value: they depend on each other


@dataclass(frozen=True, slots=True)
class SessionUse:
    """Use of each process in one session: per process and measure, a median a minute."""

    version: str
    processes: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)

    @property
    def minutes(self) -> int:
        """Number of minutes measured."""
        series = (minutes for measures in self.processes.values() for minutes in measures.values())
        return max(map(len, series), default=0)

    @classmethod
    def of(cls, version: str, looks: Iterable[tuple[float, Sequence[Mapping[str, object]]]]) -> "SessionUse":
        """From looks: time in s, and the processes as the store's table `resources` has them.

        Processes of one name count together: their numbers are added up in each look.
        """
        minutes: dict[str, dict[str, dict[int, list[float]]]] = {}
        for time_s, processes in looks:
            for name, sums in by_name(processes).items():
                for measure, value in sums.items():
                    kept = minutes.setdefault(name, {}).setdefault(measure, {})
                    kept.setdefault(int(time_s // BLOCK_S), []).append(value)
        medians = {
            name: {
                measure: np.array([float(np.median(kept[minute])) for minute in sorted(kept)])
                for measure, kept in measures.items()
            }
            for name, measures in minutes.items()
        }
        return cls(version, medians)


@dataclass(frozen=True, slots=True)
class Regression:
    """A process that costs more since a version: medians over the minutes of all sessions."""

    process: str
    measure: str
    version_before: str
    version_after: str
    before: float
    after: float
    p: float

    @property
    def text(self) -> str:
        """For people."""
        scale, unit = (1.0, "% of a core") if self.measure == "cpu_percent" else (1.0 / (1 << 20), "MiB")
        more = f"{100.0 * (self.after / self.before - 1.0):.0f} % more" if self.before else "more"
        return (
            f"{self.process} uses {more} with {self.version_after}: {self.before * scale:.1f} → "
            f"{self.after * scale:.1f} {unit} against {self.version_before} (p = {self.p:.1g})"
        )


def regressions(before: Sequence[SessionUse], after: Sequence[SessionUse]) -> list[Regression]:
    """Return programs that cost more in `after` than in `before`, the largest ratio first.

    A process counts that was seen in both, if its median is a tenth and `MEASURES` more, if three quarters of
    the sessions after lie above three quarters of those before, and if chance is refused by the rank-sum
    test at `P` over all comparisons together.
    """
    names = sorted(_names(before) & _names(after))
    compared = [
        (name, measure, old, new)
        for name in names
        for measure in MEASURES
        if (old := _series(before, name, measure)) and (new := _series(after, name, measure))
    ]
    versions = _versions(before), _versions(after)
    found = [_judge(*pair, versions, P / len(compared)) for pair in compared]
    known = [regression for regression in found if regression is not None]
    return sorted(known, key=lambda one: -one.after / max(one.before, MEASURES[one.measure]))


def _judge(
    name: str,
    measure: str,
    before: list[Floats],
    after: list[Floats],
    versions: tuple[str, str],
    limit: float,
) -> Regression | None:
    """`before` and `after` have a series of minutes a session."""
    old, new = np.concatenate(before), np.concatenate(after)
    was, now = float(np.median(old)), float(np.median(new))
    if now < RATIO * was or now - was < MEASURES[measure]:
        return None
    if np.quantile(_medians(after), 0.25) <= np.quantile(_medians(before), 0.75):
        return None
    p = rank_sum_p(old, new)
    return Regression(name, measure, *versions, was, now, p) if p < limit else None


def _medians(sessions: list[Floats]) -> list[float]:
    return [float(np.median(minutes)) for minutes in sessions]


def _versions(sessions: Sequence[SessionUse]) -> str:
    return ", ".join(sorted({use.version for use in sessions}))


def by_name(processes: Sequence[Mapping[str, object]]) -> dict[str, dict[str, float]]:
    """Return the sums over the processes of each name."""
    sums: dict[str, dict[str, float]] = {}
    for process in processes:
        kept = sums.setdefault(str(process["name"]), {})
        for measure in MEASURES:
            value = process.get(measure)
            if isinstance(value, int | float):
                kept[measure] = kept.get(measure, 0.0) + value
    return sums


def _names(sessions: Sequence[SessionUse]) -> set[str]:
    return {name for session in sessions for name in session.processes}


def _series(sessions: Sequence[SessionUse], name: str, measure: str) -> list[Floats]:
    return [use.processes[name][measure] for use in sessions if measure in use.processes.get(name, {})]
