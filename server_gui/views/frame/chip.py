"""One of the header's chips: a mark, what it means, and what more there is to know; no number is cut."""

from dataclasses import dataclass
from typing import Final

from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QVBoxLayout

from server_gui.views.marks import Mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip

SHORT: Final = 22  # letters: so few are not cut either
LEAST: Final = 84  # wide, at text of 100 %: a chip with less says nothing


@dataclass(frozen=True, slots=True)
class Words:
    """Texts of a chip: as many parts of its detail as there is room for; its tip has all."""

    mark: Mark
    main: str
    parts: tuple[str, ...] = ()
    tip: str = ""
    shorter: str = ""  # the first part, where it has no room: never less


class Chip(QFrame):
    """A mark, what it means, and a line of detail; of what has no room whole parts are left out.

    One whose first line is a name needs no more than `most` (at text of 100 %), if given.
    """

    def __init__(self, theme: Theme, name: str, button: QPushButton | None = None, most: int = 0) -> None:
        super().__init__()
        self._theme = theme
        self._most = most
        self._words = Words(Mark("ring", "old"), "")
        self.setObjectName("card")
        self.setAccessibleName(name)
        self._icon = MarkIcon(theme, 12)
        self._main, self._detail = ElidedLabel("title"), ElidedLabel("dim")
        words = QVBoxLayout()
        words.setSpacing(0)
        words.addWidget(self._main)
        words.addWidget(self._detail)
        row = QHBoxLayout(self)
        row.setContentsMargins(9, 3, 11, 3)
        row.addWidget(self._icon)
        row.addLayout(words, 1)
        self._button = button
        if button is not None:
            row.addWidget(button)

    @property
    def main_text(self) -> str:
        return self._main.text()

    @property
    def detail_text(self) -> str:
        return self._detail.text()

    @property
    def needs(self) -> int:
        """How wide it is with all of its first line, and what is short of the second."""
        bold, plain = QFontMetrics(self._theme.text_font(bold=True)), QFontMetrics(self._theme.text_font())
        short = next((part for part in self._words.parts[:1] if len(part) <= SHORT), "")
        words = max(bold.horizontalAdvance(self._words.main), plain.horizontalAdvance(short)) + self._around
        return max(min(words, self._theme.px(self._most) or words), self.least)

    @property
    def least(self) -> int:
        """How wide it is with what it must say."""
        plain = QFontMetrics(self._theme.text_font())
        word = plain.horizontalAdvance(self._words.shorter) + self._around if self._words.shorter else 0
        return max(word, self._theme.px(LEAST))

    @property
    def wants(self) -> int:
        """How wide it is with everything."""
        plain = QFontMetrics(self._theme.text_font())
        main = QFontMetrics(self._theme.text_font(bold=True)).horizontalAdvance(self._words.main)
        detail = plain.horizontalAdvance(" · ".join(self._words.parts))
        return max(self.needs, max(main, detail) + self._around)

    def say(self, words: Words) -> None:
        """Show this."""
        self._words = words
        self._icon.show_mark(words.mark)
        set_text(self._main, words.main)
        set_tip(self, words.tip or "\n".join(filter(None, (words.main, " · ".join(words.parts)))))
        self.setAccessibleDescription(f"{words.main}, {' · '.join(words.parts)}")
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        room = self.width() - self._around
        plain, parts = QFontMetrics(self._theme.text_font()), self._words.parts
        texts = [" · ".join(parts[:count]) for count in range(len(parts), 0, -1)]
        texts += filter(None, (self._words.shorter,))
        fits = (text for text in texts if plain.horizontalAdvance(text) <= room)
        last = texts[-1] if texts and not any(sign.isdigit() for sign in texts[-1]) else ""  # a name at most
        set_text(self._detail, next(fits, last))

    @property
    def _around(self) -> int:
        """Width beside the words."""
        button = self._button
        beside = 0 if button is None or button.isHidden() else button.sizeHint().width() + 6
        return self._theme.px(12) + 34 + beside
