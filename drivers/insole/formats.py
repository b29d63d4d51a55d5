"""The insole formats by name, as the robot's file and `gwrms sensor` know them."""

from collections.abc import Callable

from drivers.clock import ClockSpec
from drivers.errors import SettingsError
from drivers.insole.cobs import InsoleCobsParser
from drivers.insole.csv_lines import InsoleCsvParser
from drivers.insole.description import CsvDescription
from drivers.insole.fixed_frame import InsoleFrameParser
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Layout
from drivers.parsing import Parser

MakeParser = Callable[[], Parser[InsoleFrame]]

# Every format gives its time in µs; a wrap is the default format's, or beyond any session.
CLOCKS = {
    "insole-cobs": ClockSpec(1_000_000, 1 << 32),
    "insole-csv": ClockSpec(1_000_000, 1 << 62),
    "insole-frame": ClockSpec(1_000_000, 1 << 62),
}
FORMATS = tuple(CLOCKS)


def parser_maker(format_name: str, layout: Layout | None) -> MakeParser:
    """How to make a parser of `format_name` for a stream that `layout` describes.

    Raises:
        SettingsError: the format needs a description and the layout has none.

    """
    if format_name == "insole-cobs":
        return InsoleCobsParser
    if format_name == "insole-csv":
        csv = (layout.csv if layout else None) or CsvDescription()
        return lambda: InsoleCsvParser(csv)
    frame = layout.frame if layout else None
    if frame is None:
        raise SettingsError(f"{format_name} needs a layout file whose table [frame] describes its frame")
    return lambda: InsoleFrameParser(frame)
