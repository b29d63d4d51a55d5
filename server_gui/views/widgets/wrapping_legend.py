"""A rich line that has as many lines as it needs: legends, where every part with its number stays whole."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QSizePolicy

from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import rich
from server_gui.views.widgets.wrapping_label import WrappingHeight

HYPHEN: Final = "\N{NON-BREAKING HYPHEN}"
MIDDLE: Final = Qt.TextElideMode.ElideMiddle


class WrappingLegend(WrappingHeight):
    """`say` brings the parts: a colour (#rrggbb) each, what is drawn of it, and what it says.

    A part that is wider than this is broken between its words, so that the number at its end is in sight;
    one that is `named` has it behind a name, which is elided in its middle.
    """

    def __init__(self, name: str, *, named: bool = False) -> None:
        super().__init__()
        self._named = named
        self._parts: tuple[tuple[str, str, str], ...] = ()
        self.setAccessibleName(name)
        self.setTextFormat(Qt.TextFormat.RichText)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Minimum)
        self.wrap()

    def say(self, parts: Sequence[tuple[str, str, str]]) -> None:
        """Say these."""
        self._parts = tuple(parts)
        self._show()
        self.setAccessibleDescription(", ".join(text for _, _, text in parts))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._show()

    def _show(self) -> None:
        said = (
            f'<span style="color:{colour}">{self._unbroken(glyph, text)}</span>'
            for colour, glyph, text in self._parts
        )
        set_text(self, "&nbsp; ".join(said))

    def is_one_line(self, parts: Sequence[tuple[str, str, str]]) -> bool:
        """Return whether all of these have room in one line."""
        return self._width(parts) <= self.width()

    @property
    def whole_width(self) -> int:
        """How wide one line with all that is said is."""
        return self._width(self._parts)

    def _width(self, parts: Sequence[tuple[str, str, str]]) -> int:
        text = "\N{NO-BREAK SPACE} ".join(f"{glyph} {words}" for _, glyph, words in parts)
        return self.fontMetrics().horizontalAdvance(text)

    def _unbroken(self, glyph: str, text: str) -> str:
        metrics, room = self.fontMetrics(), self.contentsRect().width()
        whole = f"{glyph} {text}".strip()
        if metrics.horizontalAdvance(whole) <= room:
            return rich(whole).replace(" ", "&nbsp;")
        room -= metrics.horizontalAdvance(f"{glyph} ")
        name, _, number = text.rpartition(" ")
        if self._named and name:
            room = max(room - metrics.horizontalAdvance(f" {number}") - metrics.averageCharWidth(), 0)
            short = f"{glyph} {metrics.elidedText(name, MIDDLE, room)} {number}"
            return rich(short.replace("-", HYPHEN)).replace(" ", "&nbsp;")  # no line ends within it
        words = (metrics.elidedText(word, MIDDLE, room) for word in text.split())
        before = f"{rich(glyph)}&nbsp;" if glyph else ""
        return f"{before}{rich(' '.join(words))}"
