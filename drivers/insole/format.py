"""What a file in `drivers/insole/formats` defines as FORMAT: an insole's language."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from drivers.clock import ClockSpec
from drivers.insole import layout as layouts
from drivers.insole.formats import FORMATS
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Layout
from drivers.parsing import Parser

MakeParser = Callable[[], Parser[InsoleFrame]]

MICROSECONDS = ClockSpec(1_000_000, 1 << 62)  # that wrap beyond any session
USUAL_LAYOUT = "insole-16"


def undescribed() -> Iterable[str | None]:
    return (None,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """One language; `parser` says how to make a parser of a stream that a layout describes, or none.

    It raises `SettingsError` where it needs a description and the layout has none.
    """

    parser: Callable[[Layout | None], MakeParser]
    clock: ClockSpec  # of the frames' ticks
    layout: Layout | None = None  # of a device whose cells always are in the same places
    described: bool = False  # in a layout file; a language of one device is more likely than one that fits
    identify: Callable[[], Iterable[str | None]] = undescribed  # shipped layouts to try by; None: without one


def layout_of(format_name: str, layout_name: str | None, beside: Path | None = None) -> Layout:
    """The layout of that name; without one, the device's own, or the usual one.

    Raises:
        SettingsError: there is none, or it is wrong; the message names file and key.

    """
    own = FORMATS[format_name].layout
    if own is not None and layout_name is None:
        return own
    return layouts.load(layout_name or USUAL_LAYOUT, beside)
