"""States as shapes: draws what `server_gui.core.alarms.marks` calls them."""

import datetime
from typing import Final

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QBrush, QColor, QPainter, QPen, QPolygonF

from server_gui.core.alarms.marks import (
    NEWS,
    STATES,
    Mark,
    age_text,
    drives_mark,
    enabled_text,
    state_mark,
)
from server_gui.core.desk.station import Station

__all__ = [
    "NEWS",
    "SHORTER",
    "STATES",
    "Mark",
    "age_text",
    "day_and_time",
    "draw",
    "drives_mark",
    "enabled_text",
    "state_mark",
    "time_of_day",
]

# Where there is no room for a state's own words.
SHORTER: Final = {
    "operation enabled": "enabled",
    "switch on disabled": "disabled",
    "ready to switch on": "ready",
    "quick stop active": "quick stop",
    "ANOTHER ROBOT ANSWERS": "ANOTHER ROBOT",
}


def old_text(station: Station) -> tuple[str, ...]:
    """Return how old what is shown is, the fullest wording first."""
    age_s = station.robot.age_s()
    if age_s is None:
        return ("no data yet",)
    return f"STALE, {age_text(age_s)} old", f"{age_text(age_s)} old"


def draw(painter: QPainter, mark: Mark, colour: QColor, box: QRectF) -> None:
    """Draw the mark's shape in a square."""
    painter.setPen(QPen(colour, max(1.2, box.width() / 7)))
    painter.setBrush(QBrush(colour))
    inset = box.width() * 0.12
    inner = box.adjusted(inset, inset, -inset, -inset)
    match mark.shape:
        case "disc":
            painter.drawEllipse(inner)
        case "square":
            painter.drawRect(inner)
        case "box":
            painter.setBrush(QBrush())
            painter.drawRect(inner)
        case "ring":
            painter.setBrush(QBrush())
            painter.drawEllipse(inner)
        case "half":
            painter.drawChord(inner, 90 * 16, 180 * 16)
            painter.setBrush(QBrush())
            painter.drawEllipse(inner)
        case "cross":
            painter.drawLine(inner.topLeft(), inner.bottomRight())
            painter.drawLine(inner.topRight(), inner.bottomLeft())
        case _:
            painter.drawPolygon(_polygon(mark.shape, inner))


def _polygon(shape: str, box: QRectF) -> QPolygonF:
    middle = box.center()
    if shape == "triangle":
        return QPolygonF([QPointF(middle.x(), box.top()), box.bottomRight(), box.bottomLeft()])
    return QPolygonF(
        [
            QPointF(middle.x(), box.top()),
            QPointF(box.right(), middle.y()),
            QPointF(middle.x(), box.bottom()),
            QPointF(box.left(), middle.y()),
        ]
    )


def time_of_day(utc_s: float) -> str:
    """Return an instant by the local clock."""
    return f"{datetime.datetime.fromtimestamp(utc_s, datetime.UTC).astimezone():%H:%M:%S}"


def day_and_time(utc_s: float) -> str:
    """Return an instant by the local clock, with its day where that is not today."""
    then = datetime.datetime.fromtimestamp(utc_s, datetime.UTC).astimezone()
    is_today = then.date() == datetime.datetime.now().astimezone().date()
    return f"{then:%H:%M:%S}" if is_today else f"{then:%Y-%m-%d %H:%M}"
