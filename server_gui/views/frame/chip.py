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
    brief: tuple[str, ...] = ()  # main and parts, where it would have no room otherwise
    aside: str = ""  # below a brief main, where there is room for it


class Chip(QFrame):
    """A mark, what it means, and a line of detail; of what has no room whole parts are left out.

    One whose first line is a name needs no more than `most` (at text of 100 %), if given.
    """

    def __init__(self, theme: Theme, name: str, button: QPushButton | None = None, most: int = 0) -> None:
        super().__init__()
        self._theme = theme
        self._most = most
        self._words = Words(Mark("ring", "old"), "")
        self._is_brief, self._offers = False, True
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

    def needs(self, *, brief: bool = False) -> int:
        """Return how wide it is with all of its first line, and what is short of the second."""
        bold, plain = QFontMetrics(self._theme.text_font(bold=True)), QFontMetrics(self._theme.text_font())
        main, *parts = self._said(brief=brief)
        short = next((part for part in parts[:1] if len(part) <= SHORT), "")
        words = max(bold.horizontalAdvance(main), plain.horizontalAdvance(short)) + self._around(brief=brief)
        return max(min(words, self._theme.px(self._most) or words), self.least)

    @property
    def least(self) -> int:
        """How wide it is with what it must say."""
        plain, shorter = QFontMetrics(self._theme.text_font()), self._words.shorter
        word = plain.horizontalAdvance(shorter) + self._around() if shorter else 0
        return max(word, self._theme.px(LEAST))

    @property
    def wants(self) -> int:
        """How wide it is with everything that it has to say now."""
        bold, plain = QFontMetrics(self._theme.text_font(bold=True)), QFontMetrics(self._theme.text_font())
        main, *parts = self._said(brief=self._is_brief)
        texts = (" · ".join(parts), self._words.aside if self._is_brief else "")
        words = max(bold.horizontalAdvance(main), *map(plain.horizontalAdvance, texts))
        return max(self.needs(brief=self._is_brief), words + self._around(brief=self._is_brief))

    @property
    def whole(self) -> int:
        """How wide it is with its first line whole, however long that is."""
        bold = QFontMetrics(self._theme.text_font(bold=True))
        return max(self.needs(), bold.horizontalAdvance(self._words.main) + self._around())

    def more(self, room: int) -> int:
        """Return how much wider it is, by at most so much, with as many parts of its detail as that has."""
        plain, needs = QFontMetrics(self._theme.text_font()), self.needs()
        parts = self._words.parts
        texts = (" · ".join(parts[:count]) for count in range(len(parts), 0, -1))
        wider = (plain.horizontalAdvance(text) + self._around() - needs for text in texts)
        return max(next((wide for wide in wider if wide <= room), 0), 0)

    def say(self, words: Words) -> None:
        """Show this."""
        self._words = words
        self._icon.show_mark(words.mark)
        set_tip(self, words.tip or "\n".join(filter(None, (words.main, " · ".join(words.parts)))))
        self.setAccessibleDescription(f"{words.main}, {' · '.join(words.parts)}")
        self._fit()

    def be_brief(self, on: bool) -> None:
        """Show its brief words, without its button; or again all of them."""
        self._is_brief = on
        self._fit()

    def offer(self, on: bool) -> None:
        """Show its button, where there is room for it, or do not."""
        self._offers = on
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        is_brief = self._is_brief and bool(self._words.brief)
        if self._button is not None:
            self._button.setVisible(self._offers and not is_brief)
        room, plain = self.width() - self._around(brief=is_brief), QFontMetrics(self._theme.text_font())
        main, *parts = self._said(brief=is_brief)
        texts = [" · ".join(parts[:count]) for count in range(len(parts), 0, -1)]
        texts += filter(None, (self._words.shorter,))
        texts += [self._words.aside, ""] if is_brief and not texts else []
        fits = (text for text in texts if plain.horizontalAdvance(text) <= room)
        last = texts[-1] if texts and not any(sign.isdigit() for sign in texts[-1]) else ""  # a name at most
        set_text(self._main, main)
        set_text(self._detail, next(fits, last))

    def _said(self, *, brief: bool) -> tuple[str, ...]:
        words = self._words
        return words.brief if brief and words.brief else (words.main, *words.parts)

    def _around(self, *, brief: bool = False) -> int:
        """Return the width beside the words."""
        button = None if brief and self._words.brief else self._button
        beside = 0 if button is None or not self._offers else button.sizeHint().width() + 6
        return self._theme.px(12) + 34 + beside
