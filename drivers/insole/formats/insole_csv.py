"""Format `insole-csv`: lines of text, as loggers and hobby boards send them, by a description."""

import fnmatch
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from drivers.insole import layout as layouts
from drivers.insole.description import SECONDS, Column, CsvDescription, Flag
from drivers.insole.foot import Foot
from drivers.insole.format import MICROSECONDS, Format, MakeParser
from drivers.insole.frame import InsoleFrame
from drivers.insole.frame_order import LARGEST, Order
from drivers.insole.layout import Layout
from drivers.parsing import DelimitedParser

# What a header's column means where the description does not say.
COMMON_TIMES = {
    **dict.fromkeys(("time", "time_s", "t_s", "timestamp_s"), "s"),
    **dict.fromkeys(("time_ms", "t_ms", "timestamp_ms", "millis", "ms"), "ms"),
    **dict.fromkeys(("time_us", "t_us", "timestamp_us", "micros", "us"), "us"),
}
COMMON_SEQUENCES = ("seq", "sequence")
COMMON_FEET = ("foot", "side")


@dataclass(frozen=True, slots=True)
class Columns:
    """Places of all values in a line."""

    width: int | None  # None: the line may have any
    cells: Mapping[Foot | None, tuple[int, ...]]
    foot: int | None
    time: int | None
    second: float  # of one unit of time
    sequence: int | None
    flags: tuple[tuple[int, Flag], ...]


class InsoleCsvParser(DelimitedParser[InsoleFrame]):
    """Parser of `insole-csv`, one or both feet in a line."""

    delimiter = b"\n"
    longest = 8192

    def __init__(self, description: CsvDescription) -> None:
        super().__init__()
        self._description = description
        self._order = Order(self.counters, description.sequence_modulus, description.sequence_of_each_foot)
        self._columns = find_columns(description, description.columns or ())

    def _restart(self) -> None:
        self._order.restart()

    def _decode(self, raw: bytes) -> list[InsoleFrame] | None:
        try:
            line = raw.decode("utf-8").strip("\r\ufeff")
        except UnicodeDecodeError:
            return None
        if not line.strip() or line.startswith(self._description.comment or "\n"):
            return []
        row = [field.strip().strip('"') for field in line.split(self._description.delimiter)]
        if self._description.columns is None and (header := find_columns(self._description, row)):
            self._columns = header
            return []
        columns = self._columns
        if columns is None or len(row) < (columns.width or 0):
            self.counters.malformed += columns is not None
            return None
        frames = self._frames(row, columns)
        self.counters.malformed += frames is None
        return frames

    def _frames(self, row: list[str], columns: Columns) -> list[InsoleFrame] | None:
        """Return the feet of one line; `None` where a field is not what it should be."""
        try:
            sequence = None if columns.sequence is None else _whole(int(row[columns.sequence]))
            time = None if columns.time is None else float(row[columns.time])
            ticks = None if time is None else _whole(round(time * columns.second * 1e6))
            means = {flag.means for place, flag in columns.flags if _is_set(flag, row[place])}
            cells = {foot: [_number(row[at]) for at in places] for foot, places in columns.cells.items()}
            foot = None if columns.foot is None else self._foot(row[columns.foot])
        except (ValueError, IndexError, OverflowError):
            return None
        if foot is not None:
            cells = {foot: cells[None]}
        self.counters.saturated += "saturated" in means
        late = self._order.is_late(next(iter(cells)) if len(cells) == 1 else None, sequence, ticks)
        scale = self._description.pascal_per_count
        frames = []
        for side, counts in cells.items():
            missing = "missing" in means or f"{side}_missing" in means
            frames.append(
                InsoleFrame(
                    cells=(None,) * len(counts)
                    if missing
                    else tuple(None if n is None else n * (scale or 1.0) for n in counts),
                    foot=side,
                    calibrated=scale is not None,
                    saturated="saturated" in means,
                    missing=missing or None in counts,
                    sequence=sequence,
                    ticks=ticks,
                    late=late,
                )
            )
        return frames

    def _foot(self, text: str) -> Foot:
        if text in self._description.foot_left:
            return "left"
        if text in self._description.foot_right:
            return "right"
        raise ValueError(text)


def find_columns(description: CsvDescription, header: tuple[str, ...] | list[str]) -> Columns | None:
    """Return the columns of lines under `header`; `None` if it does not name the cells."""
    places = {name: place for place, name in enumerate(header)}

    def find(column: Column | None, common: tuple[str, ...] = ()) -> int | None:
        if isinstance(column, int):
            return column
        names = (column,) if column is not None else tuple(name for name in places if name.lower() in common)
        return next((places[name] for name in names if name in places), None)

    cells: dict[Foot | None, tuple[int, ...]] = {}
    for foot, wanted in (("left", description.left), ("right", description.right)):
        if found := _cells(wanted, places):
            cells["left" if foot == "left" else "right"] = found
    if not cells:
        if not (found := _cells(description.cells, places)):
            return None
        cells[None] = found
    flags = tuple((find(flag.source), flag) for flag in description.flags)
    wanted_columns = (description.foot, description.time, description.sequence)
    if None in (place for place, _ in flags) or any(
        column is not None and find(column) is None for column in wanted_columns
    ):
        return None
    time = find(description.time, tuple(COMMON_TIMES))
    unit = description.time_unit
    if description.time is None and time is not None:
        unit = COMMON_TIMES[header[time].lower()]  # type: ignore[assignment]
    return Columns(
        width=len(header) or None,
        cells=cells,
        foot=find(description.foot, COMMON_FEET) if None in cells else None,
        time=time,
        second=SECONDS[unit],
        sequence=find(description.sequence, COMMON_SEQUENCES),
        flags=tuple((place, flag) for place, flag in flags if place is not None),
    )


def _cells(wanted: str | tuple[Column, ...], places: Mapping[str, int]) -> tuple[int, ...]:
    """Places of the cells; empty where one of them is not there."""
    if isinstance(wanted, str):
        names = [name for name in places if fnmatch.fnmatchcase(name, wanted) and re.search(r"\d", name)]
        fixed = len(wanted.partition("*")[0])
        return tuple(places[name] for name in sorted(names, key=lambda name: _numbers_in(name[fixed:])))
    found = [column if isinstance(column, int) else places.get(column) for column in wanted]
    return tuple(place for place in found if place is not None) if None not in found else ()


def _numbers_in(text: str) -> list[tuple[int, str]]:
    """Return the sort key of a name: ch2 comes before ch10, whatever the number of digits."""
    numbers = [digits.lstrip("0") for digits in re.findall(r"\d+", text)]
    return [(len(digits), digits) for digits in numbers]


def _whole(number: int) -> int:
    """Check a number; raises `ValueError` for one that no device can mean."""
    if abs(number) > LARGEST:
        raise ValueError(number)
    return number


def _number(text: str) -> float | None:
    """Return a cell's number; `None` for an empty field or "nan"."""
    if not text:
        return None
    number = float(text)
    if math.isinf(number):
        raise ValueError(text)
    return None if math.isnan(number) else number


def _is_set(flag: Flag, text: str) -> bool:
    return text == flag.equals if flag.mask is None else bool(int(text, 0) & flag.mask)


def _parser(layout: Layout | None) -> MakeParser:
    csv = (layout.csv if layout else None) or CsvDescription()
    return lambda: InsoleCsvParser(csv)


def _described() -> Iterator[str | None]:
    yield None
    yield from (name for name in layouts.shipped() if layouts.load(name).csv is not None)


FORMAT = Format(parser=_parser, clock=MICROSECONDS, described=True, identify=_described)
