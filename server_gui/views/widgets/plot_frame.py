"""The frame of a small plot: its title, and its figures beside and below it, never over what is drawn."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter

from server_gui.views.theme import Theme

GAP: Final = 4
LEFT, MIDDLE, RIGHT = (
    Qt.AlignmentFlag.AlignLeft,
    Qt.AlignmentFlag.AlignHCenter,
    Qt.AlignmentFlag.AlignRight,
)


def draw_frame(
    painter: QPainter,
    theme: Theme,
    whole: QRectF,
    title: str,
    up: tuple[str, str],
    across: tuple[str, Sequence[str], str],
) -> QRectF:
    """Draw a title above, `up` (low and high) at the left, `across` (first, names, last) below.

    Of the names the first that has room is drawn. Returns what is left for the curves.
    """
    painter.setFont(theme.text_font(0.85))
    metrics = painter.fontMetrics()
    line, wide = metrics.height(), metrics.horizontalAdvance
    beside = max(map(wide, up)) + 2 * GAP
    area = whole.adjusted(beside, line + GAP, -GAP, -line - GAP)
    painter.setPen(theme.colour("text"))
    room = whole.width() - 2 * GAP
    shown = metrics.elidedText(title, Qt.TextElideMode.ElideMiddle, int(room))
    painter.drawText(QRectF(whole.left() + GAP, whole.top(), room, line), LEFT, shown)
    painter.setPen(theme.colour("dim"))
    low, high = up
    painter.drawText(QRectF(whole.left(), area.top(), beside - GAP, line), RIGHT, high)
    painter.drawText(QRectF(whole.left(), area.bottom() - line, beside - GAP, line), RIGHT, low)
    first, names, last = across
    below = QRectF(area.left(), area.bottom() + 2, area.width(), line)
    painter.drawText(below, LEFT, first)
    painter.drawText(below, RIGHT, last)
    left = area.width() - 2 * max(wide(first), wide(last)) - 4 * GAP
    painter.drawText(below, MIDDLE, next((name for name in names if wide(name) <= left), ""))
    painter.setPen(theme.colour("border"))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawRect(area)
    return area
