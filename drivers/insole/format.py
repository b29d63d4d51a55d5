"""The definition of an insole's format, as FORMAT in a file of `drivers/insole/formats`."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.clock import ClockSpec
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Layout
from drivers.parsing import Parser

MakeParser = Callable[[], Parser[InsoleFrame]]

MICROSECONDS = ClockSpec(1_000_000, 1 << 62)  # that wrap beyond any session


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
