"""A rich line that has as many lines as it needs: legends, where every part with its number stays whole."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QSizePolicy

from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import rich


class Wrapped(QLabel):
    """`say` brings the parts: a colour (#rrggbb) each, what is drawn of it, and what it says."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setTextFormat(Qt.TextFormat.RichText)
        self.setWordWrap(True)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Minimum)

    def say(self, parts: Sequence[tuple[str, str, str]]) -> None:
        """Say these."""
        said = (
            f'<span style="color:{colour}">{_unbroken(f"{glyph} {text}")}</span>'
            for colour, glyph, text in parts
        )
        set_text(self, "&nbsp; ".join(said))
        self.setAccessibleDescription(", ".join(text for _, _, text in parts))

    def is_one_line(self, parts: Sequence[tuple[str, str, str]]) -> bool:
        """Return whether all of these have room in one line."""
        text = "\N{NO-BREAK SPACE} ".join(f"{glyph} {words}" for _, glyph, words in parts)
        return self.fontMetrics().horizontalAdvance(text) <= self.width()


def _unbroken(text: str) -> str:
    return rich(text.strip()).replace(" ", "&nbsp;")
