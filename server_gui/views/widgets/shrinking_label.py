"""A label that shortens its text where there is less room: words are cut, numbers never."""

from typing import Final

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy

from server_gui.views.widgets.plain import PlainLabel

MIDDLE: Final = Qt.TextElideMode.ElideMiddle


class ShrinkingLabel(PlainLabel):
    """One line of plain text; `say` brings its wordings, the fullest first."""

    def __init__(self, name: str = "", text: str = "") -> None:
        super().__init__()
        self.setObjectName(name)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)
        self._wordings: tuple[str, ...] = ("",)
        self._widest: tuple[str, ...] = ()
        self.alike: tuple[ShrinkingLabel, ...] = (self,)
        self.say(text)

    def say(self, *wordings: str, widest: tuple[str, ...] = ()) -> None:
        """Say the first of these that has room, else the last.

        `widest` are the same with the widest number: where it has no room, a smaller one is not said fuller.
        """
        if (wordings, widest) != (self._wordings, self._widest):
            self._wordings, self._widest = wordings, widest
            self.setText(wordings[0])
            self.setAccessibleName(wordings[0])
            self.updateGeometry()
            for one in self.alike:
                one.update()

    def speak_alike(self, *others: "ShrinkingLabel") -> None:
        """Keep the wordings of all labels equally full: beside each other they are read as one."""
        for one in (self, *others):
            one.alike = (self, *others)

    @property
    def shown(self) -> str:
        """The wording that is drawn."""
        wanted = max(one.fullest for one in self.alike)
        return self._wordings[min(wanted, len(self._wordings) - 1)]

    @property
    def fullest(self) -> int:
        """Index of the fullest wording with enough room, the last if none has."""
        room, last = self.contentsRect().width(), len(self._wordings) - 1
        same = zip(self._wordings, self._widest or self._wordings, strict=True)
        wide = [max(map(self._width, texts)) for texts in same]
        fits = (number for number, width in enumerate(wide) if width <= room)
        return next(fits, last)

    @property
    def is_whole(self) -> bool:
        """Whether what is drawn has room."""
        return self._width(self.shown) <= self.contentsRect().width()

    def sizeHint(self) -> QSize:
        return self._size(self._width(self._wordings[0]))

    def minimumSizeHint(self) -> QSize:
        return self._size(min(self._width(text) for text in self._wordings))

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, text = QPainter(self), self.shown
        if not self.is_whole:
            elided = self.fontMetrics().elidedText(text, MIDDLE, self.contentsRect().width())
            text = "…" if any(sign.isdigit() for sign in text) else elided
        painter.drawText(self.contentsRect(), self.alignment(), text)
        painter.end()

    def _width(self, text: str) -> int:
        return self.fontMetrics().horizontalAdvance(text)

    def _size(self, width: int) -> QSize:
        margins = self.contentsMargins()
        sides = margins.left() + margins.right()
        return QSize(width + sides, self.fontMetrics().height() + margins.top() + margins.bottom())
