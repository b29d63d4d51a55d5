"""From a cell's counts to its pressure: polarity, tare, a law and where it saturates."""

import bisect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal, cast

import msgspec

from drivers import calibration_file
from drivers.errors import SettingsError

Positive = Annotated[float, msgspec.Meta(gt=0)]
Pressure = Callable[[float], float]


class CellCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One cell: counts → polarity → minus tare → law → Pa. Less than the tare is no pressure."""

    polarity: Literal["rising", "falling"] = "rising"  # falling: fewer counts are more load
    full_scale: Positive | None = None  # counts of an unloaded falling cell's converter, such as 4095
    tare: float = 0.0  # counts of the unloaded cell, after polarity
    law: Literal["linear", "power", "table"] = "linear"
    gain: Positive = 1.0  # Pa for each count; for `power`, Pa for each count to the exponent
    exponent: Positive = 1.0
    table: tuple[tuple[float, float], ...] = ()  # (counts, Pa), both rising
    saturation: float | None = None  # counts, after polarity, from which the cell says no more

    def __post_init__(self) -> None:
        if self.polarity == "falling" and self.full_scale is None:
            raise ValueError('polarity = "falling" needs `full_scale`, the counts of the unloaded cell')
        if (self.law == "table") != bool(self.table):
            raise ValueError('law = "table" and `table` belong together')
        rising = all(a[0] < b[0] and a[1] <= b[1] for a, b in zip(self.table, self.table[1:], strict=False))
        if self.law == "table" and (len(self.table) < 2 or not rising):
            raise ValueError("`table` needs two or more [counts, Pa], both rising")


class Calibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An insole's cells: `default` for all, `cell.N` for those that differ."""

    default: CellCalibration | None = None
    cell: dict[str, CellCalibration] = {}
    taken_utc: str = ""

    def __post_init__(self) -> None:
        wrong = [number for number in self.cell if not number.isdecimal()]
        if wrong:
            raise ValueError(f"`cell` has {wrong[0]!r}: cells are numbered from 0, as [cell.0]")


class Cells:
    """An insole's calibration, ready to use.

    Raises:
        SettingsError: a cell has no calibration.

    """

    def __init__(self, calibration: Calibration, count: int) -> None:
        chosen = [calibration.cell.get(str(number), calibration.default) for number in range(count)]
        surplus = [number for number in calibration.cell if int(number) >= count]
        if surplus:
            raise SettingsError(
                f"the calibration has a cell {surplus[0]}; the layout ends at cell {count - 1}"
            )
        cells = [cell for cell in chosen if cell is not None]
        if len(cells) < count:
            raise SettingsError(
                f"the calibration says nothing of cell {chosen.index(None)}: add [cell.N] or [default]"
            )
        self._laws = [_law(cell) for cell in cells]
        self._lines = [_line(cell) for cell in cells] if all(cell.law == "linear" for cell in cells) else None
        ends = [_end(cell) for cell in cells]
        self._ends = ends if any(end is not None for end in ends) else []

    def pressures(self, counts: Sequence[float | None]) -> tuple[float | None, ...]:
        """Pa of each cell; `None` for a cell without counts."""
        if self._lines is not None and None not in counts:
            pairs = zip(cast("Sequence[float]", counts), self._lines, strict=True)
            felt = [slope * count + offset for count, (slope, offset) in pairs]
            return tuple([pascal if pascal > 0.0 else 0.0 for pascal in felt])
        return tuple(
            None if count is None else law(count) for count, law in zip(counts, self._laws, strict=True)
        )

    def saturated(self, counts: Sequence[float | None]) -> bool:
        """Return whether a cell is at its end, so that it may carry more than it says."""
        return any(
            count is not None and reached is not None and reached(count)
            for count, reached in zip(counts, self._ends, strict=False)
        )


def load(path: Path) -> Calibration:
    """Return the calibration in the file at `path`.

    Raises:
        SettingsError: it cannot be read or is wrong; the message names file and key.

    """
    return calibration_file.load(
        path, Calibration, "insole calibration", "gwrms calibrate insole", "calibration"
    )


def loaded_counts(cell: CellCalibration) -> Callable[[float], float]:
    """Raw counts to counts that rise with the load."""
    full_scale = cell.full_scale or 0.0
    return (lambda raw: full_scale - raw) if cell.polarity == "falling" else (lambda raw: raw)


def _law(cell: CellCalibration) -> Pressure:
    rising, tare, gain, exponent = loaded_counts(cell), cell.tare, cell.gain, cell.exponent
    if cell.law == "table":
        return lambda raw: _interpolated(cell.table, rising(raw) - tare)
    if cell.law == "power":
        return lambda raw: gain * max(0.0, rising(raw) - tare) ** exponent
    slope, offset = _line(cell)
    return lambda raw: max(0.0, slope * raw + offset)


def _line(cell: CellCalibration) -> tuple[float, float]:
    """Slope (Pa a raw count) and offset (Pa) of a linear cell, where it is loaded."""
    if cell.polarity == "falling":
        return -cell.gain, cell.gain * ((cell.full_scale or 0.0) - cell.tare)
    return cell.gain, -cell.gain * cell.tare


def _end(cell: CellCalibration) -> Callable[[float], bool] | None:
    """Return whether a raw count is at the cell's end, as a function; `None` for an unknown end."""
    rising = loaded_counts(cell)
    ends = [] if cell.saturation is None else [cell.saturation]
    if cell.table:
        ends.append(cell.table[-1][0] + cell.tare)
    if not ends:
        return None
    end = min(ends)
    return lambda raw: rising(raw) >= end


def _interpolated(table: tuple[tuple[float, float], ...], counts: float) -> float:
    """Interpolate between the table's points; its ends hold beyond them."""
    place = bisect.bisect_right(table, counts, key=lambda point: point[0])
    if place == 0:
        return table[0][1]
    if place == len(table):
        return table[-1][1]
    (x0, y0), (x1, y1) = table[place - 1], table[place]
    return y0 + (y1 - y0) * (counts - x0) / (x1 - x0)
