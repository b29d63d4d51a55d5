"""A parameter's limits as a bar: from where to where, how far one write goes, what is held and staged."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from gateway.units import Unit
from gateway.wire.method import Number
from gateway.wire.parameter import ParameterInfo
from server_gui.core.tuning.edits import brief
from server_gui.views.theme import Theme

HIGH = 5.0  # pixels of the bar
NO_UNIT: Final = Unit("", "")


class RangeBar(QWidget):
    """Empty where the robot names no limits. The filled stretch is what one write can reach."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._shown: tuple[float, float, tuple[float, float], float | None, float | None] | None = None
        self.figures = ("", "")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Allowed range")

    def sizeHint(self) -> QSize:
        return QSize(self._theme.px(80), self._theme.px(24))

    def minimumSizeHint(self) -> QSize:
        return QSize(0, self.sizeHint().height())

    def show_range(
        self,
        info: ParameterInfo | None,
        unit: Unit = NO_UNIT,
        held: Number | None = None,
        staged: float | None = None,
        reach: tuple[float, float] | None = None,
    ) -> None:
        """Show these, in `unit`; values are SI."""
        if info is None or info.min is None or info.max is None or reach is None:
            shown, figures = None, ("", "")
        else:
            shown = float(info.min), float(info.max), reach, None if held is None else float(held), staged
            figures = brief(unit, info.min), f"{brief(unit, info.max)} {unit.symbol}".rstrip()
        if (shown, figures) == (self._shown, self.figures):
            return
        self._shown, self.figures = shown, figures
        self.setAccessibleDescription(
            f"from {figures[0]} to {figures[1]}" if shown else "no limits are known"
        )
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._shown is None:
            return
        low, high, reach, held, staged = self._shown
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(self._theme.text_font(0.85))
        line = painter.fontMetrics().height()
        painter.setPen(self._theme.colour("dim"))
        room = QRectF(0, self.height() - line, self.width(), line)
        painter.drawText(room, Qt.AlignmentFlag.AlignLeft, self.figures[0])
        painter.drawText(room, Qt.AlignmentFlag.AlignRight, self.figures[1])

        def at(value: float) -> float:
            share = min(max((value - low) / (high - low), 0.0), 1.0)
            return 2.0 + share * (self.width() - 4.0)

        self._draw(painter, at, reach, held, staged)
        painter.end()

    def _draw(
        self,
        painter: QPainter,
        at: Callable[[float], float],
        reach: tuple[float, float],
        held: float | None,
        staged: float | None,
    ) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        top = 4.0
        painter.setBrush(self._theme.colour("edge"))
        painter.drawRoundedRect(QRectF(2.0, top, self.width() - 4.0, HIGH), 2.0, 2.0)
        painter.setBrush(self._theme.colour("accent"))
        painter.setOpacity(0.45)
        painter.drawRect(QRectF(at(reach[0]), top, max(at(reach[1]) - at(reach[0]), 1.0), HIGH))
        painter.setOpacity(1.0)
        for value, colour in ((held, "text"), (staged, "yellow")):
            if value is not None:
                painter.setBrush(self._theme.colour(colour))
                painter.drawRect(QRectF(at(value) - 1.5, top - 3.0, 3.0, HIGH + 6.0))
