"""Measurements of an insole's cells, independent of its format."""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from hil_sim.gait.wearer import Foot
from hil_sim.sensors.faults import InsoleFaults

_SPREAD_X, _SPREAD_Y = 0.045, 0.030  # m, how far the load spreads around the centre of pressure
_NOISE_SHARE, _NOISE_PA = 0.01, 60.0
_STUCK_PA = 73_000.0
_SATURATED_PA = 40_000.0  # what cells say at most whose amplifier ends too low


class Cell(NamedTuple):
    """One cell: centre in the foot frame (m; x forward from the heel, y left), area it stands for (m²)."""

    x: float
    y: float
    area: float


@dataclass(frozen=True, slots=True)
class Pressures:
    """One measurement."""

    right: bool
    pascal: tuple[float, ...]
    saturated: bool


class Sole:
    """The sensing part of one foot's insole; `cells` are those of a left one."""

    def __init__(
        self, cells: Sequence[Cell], right: bool, faults: InsoleFaults, random_source: random.Random
    ) -> None:
        side = -1.0 if right else 1.0
        self.cells = [cell._replace(y=side * cell.y) for cell in cells]
        self._right = right
        self._faults = faults
        self._random = random_source
        self._drifted = 0.0
        self._last: Pressures | None = None

    def measure(self, own: Foot, other: Foot, dt: float) -> Pressures:
        """Return the load of the shoe that it lies in, `dt` seconds after the last measurement."""
        faults = self._faults
        self._drifted = self._drifted + faults.drift * dt if faults.drift else 0.0
        if self._last is None or not faults.frozen:
            foot = Foot(other.force, other.cop_x, -other.cop_y) if faults.swapped else own
            felt = self._felt(self.pressures(foot))
            end = _SATURATED_PA if faults.saturated else math.inf
            self._last = Pressures(self._right, tuple(min(one, end) for one in felt), max(felt) >= end)
        return self._last

    def pressures(self, foot: Foot) -> list[float]:
        """Return the true pressure of each cell (Pa): the force, spread around the centre of pressure."""
        if not foot.force:
            return [0.0] * len(self.cells)
        shares = [cell.area * self._nearness(cell, foot) for cell in self.cells]
        total = sum(shares)
        return [
            foot.force * share / (total * cell.area) for share, cell in zip(shares, self.cells, strict=True)
        ]

    @staticmethod
    def _nearness(cell: Cell, foot: Foot) -> float:
        x, y = (cell.x - foot.cop_x) / _SPREAD_X, (cell.y - foot.cop_y) / _SPREAD_Y
        return math.exp(-0.5 * (x * x + y * y))

    def _felt(self, truths: list[float]) -> list[float]:
        """Return the cells' measurements of the true pressures (Pa)."""
        faults, drifted, gauss = self._faults, self._drifted, self._random.gauss
        noises = [gauss(0.0, 1.0) for _ in truths]
        felt = [
            max(truth * (1.0 + _NOISE_SHARE * noise) + _NOISE_PA * noise + drifted, 0.0) * faults.scale
            for truth, noise in zip(truths, noises, strict=True)
        ]
        if faults.dead_cells:
            felt = [0.0 if number in faults.dead_cells else one for number, one in enumerate(felt)]
        if faults.stuck_cell is not None:
            felt = [_STUCK_PA if number == faults.stuck_cell else one for number, one in enumerate(felt)]
        return felt


def calibration_text(pascal_per_count: float) -> str:
    """Return the file that `gwrms calibrate insole` would write for identical cells."""
    return f"""\
# The simulated insole's converter: the same for every cell. A real one is measured: gwrms calibrate insole.
[default]
gain = {pascal_per_count}   # Pa a count
"""
