"""The common result of all insole formats: the cells of one foot at one moment."""

import msgspec

from drivers.insole.foot import Foot


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
    ticks: int | None = None  # the device's clock, µs
    late: bool = False  # repeated, or older than a frame before it
    more: dict[str, float | list[float]] = {}  # what else the frame carries


def flat(frame: InsoleFrame) -> dict[str, object]:
    """Return the values of `frame`: `pressures` (Pa) if it is calibrated, else `counts`; `time` in s."""
    line: dict[str, object] = {"frame": "insole"}
    numbers = {"foot": frame.foot, "sequence": frame.sequence, "bits": frame.bits}
    line |= {key: value for key, value in numbers.items() if value is not None}
    if frame.ticks is not None:
        line["time"] = frame.ticks / 1e6
    line["pressures" if frame.calibrated else "counts"] = frame.cells
    line |= {key: True for key in ("saturated", "missing", "late") if getattr(frame, key)}
    return line | frame.more
