"""From the cells' pressure to what the foot does: force and centre of pressure."""

from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

from drivers.insole.layout import Layout


class Load(NamedTuple):
    """What one foot carries."""

    force: float | None  # N; None where a cell is missing, since the sum would be too low
    cop_x: float | None  # m, foot frame; None below the force threshold
    cop_y: float | None


UNKNOWN = Load(None, None, None)


def load_of(pressures: Sequence[float | None], layout: Layout, force_threshold: float) -> Load:
    """Force Σ pᵢAᵢ and centre of pressure Σ rᵢpᵢAᵢ / Σ pᵢAᵢ of `pressures` (Pa, one for each cell)."""
    known = [pressure for pressure in pressures if pressure is not None]
    if len(known) != len(layout.cells) or len(known) != len(pressures):
        return UNKNOWN
    force = sum(map(mul, known, layout.areas))
    if force < force_threshold:
        return Load(force, None, None)
    return Load(
        force,
        sum(map(mul, known, layout.moments_x)) / force,
        sum(map(mul, known, layout.moments_y)) / force,
    )
