"""Names, with … in their middle where there is no room, and sentences, with … behind a whole word.

Numbers alone are for `ShrinkingLabel`.
"""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QStyle, QStyledItemDelegate, QStyleOptionViewItem

from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.rows import Index

LONG: Final = 16  # letters of a word that is an address or a path


class ElidedLabel(PlainLabel):
    """One line of plain text; `mode` says where its … is."""

    def __init__(self, name: str = "", mode: Qt.TextElideMode = Qt.TextElideMode.ElideMiddle) -> None:
        super().__init__()
        self._mode = mode
        self.setObjectName(name)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        room = self.contentsRect()
        text = self.fontMetrics().elidedText(self.text(), self._mode, room.width())
        painter.drawText(room, self.alignment(), text)
        painter.end()


class PathLabel(ElidedLabel):
    """Label of a folder: purpose and path, shortened to any width; its tip has all of it."""

    def say(self, what: str, path: str) -> None:
        """Show this."""
        text = f"{what} {path}"
        if text != self.text():
            self.setText(text)
            self.setAccessibleName(text)
            set_tip(self, text)


class SentenceDelegate(QStyledItemDelegate):
    """Draws the sentences in a column as far as there is room for whole words: half a number is another."""

    def __init__(self, column: int) -> None:
        super().__init__()
        self._column = column

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:
        super().initStyleOption(option, index)
        if index.column() != self._column or option.widget is None:
            return
        margin = option.widget.style().pixelMetric(QStyle.PixelMetric.PM_FocusFrameHMargin) + 1
        room = option.rect.width() - 2 * margin
        option.text = whole_words(option.text, option.fontMetrics, room)


class WrappingDelegate(QStyledItemDelegate):
    """Draws what is in a column in lines; its view gives the row the height for them."""

    def __init__(self, column: int) -> None:
        super().__init__()
        self._column = column
        self._paints = False  # else Qt asks how wide it is in one line

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:
        super().initStyleOption(option, index)
        if self._paints and index.column() == self._column:
            option.features |= QStyleOptionViewItem.ViewItemFeature.WrapText

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        self._paints = True
        try:
            super().paint(painter, option, index)
        finally:
            self._paints = False


def whole_words(text: str, metrics: QFontMetrics, room: int) -> str:
    """Return all of it, or as many of its words as have room (pixels) with … behind, the first at least.

    An address or a path, which no word follows within the room, is cut itself.
    """
    if metrics.horizontalAdvance(text) <= room:
        return text
    words = text.split(" ")
    kept = len(words)
    while kept > 1 and metrics.horizontalAdvance(f"{' '.join(words[:kept])} …") > room:
        kept -= 1
    whole = f"{' '.join(words[:kept])} …"
    cut = words[0] if metrics.horizontalAdvance(whole) > room else "".join(words[kept : kept + 1])
    if len(cut) < LONG:
        return whole
    shown = metrics.elidedText(text, Qt.TextElideMode.ElideRight, room)
    return shown if len(shown) > len(whole) or metrics.horizontalAdvance(whole) > room else whole
