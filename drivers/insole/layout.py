"""Layouts of insoles' cells: named ones that ship in `layouts/`, and the integrator's own files."""

import math
import tomllib
from functools import cached_property
from pathlib import Path

import msgspec

from drivers.errors import SettingsError
from drivers.insole.calibration import Calibration
from drivers.insole.description import CsvDescription, FrameDescription
from drivers.insole.foot import Foot
from drivers.insole.shipped import SHIPPED, shipped_names

Cell = tuple[float, float, float]


class Layout(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, dict=True):
    """Cells of one foot.

    The foot frame has its origin at the heel, on the foot's centre line, x forward, y left. `cells` are
    (x in m, y in m, area in m²), in the order in which the device sends them, as seen on `foot`; a layout
    without cells only describes a stream.
    """

    name: str
    cells: tuple[Cell, ...] = ()
    foot: Foot = "left"
    csv: CsvDescription | None = None  # of the stream, for `insole-csv`
    frame: FrameDescription | None = None  # of the stream, for `insole-frame`
    calibration: Calibration | None = None  # typical of the device; a measured one is better

    def __post_init__(self) -> None:
        if not self.cells and not (self.csv or self.frame):
            raise ValueError("`cells` is empty: list [x, y, area] of each cell")
        for number, (x, y, area) in enumerate(self.cells):
            if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(area) and area > 0):
                raise ValueError(f"cell {number} needs finite x and y and an area > 0 (m, m²)")
            if max(abs(x), abs(y)) > 0.5:
                raise ValueError(f"cell {number} at ({x}, {y}) is outside any foot: positions are in metres")

    @cached_property
    def areas(self) -> tuple[float, ...]:
        """m²."""
        return tuple(area for _, _, area in self.cells)

    @cached_property
    def moments_x(self) -> tuple[float, ...]:
        """Area times x, m³: what a cell's pressure contributes to the centre of pressure."""
        return tuple(x * area for x, _, area in self.cells)

    @cached_property
    def moments_y(self) -> tuple[float, ...]:
        """Area times y, m³."""
        return tuple(y * area for _, y, area in self.cells)

    def for_foot(self, foot: Foot) -> "Layout":
        """Return the same cells on `foot`: as they are, or mirrored."""
        if foot == self.foot:
            return self
        mirrored = tuple((x, -y, area) for x, y, area in self.cells)
        return msgspec.structs.replace(self, cells=mirrored, foot=foot)


def shipped() -> list[str]:
    """Return names of the layouts that ship, sorted by their number of cells."""
    return sorted(shipped_names(), key=lambda name: (len(load(name).cells), name))


def load(name: str, beside: Path | None = None) -> Layout:
    """Return the layout `name`: a shipped name, or a TOML file, looked for in the folder `beside` first.

    Raises:
        SettingsError: there is none, or it is wrong; the message names file and key.

    """
    file = _locate(name, beside)
    try:
        return msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8")), Layout)
    except OSError as error:
        known = ", ".join(shipped_names())
        raise SettingsError(
            f"insole layout {file} cannot be read ({error.strerror}): it lies beside the robot's file, "
            f"or is one of {known}"
        ) from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise SettingsError(f"insole layout {file}: {error}") from error


def _locate(name: str, beside: Path | None) -> Path:
    if not name.endswith(".toml"):
        file = SHIPPED / f"{name}.toml"
        if file.is_file():
            return file
        known = ", ".join(shipped_names())
        raise SettingsError(f"there is no insole layout {name!r}: use a .toml file, or one of {known}")
    return (beside or Path()) / name
