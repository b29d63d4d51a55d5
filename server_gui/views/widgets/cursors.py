"""Overlay of a plot: limits, flags of events, hover line, cursors, a box."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from server_gui.core.desk.flags import FlagKind
from server_gui.views.marks import Mark, draw
from server_gui.views.theme import Theme

LETTERS: Final = ("A", "B")
NEAR_PX: Final = 6  # from a cursor or a flag, to mean it
FLAGS: Final = {
    FlagKind.STOP: Mark("triangle", "warn", "stop"),
    FlagKind.UNPROVEN: Mark("box", "bad", "stop not confirmed"),
    FlagKind.FAULT: Mark("square", "bad", "fault"),
    FlagKind.WRITE: Mark("disc", "accent", "write"),
    FlagKind.TRIAL: Mark("half", "accent", "trial"),
    FlagKind.DANGER: Mark("diamond", "warn", "danger"),
    FlagKind.RULE: Mark("half", "warn", "rule"),
    FlagKind.BUS: Mark("disc", "warn", "bus"),
    FlagKind.GAP: Mark("cross", "warn", "gap"),
    FlagKind.CHANGE: Mark("box", "dim", "change"),
    FlagKind.MARK: Mark("diamond", "text", "mark"),
    FlagKind.TRIGGER: Mark("ring", "accent", "trigger"),
}
FIRST: Final = (
    FlagKind.UNPROVEN,
    FlagKind.FAULT,
    FlagKind.STOP,
    FlagKind.DANGER,
    FlagKind.RULE,
    FlagKind.BUS,
    FlagKind.GAP,
    FlagKind.MARK,
    FlagKind.TRIAL,
    FlagKind.WRITE,
    FlagKind.TRIGGER,
    FlagKind.CHANGE,
)


@dataclass(frozen=True, slots=True)
class CursorLayout:
    """Positions in the overlay, as shares of the width from the left, and of the height from the top."""

    at: tuple[float, ...] = ()  # the cursors
    active: int = 0
    hover: float | None = None
    flags: tuple[tuple[float, FlagKind], ...] = ()
    limits: tuple[float, ...] = ()
    box: QRectF | None = None  # in pixels
    words: str = ""  # instead of curves

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw."""
        several = self.at or self.flags or self.limits or self.words
        return not several and self.box is None and self.hover is None


def told(flags: Iterable[tuple[float, FlagKind]], apart: float) -> list[tuple[float, FlagKind]]:
    """Return the flags with room for their mark, `apart` from each other: a fault before its stop."""
    found: list[tuple[float, FlagKind]] = []
    for share, kind in sorted(flags, key=lambda flag: FIRST.index(flag[1])):
        if all(abs(share - other) >= apart for other, _ in found):
            found.append((share, kind))
    return found


class LimitArrows(QWidget):
    """Beside the field, off its curves: an arrow at the edge behind which a limit is."""

    def __init__(self, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self._theme = theme
        self._beyond: tuple[float, ...] = ()
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()

    def show_limits(self, beyond: tuple[float, ...]) -> None:
        """Show these from now on: 0 above, 1 below."""
        if beyond != self._beyond:
            self._beyond = beyond
            self.setVisible(bool(beyond))
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._theme.colour("dim"))  # no curve is near it
        wide = float(self.width())
        for share in self._beyond:
            tip = share * self.height()
            foot = tip + wide if share < 0.5 else tip - wide
            painter.drawPolygon(QPolygonF([QPointF(wide / 2, tip), QPointF(wide, foot), QPointF(0.0, foot)]))
        painter.end()


class Cursors(QWidget):
    """Over the field of a plot; the mouse goes through."""

    def __init__(self, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self._theme = theme
        self._shown = CursorLayout()
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()

    def show_marks(self, shown: CursorLayout) -> None:
        """Show these from now on."""
        if shown != self._shown:
            self._shown = shown
            self.setVisible(not shown.is_empty)
            self.update()

    def near(self, x: float) -> int | None:
        """Return the cursor that is at this place of ours, in pixels."""
        return self._nearest(x, self._shown.at)

    def flag_near(self, x: float) -> int | None:
        """Return the flag that is at this place of ours, in pixels."""
        return self._nearest(x, tuple(share for share, _ in self._shown.flags))

    def _nearest(self, x: float, shares: tuple[float, ...]) -> int | None:
        found = [(abs(share * self.width() - x), place) for place, share in enumerate(shares)]
        distance, place = min(found, default=(NEAR_PX + 1, 0))
        return place if distance <= NEAR_PX else None

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        self._draw_limits(painter)
        self._draw_flags(painter)
        if self._shown.hover is not None:
            painter.setPen(QPen(self._theme.colour("text"), 1, Qt.PenStyle.DotLine))
            x = round(self._shown.hover * self.width())
            painter.drawLine(x, 0, x, self.height())
        self._draw_cursors(painter)
        if self._shown.box is not None:
            painter.setPen(QPen(self._theme.colour("accent"), 1, Qt.PenStyle.DashLine))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRect(self._shown.box)
        if self._shown.words:
            painter.setFont(self._theme.text_font())
            painter.setPen(self._theme.colour("dim"))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, self._shown.words)
        painter.end()

    def _draw_limits(self, painter: QPainter) -> None:
        painter.setPen(QPen(self._theme.colour("bad"), 1, Qt.PenStyle.DashLine))
        for share in self._shown.limits:
            y = round(share * (self.height() - 1))
            painter.drawLine(0, y, self.width(), y)

    def _draw_flags(self, painter: QPainter) -> None:
        side = float(self._theme.px(9))
        for share, kind in self._shown.flags:
            mark, x = FLAGS[kind], share * self.width()
            colour = self._theme.colour(mark.colour)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
            painter.setPen(QPen(colour, 1))
            painter.drawLine(QPointF(x, side), QPointF(x, self.height()))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for share, kind in told(self._shown.flags, side / max(self.width(), 1)):
            left = min(max(share * self.width() - side / 2, 0.0), self.width() - side)
            draw(painter, FLAGS[kind], self._theme.colour(FLAGS[kind].colour), QRectF(left, 0, side, side))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)

    def _draw_cursors(self, painter: QPainter) -> None:
        painter.setFont(self._theme.text_font(bold=True))
        for place, share in enumerate(self._shown.at):
            active = place == self._shown.active
            colour = self._theme.colour("accent" if active else "text")
            style = Qt.PenStyle.SolidLine if active else Qt.PenStyle.DashLine
            painter.setPen(QPen(colour, 1, style))
            x = round(share * self.width())
            painter.drawLine(x, 0, x, self.height())
            inside = 3 if x < self.width() / 2 else -painter.fontMetrics().horizontalAdvance("A") - 3
            painter.drawText(QPointF(x + inside, painter.fontMetrics().ascent()), LETTERS[place])
