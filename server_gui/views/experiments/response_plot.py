"""The response of a sweep: a metric's mean at each value, with its interval; what is proposed in green."""

from typing import Final

from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.core.evidence.experiment import Experiment, Point, Response
from server_gui.core.evidence.wording import number
from server_gui.views.theme import Theme
from server_gui.views.widgets.plot_frame import draw_frame

MARGIN: Final = 8
DOT: Final = 3.0


class ResponsePlot(QWidget):
    """Plot of the judged metric; empty without one."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._told: Experiment | None = None
        self._response: Response | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        theme.changed.connect(self.update)

    def sizeHint(self) -> QSize:
        return QSize(self._theme.px(360), self._theme.px(200))

    def minimumSizeHint(self) -> QSize:
        return QSize(self._theme.px(200), self._theme.px(120))

    def show_response(self, told: Experiment) -> bool:
        """Draw this; False where there is nothing to be drawn."""
        self._told = told
        self._response = next((one for one in told.responses if one.series == told.judged_by), None)
        if self._response is None:
            return False
        points = ", ".join(f"{number(one.value)}: {number(one.mean)}" for one in self._response.points)
        self.setAccessibleName(self._response.title.replace("_", " "))
        self.setAccessibleDescription(f"{points} {self._response.unit}".rstrip())
        self.update()
        return True

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._told is not None and self._response is not None:
            self._draw(painter, self._told, self._response)
        painter.end()

    def _draw(self, painter: QPainter, told: Experiment, response: Response) -> None:
        low = min(point.low for point in response.points)
        high = max(point.high for point in response.points)
        first, last = response.points[0].value, response.points[-1].value
        unit = f" ({response.unit})" if response.unit else ""
        name = f"{told.parameter.replace('_', ' ').replace('.', ' ')} ({told.unit})".replace(" ()", "")
        names = (name, name.rpartition(" (")[0], told.unit)
        across = (number(first), names, number(last))
        title = f"{response.title.replace('_', ' ')}{unit}"
        up = (number(low), number(high))
        area = draw_frame(painter, self._theme, QRectF(self.rect()), title, up, across)
        inner = area.adjusted(MARGIN, MARGIN, -MARGIN, -MARGIN)

        def at(value: float, mean: float) -> QPointF:
            across = (value - first) / ((last - first) or 1.0)
            up = (mean - low) / ((high - low) or 1.0)
            return QPointF(inner.left() + across * inner.width(), inner.bottom() - up * inner.height())

        painter.setPen(QPen(self._theme.colour("accent"), 1.5))
        painter.drawPolyline(QPolygonF([at(point.value, point.mean) for point in response.points]))
        for point in response.points:
            self._point(painter, told, point, at(point.value, point.low), at(point.value, point.high))
            painter.drawEllipse(at(point.value, point.mean), DOT, DOT)

    def _point(self, painter: QPainter, told: Experiment, point: Point, low: QPointF, high: QPointF) -> None:
        name = (
            "good" if point.value == told.proposal else "text" if point.value == told.original else "accent"
        )
        painter.setPen(QPen(self._theme.colour(name), 1.5))
        painter.setBrush(self._theme.colour(name))
        painter.drawLine(low, high)
