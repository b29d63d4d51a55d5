"""Labels and tool tips that show a name as it is: Qt takes whatever looks like HTML for HTML, unless told."""

import html
from typing import Final, Protocol

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from gateway.plain_text import plain

KEPT: Final = "\n\u00a0"  # a line ends, and a number stays with its unit: neither commands anything


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
