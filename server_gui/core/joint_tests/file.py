"""A test's file: its conditions, its samples, how it ended (`gateway/joint_test/recording.py` writes it)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

FORMAT: Final = 1
NEEDED: Final = ("sync_ns", "target", "position", "velocity", "torque", "current")
ALWAYS: Final = ("sync_ns", "target", "position")  # in every sample
LARGEST: Final = 200_000_000  # bytes; an hour of samples is a tenth of that

_ROW: Final = msgspec.json.Decoder(list[float | None])
Samples = NDArray[np.float64]  # (n,)


class NotReadable(Exception):
    """A file that is no test's; what is wrong with it."""


class Head(msgspec.Struct, frozen=True):
    """Its conditions; angles are rad."""

    format: int
    robot: str
    joint: str
    test: str
    began: str
    who: str
    wish: dict[str, float | str]
    limits: dict[str, float | None]
    period_s: float
    angle: float
    drive: dict[str, float | int | str]
    guard: list[str]
    parameters: dict[str, int | str]
    columns: list[str]
    units: list[str]


class Ended(msgspec.Struct, frozen=True):
    """End of a test; `off` is whether the drive has confirmed that it is disabled."""

    problem: str | None
    off: bool
    state: str
    late_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Test:
    """One recording; `ended` is `None` where it was cut off. Samples that were not brought are NaN."""

    __test__ = False  # for pytest
    path: Path
    head: Head
    columns: Mapping[str, Samples]
    ended: Ended | None

    @property
    def times(self) -> Samples:
        """Seconds since the first SYNC."""
        sync = self.columns["sync_ns"]
        seconds: Samples = (sync - sync[0]) / 1e9
        return seconds

    def __getitem__(self, name: str) -> Samples:
        return self.columns[name]

    @property
    def problem(self) -> str | None:
        """Why it is not whole, in words."""
        if self.ended is None:
            return "it was cut off: the program ended before the test did"
        return self.ended.problem


def read(path: Path) -> Test:
    """Read a test; a line that was cut off at its end is left out. Raises `NotReadable`, `OSError`."""
    if path.stat().st_size > LARGEST:
        raise NotReadable(f"{path} is larger than any test")
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    try:
        head = msgspec.json.decode(lines[0], type=Head)
    except (msgspec.DecodeError, RecursionError) as error:
        raise NotReadable(f"{path} is no recording of a joint's test: {error}") from error
    if head.format != FORMAT:
        raise NotReadable(f"{path} has format {head.format}, this program reads {FORMAT}: use a newer one")
    if missing := [name for name in NEEDED if name not in head.columns]:
        raise NotReadable(f"{path} has no {', '.join(missing)}")
    rows: list[list[float]] = []
    ended = None
    for number, line in enumerate(lines[1:], start=2):
        row = _row(line, len(head.columns))
        if row is not None and ended is None:
            rows.append(row)
        elif ended is None and (ended := _ended(line)) is not None:
            continue
        elif line and number < len(lines) - 1:
            raise NotReadable(f"{path} is damaged: line {number} is no sample, and not its end")
    table = np.array(rows, dtype=np.float64).reshape(-1, len(head.columns))
    test = Test(path, head, {name: table[:, at] for at, name in enumerate(head.columns)}, ended)
    if missing := [name for name in ALWAYS if np.isnan(test[name]).any()]:
        raise NotReadable(f"{path} is damaged: samples without {', '.join(missing)}")
    if np.any(np.diff(test["sync_ns"]) <= 0.0):
        raise NotReadable(f"{path} is damaged: its samples are not in the order of time")
    return test


def _row(line: str, width: int) -> list[float] | None:
    try:
        found = _ROW.decode(line)
    except (msgspec.DecodeError, RecursionError):
        return None
    if len(found) != width or any(one is not None and not math.isfinite(one) for one in found):
        return None
    return [math.nan if one is None else one for one in found]


def _ended(line: str) -> Ended | None:
    class Line(msgspec.Struct):
        ended: Ended

    try:
        return msgspec.json.decode(line, type=Line).ended
    except (msgspec.DecodeError, RecursionError):
        return None
