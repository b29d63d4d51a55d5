"""Outcome of an evaluation, as plain data for a report, a table or JSON."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class Outcome:
    """A benchmark's figures, and what they are made of."""

    figures: Mapping[str, float]  # by the keys of --json
    subjects: int | None  # None where the recordings do not say whose they are
    by_group: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # subject or place → figures
    grouped_by: str = "subject"
    classes: tuple[str, ...] = ()
    confusion: npt.NDArray[np.int_] | None = None  # rows are the truth
    settings: str = ""  # what was chosen by --search, fold by fold
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Goal:
    """Goal of a figure, and a stretch goal beyond it."""

    limit: float
    at_most: bool = False
    stretch: float | None = None

    def reached(self, value: float) -> bool:
        return self._within(self.limit, value)

    def verdict(self, value: float) -> str:
        """In a word, for a person."""
        if self.stretch is not None and self._within(self.stretch, value):
            return "stretch reached"
        return "reached" if self.reached(value) else "missed"

    def _within(self, limit: float, value: float) -> bool:
        return value <= limit if self.at_most else value >= limit

    def __str__(self) -> str:
        better = "" if self.stretch is None else f" (stretch {self.stretch:g})"
        return f"{'≤' if self.at_most else '≥'} {self.limit:g}{better}"
