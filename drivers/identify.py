"""Identification of a byte stream's format: every parser tries, and the best match wins."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from drivers.imu.formats import FORMATS as IMU_FORMATS
from drivers.insole import layout as layouts
from drivers.insole.foot import FEET, Foot
from drivers.insole.formats import FORMATS as INSOLE_FORMATS
from drivers.insole.frame import InsoleFrame
from drivers.parsing import Parser

FEWEST_FRAMES = 3
FEWEST_SHARE = 0.5  # of the bytes
NUMBER_OR_FOOT = rb"[ ]*(-?[0-9.eE+-]*|[LRlr]|left|right|Left|Right|LEFT|RIGHT)"
NUMBERS_LINE = re.compile(rb"[ \t]*[^,;\t\r\n]{0,24}([,;\t]" + NUMBER_OR_FOOT + rb"){2,}\r?")


@dataclass(frozen=True, slots=True)
class Match:
    """Match of a format with some bytes."""

    format_name: str
    layout: str | None  # the shipped layout whose description fits, for insole formats that need one
    frames: int
    share: float  # of the bytes, 0 to 1
    cells: int | None = None  # of an insole
    feet: tuple[Foot, ...] = ()  # whose cells an insole's frames name


def candidates() -> Iterator[tuple[str, str | None, Callable[[], Parser[Any]]]]:
    """Yield every format (and shipped description) that a serial stream can be in."""
    for name, imu in IMU_FORMATS.items():
        yield name, None, imu.parser
    for name, insole in sorted(INSOLE_FORMATS.items(), key=lambda item: item[1].described):
        for layout in insole.identify():
            yield name, layout, insole.parser(None if layout is None else layouts.load(layout))


def matches(data: bytes) -> list[Match]:
    """Return the formats that fit `data`, the best first.

    Of equal ones a device's own before a described one.
    """
    found = [match for candidate in candidates() if (match := _try(data, *candidate)) is not None]
    if not found and (lines := _number_lines(data)) is not None:
        found.append(lines)
    return sorted(found, key=lambda match: (match.share, match.frames), reverse=True)


def recognise(data: bytes) -> Match | None:
    """Return the format that fits `data` best, if any does."""
    return next(iter(matches(data)), None)


def format_of(data: bytes) -> str | None:
    """Return the name of that format."""
    match = recognise(data)
    return None if match is None else match.format_name


def _try(data: bytes, name: str, layout: str | None, make_parser: Callable[[], Parser[Any]]) -> Match | None:
    parser = make_parser()
    frames = parser.feed(data)
    # The first and the last frame are cut by where the reading began and ended.
    dropped, whole = parser.counters.bytes_dropped, len(data)
    longest = whole // max(1, len(frames))
    share = 1.0 - max(0, dropped - longest) / max(1, whole)
    if len(frames) < FEWEST_FRAMES or share < FEWEST_SHARE:
        return None
    if not isinstance(frames[-1], InsoleFrame):
        return Match(name, layout, len(frames), share)
    named = {frame.foot for frame in frames if frame.cells.count(None) < len(frame.cells)}
    feet = tuple(foot for foot in FEET if foot in named)
    return Match(name, layout, len(frames), share, len(frames[-1].cells), feet)


def _number_lines(data: bytes) -> Match | None:
    """Lines of numbers whose columns nobody has named yet."""
    lines = data.split(b"\n")[1:-1]
    fits = [line for line in lines if NUMBERS_LINE.fullmatch(line)]
    if len(fits) < FEWEST_FRAMES or len(fits) < 0.9 * len(lines):
        return None
    return Match("insole-csv", None, len(fits), len(fits) / len(lines))
