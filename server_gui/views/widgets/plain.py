"""Labels and tool tips that show a name as it is: Qt takes whatever looks like HTML for HTML, unless told."""

import html
import re
from typing import Final, Protocol

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from gateway.plain_text import plain

NO_BREAK: Final = "\u00a0"
KEPT: Final = f"\n{NO_BREAK}"  # a line ends, and a number stays with its unit: neither commands anything
_BEFORE_UNIT: Final = re.compile(
    r"(?<=\d) (?=(?:%|°C?|µs|ms|s|min|h|Hz|kHz|mm|m|N|N·m|A|V|kPa|frames/s|rows/s|KiB|MiB|GiB)(?![\w·/]))"
)


class PlainLabel(QLabel):
    """A label of plain text, of several lines at most."""

    def __init__(self, text: str = "") -> None:
        super().__init__()
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setText(text)

    def setText(self, text: str) -> None:
        super().setText(plain(text, KEPT))


class Tipped(Protocol):
    """Objects with a tool tip: a widget, an action, an item."""

    def toolTip(self) -> str:
        """Return what is shown where the pointer rests."""
        ...

    def setToolTip(self, text: str) -> None:
        """Show this where the pointer rests."""
        ...


def unbroken(text: str) -> str:
    """Text in which no line ends between a number and its unit."""
    return _BEFORE_UNIT.sub(NO_BREAK, text)


def rich(text: str) -> str:
    """Text for a label that must be rich."""
    return html.escape(plain(text))


def tip(text: str) -> str:
    """Text for a tool tip, which is shown as it is also where it looks like HTML."""
    shown = plain(text, KEPT)
    if "<" not in shown:  # then Qt does not take it for HTML
        return shown
    return f'<p style="white-space:pre-wrap">{html.escape(shown)}</p>'


def set_tip(shown: Tipped, text: str) -> None:
    """Give a widget, an action or an item a tool tip of plain text, where it has another."""
    if shown.toolTip() != tip(text):
        shown.setToolTip(tip(text))
