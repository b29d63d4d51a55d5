"""An insole's calibration from known loads: tare of each cell, then one gain (and exponent) for all."""

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.errors import DriverError
from drivers.insole.calibration import Calibration, CellCalibration
from drivers.insole.layout import Layout

FEWEST_COUNTS = 3.0  # a load that moves no cell by more than this was not on the insole
EXPONENTS = [number / 100 for number in range(50, 301)]


class BadFit(DriverError):
    """The measurements cannot give a calibration."""


@dataclass(frozen=True, slots=True)
class Load:
    """A known force on the whole insole, and what each cell read under it."""

    force: float  # N
    counts: tuple[float, ...]  # after polarity


@dataclass(frozen=True, slots=True)
class Fit:
    """The calibration, and what it makes of the loads it came from."""

    calibration: Calibration
    forces: tuple[float, ...]  # N, as the calibrated insole measures the loads
    rms_error: float  # N


def fit(
    layout: Layout, tares: Sequence[float], loads: Sequence[Load], base: CellCalibration, power: bool = False
) -> Fit:
    """Least squares of Σ Aᵢ·gain·(countsᵢ − tareᵢ)^exponent over the known forces.

    `base` says polarity, full scale and saturation. The exponent is 1, or with `power` the one of the
    smallest error, which takes two different loads.

    Raises:
        BadFit: no load, a load that the insole did not feel, or too few loads for an exponent.

    """
    if len({load.force for load in loads}) < (2 if power else 1):
        raise BadFit("too few loads: give one known load, or two different ones for a power law")
    for load in loads:
        if max(count - tare for count, tare in zip(load.counts, tares, strict=True)) < FEWEST_COUNTS:
            raise BadFit(
                f"the insole did not feel the load of {load.force:.0f} N: "
                "check that it lies on the cells and that the polarity is right (--falling)"
            )
    error, exponent, gain, forces = min(
        _with_exponent(layout, tares, loads, k) for k in (EXPONENTS if power else [1.0])
    )
    cells = {
        str(number): CellCalibration(
            polarity=base.polarity,
            full_scale=base.full_scale,
            tare=round(tare, 3),
            law="power" if power else "linear",
            gain=gain,
            exponent=exponent,
            saturation=base.saturation,
        )
        for number, tare in enumerate(tares)
    }
    return Fit(Calibration(cell=cells), forces, error)


def _with_exponent(
    layout: Layout, tares: Sequence[float], loads: Sequence[Load], exponent: float
) -> tuple[float, float, float, tuple[float, ...]]:
    """Error (N), exponent, gain and measured forces of the best gain at one exponent."""
    raw = [
        sum(
            area * max(0.0, count - tare) ** exponent
            for area, count, tare in zip(layout.areas, load.counts, tares, strict=True)
        )
        for load in loads
    ]
    gain = sum(x * load.force for x, load in zip(raw, loads, strict=True)) / sum(x * x for x in raw)
    forces = tuple(gain * x for x in raw)
    squares = [(force - load.force) ** 2 for force, load in zip(forces, loads, strict=True)]
    return (sum(squares) / len(squares)) ** 0.5, exponent, gain, forces


def text(fitted: Fit, taken_utc: str) -> str:
    """Return the calibration as the file that `calibration = …` names."""
    lines = [f'taken_utc = "{taken_utc}"', f"# fitted to known loads within {fitted.rms_error:.1f} N (rms)"]
    for number, cell in fitted.calibration.cell.items():
        lines += ["", f"[cell.{number}]", f'polarity = "{cell.polarity}"']
        if cell.full_scale is not None:
            lines.append(f"full_scale = {cell.full_scale}")
        lines += [
            f"tare = {cell.tare}",
            f'law = "{cell.law}"',
            f"gain = {cell.gain!r}",
            f"exponent = {cell.exponent}",
        ]
        if cell.saturation is not None:
            lines.append(f"saturation = {cell.saturation}")
    return "\n".join(lines) + "\n"
