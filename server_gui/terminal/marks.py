"""Small drawings of text: bars, sparklines, states as shape, colour and word."""

import math
from collections.abc import Iterable

from rich.text import Text

from gateway.plain_text import plain
from server_gui.core.alarms.marks import GLYPHS, Mark, state_mark

LEFT = "#56b4e9"  # Okabe–Ito sky blue
RIGHT = "#e69f00"  # Okabe–Ito orange
GOOD = "#009e73"
WARN = "#f0e442"
BAD = "#d55e00"
OLD = "grey50"
DIM = "grey62"
NONE = "–"

BLOCKS = "▁▂▃▄▅▆▇█"


COLOURS = {"good": GOOD, "warn": WARN, "bad": BAD, "old": OLD, "dim": DIM, "accent": LEFT}


def side_colour(component: str) -> str:
    """Left is blue, right is orange, what has no side is plain."""
    side = component.partition("_")[0]
    return {"left": LEFT, "right": RIGHT}.get(side, "default")


def words(text: str, style: str = "") -> Text:
    """Text that is nothing else: no markup of rich, and nothing that commands the terminal."""
    return Text(plain(text), style=style)


def state_text(word: str, more: str = "") -> Text:
    """Return a state as shape, colour and word, and what else there is to say of it."""
    return mark_text(state_mark(word.replace("_", " ").lower()), more)


def mark_text(mark: Mark, more: str = "") -> Text:
    """Return a mark as shape, colour and word."""
    return words(f"{GLYPHS[mark.shape]} {mark.word} {more}".rstrip(), COLOURS[mark.colour])


def sparkline(values: Iterable[float | None], low: float, high: float, width: int) -> str:
    """Return the newest `width` values as blocks between `low` and `high`; a blank where there is none."""
    newest = list(values)[-width:]
    blocks = (" " if value is None else BLOCKS[_eighth(_share(value, low, high))] for value in newest)
    return "".join(blocks).rjust(width)


def bar(share: float | None, width: int) -> str:
    """Return a bar of `width` cells filled to `share` (0–1)."""
    filled = 0 if share is None else round(min(max(share, 0.0), 1.0) * width)
    return "━" * filled + "╌" * (width - filled)


def needle(value: float | None, low: float, high: float, width: int) -> str:
    """Return where a value lies between `low` and `high`; zero is marked when it lies between."""
    cells = ["─"] * width
    if low < 0.0 < high:
        cells[_cell(0.0, low, high, width)] = "┼"
    if value is not None:
        cells[_cell(value, low, high, width)] = "◆"
    return "".join(cells)


def scale(low_rad: float, high_rad: float, width: int) -> str:
    """Return the ends and the zero of a needle's range, in degrees, above where they lie."""
    ends = f"{math.degrees(low_rad):.0f}°", f"{math.degrees(high_rad):.0f}°"
    zero = _cell(0.0, low_rad, high_rad, width)
    return (ends[0].ljust(zero) + "0°").ljust(width - len(ends[1])) + ends[1]


def degrees(value_rad: float | None) -> str:
    """Return an angle for people."""
    return NONE if value_rad is None else f"{math.degrees(value_rad):+.1f}°"


def _eighth(share: float) -> int:
    return min(max(int(share * len(BLOCKS)), 0), len(BLOCKS) - 1)


def _cell(value: float, low: float, high: float, width: int) -> int:
    return round(_share(value, low, high) * (width - 1))


def _share(value: float, low: float, high: float) -> float:
    """Return the position between the ends, 0 to 1, for any numbers of a robot."""
    if value <= low:
        return 0.0
    return 1.0 if value >= high else (value / 2 - low / 2) / (high / 2 - low / 2)
