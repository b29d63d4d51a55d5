"""States for the eye: a shape, a colour's name and a word, never one of them alone."""

from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QBrush, QColor, QPainter, QPen, QPolygonF

from server_gui.core.desk.station import Station
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot


@dataclass(frozen=True, slots=True)
class Mark:
    """`shape` is one of the keys of `SHAPES`, `colour` a name in the palette."""

    shape: str
    colour: str
    word: str = ""


STATES: Final = {
    "ok": Mark("disc", "good", "ok"),
    "stale": Mark("ring", "old", "stale"),
    "lost": Mark("cross", "bad", "lost"),
    "fault": Mark("square", "bad", "fault"),
    "operation enabled": Mark("disc", "good", "operation enabled"),
    "switched on": Mark("half", "warn", "switched on"),
    "ready to switch on": Mark("half", "warn", "ready to switch on"),
    "switch on disabled": Mark("ring", "dim", "switch on disabled"),
    "not ready to switch on": Mark("ring", "dim", "not ready"),
    "quick stop active": Mark("triangle", "warn", "quick stop active"),
    "fault reaction active": Mark("square", "bad", "fault reaction"),
}

NEWS: Final = {
    NewsKind.LINK: Mark("ring", "warn", "LINK"),
    NewsKind.STATE: Mark("diamond", "accent", "STATE"),
    NewsKind.WARNING: Mark("triangle", "warn", "WARN"),
    NewsKind.FAULT: Mark("square", "bad", "FAULT"),
    NewsKind.PARAMETER: Mark("disc", "good", "PARAM"),
    NewsKind.STOP: Mark("square", "bad", "STOP"),
    NewsKind.CONTROL: Mark("diamond", "accent", "CONTROL"),
}


def state_mark(word: str | None) -> Mark:
    """Return the mark of a component's or drive's state."""
    if word is None:
        return Mark("ring", "old", "not known")
    return STATES.get(word.lower(), Mark("triangle", "warn", word))


def age_text(age_s: float | None) -> str:
    """Return an age for people."""
    if age_s is None:
        return "no data yet"
    if age_s < 1.0:
        return f"{age_s * 1000:.0f} ms"
    if age_s < 120.0:
        return f"{age_s:.1f} s"
    return f"{age_s / 60:.0f} min" if age_s < 7200 else f"{age_s / 3600:.1f} h"


def old_text(station: Station) -> tuple[str, ...]:
    """Return how old what is shown is, the fullest wording first."""
    age_s = station.robot.age_s()
    if age_s is None:
        return ("no data yet",)
    return f"STALE, {age_text(age_s)} old", f"{age_text(age_s)} old"


def drives_mark(robot: Robot) -> Mark:
    """Return all drives in one: enabled only where every one is, the worst otherwise."""
    joints = robot.names("joint")
    if not joints:
        return Mark("ring", "old", "no drives")
    if robot.is_stale():
        return Mark("ring", "old", "drives not known now")
    words = [robot.word(f"{joint}.state") for joint in joints]
    for bad in ("fault", "fault reaction active", "quick stop active"):
        if bad in words:
            return Mark(STATES[bad].shape, STATES[bad].colour, f"{words.count(bad)} in {bad}")
    enabled = words.count("operation enabled")
    if enabled == len(joints):
        return Mark("disc", "good", "operation enabled")
    if enabled:
        return Mark("half", "warn", f"{enabled} of {len(joints)} enabled")
    return state_mark(words[0]) if len(set(words)) == 1 else Mark("half", "warn", "drives differ")


def station_mark(station: Station) -> Mark:
    """Return a robot in one mark."""
    robot = station.robot
    if not station.is_linked:
        return Mark("cross", "bad", "no link")
    if robot.is_stale():
        return Mark("triangle", "warn", "no data")
    worst = {part.state for part in robot.parts.values()}
    if "fault" in worst or "lost" in worst:
        return Mark("square", "bad", "fault" if "fault" in worst else "lost")
    return drives_mark(robot)


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
