"""What any insole format gives: the cells of one foot at one moment."""

import msgspec

from drivers.insole.layout import Foot


class InsoleFrame(msgspec.Struct, frozen=True):
    """One scan of one foot.

    `cells` are pascals where `calibrated`, else the converter's counts; `None` for a cell that the device
    says is missing.
    """

    cells: tuple[float | None, ...]
    foot: Foot | None = None  # None: the format does not say
    calibrated: bool = False
    bits: int | None = None  # of the converter, where the format says
    saturated: bool = False  # the device says that a cell is at its end
    missing: bool = False  # the device says that cells are missing
    sequence: int | None = None
    ticks: int | None = None  # the device's clock, in its own unit
    late: bool = False  # repeated, or older than a frame before it
