"""From the cells' pressure to what the foot does: force and centre of pressure."""

from collections.abc import Sequence
from operator import mul
from typing import NamedTuple, cast

from drivers.insole.layout import Layout


class Load(NamedTuple):
    """Load of one foot."""

    force: float | None  # N; None where a cell is missing, since the sum would be too low
    cop_x: float | None  # m, foot frame; None below the force threshold
    cop_y: float | None


UNKNOWN = Load(None, None, None)


def load_of(pressures: Sequence[float | None], layout: Layout, force_threshold: float) -> Load:
    """Force Σ pᵢAᵢ and centre of pressure Σ rᵢpᵢAᵢ / Σ pᵢAᵢ of `pressures` (Pa, one for each cell)."""
    if None in pressures or len(pressures) != len(layout.cells):
        return UNKNOWN
    known = cast("Sequence[float]", pressures)
    force = sum(map(mul, known, layout.areas))
    if force < force_threshold:
        return Load(force, None, None)
    return Load(
        force,
        sum(map(mul, known, layout.moments_x)) / force,
        sum(map(mul, known, layout.moments_y)) / force,
    )


class Stance:
    """Contact of a foot with the ground, and its share of both feet's load."""

    def __init__(self, force_threshold: float) -> None:
        self._threshold = force_threshold
        self._down = False

    def contact(self, force: float | None) -> float | None:
        """1 on the ground, 0 in the air; it lifts at half the force at which it lands."""
        if force is None:
            return None
        self._down = force >= self._threshold * (0.5 if self._down else 1.0)
        return float(self._down)

    def share(self, force: float | None, others: float | None) -> float | None:
        """0 to 1; `None` where a foot is unknown or nobody stands."""
        if force is None or others is None or force + others < self._threshold:
            return None
        return force / (force + others)
