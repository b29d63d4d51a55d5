"""The wearer from the right side, as a stick figure that the real angles drive."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.views.theme import Theme

# Segments as shares of the body's height: Drillis & Contini 1966, in Winter, Biomechanics and Motor Control.
TRUNK, THIGH, SHANK, ANKLE, FOOT = 0.288, 0.245, 0.246, 0.039, 0.152
HEEL: Final = 0.04  # behind the ankle
HEAD: Final = 0.065  # radius
REACH: Final = 1.12  # the drawing's height


@dataclass(frozen=True, slots=True)
class Pose:
    """Angles in rad; None where one is not known: it is drawn as 0, dashed and grey."""

    hip: float | None
    knee: float | None
    ankle: float | None


class StickFigure(QWidget):
    """Flexion of hip and knee, dorsiflexion of the ankle, and forward lean count positive."""

    def __init__(self, theme: Theme, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme = theme
        self._legs: Mapping[str, Pose] = {}
        self._tilt: float | None = None
        self._wrong: frozenset[str] = frozenset()
        self._texts: Mapping[str, Sequence[str]] = {}
        self._live = False
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(130, 150)
        self.setAccessibleName("Posture from the right side")

    def sizeHint(self) -> QSize:
        return QSize(220, 230)

    def show_pose(
        self,
        legs: Mapping[str, Pose],
        tilt: float | None,
        wrong: frozenset[str],
        texts: Mapping[str, Sequence[str]],
        *,
        live: bool,
    ) -> None:
        """Draw this; `wrong` names the joints to be ringed, `texts` are each side's angles in words."""
        self._legs, self._tilt, self._wrong, self._live = legs, tilt, wrong, live
        self._texts = texts
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), self._theme.colour("card"))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        unit = min(self.height() * 0.94 / REACH, self.width() * 1.25)
        lean = self._tilt or 0.0
        chains = {
            side: chain(self._legs.get(side, Pose(None, None, None)), lean) for side in ("left", "right")
        }
        drop = max(point.y() for points in chains.values() for point in points)
        ground = self.height() * 0.95
        hip = QPointF(self.width() / 2, ground - drop * unit)
        painter.setPen(QPen(self._theme.colour("border"), 2))
        painter.drawLine(QPointF(self.width() * 0.06, ground), QPointF(self.width() * 0.94, ground))
        self._draw_leg(painter, "left", chains["left"], hip, unit)
        self._draw_trunk(painter, hip, lean, unit)
        self._draw_leg(painter, "right", chains["right"], hip, unit)
        self._draw_angles(painter)
        painter.end()

    def _draw_angles(self, painter: QPainter) -> None:
        """Hip, knee and ankle of each side in words: colour alone says nothing to some."""
        painter.setFont(self._theme.number_font(0.95))
        line = painter.fontMetrics().height()
        for row, (side, texts) in enumerate(self._texts.items()):
            painter.setPen(self._theme.colour(side if self._live else "old"))
            box = QRectF(0, row * line, self.width(), line)
            painter.drawText(box, Qt.AlignmentFlag.AlignRight, f"{side[0].upper()} {' '.join(texts)}")

    def _draw_trunk(self, painter: QPainter, hip: QPointF, lean: float, unit: float) -> None:
        colour = self._theme.colour("text" if self._live and self._tilt is not None else "old")
        neck = hip + QPointF(math.sin(lean), -math.cos(lean)) * (TRUNK * unit)
        painter.setPen(self._pen(colour, unit * 0.05, dashed=self._tilt is None))
        painter.drawLine(hip, neck)
        painter.setPen(QPen(colour, unit * 0.014))
        painter.setBrush(self._theme.colour("card"))
        head = neck + QPointF(math.sin(lean), -math.cos(lean)) * (HEAD * unit)
        painter.drawEllipse(head, HEAD * unit, HEAD * unit)

    def _draw_leg(
        self, painter: QPainter, side: str, points: tuple[QPointF, ...], hip: QPointF, unit: float
    ) -> None:
        pose = self._legs.get(side, Pose(None, None, None))
        knee, ankle, heel, toe = (hip + point * unit for point in points)
        colour = self._theme.colour(side if self._live else "old")
        for known, (begin, end), width in (
            (pose.hip, (hip, knee), 0.05),
            (pose.knee, (knee, ankle), 0.042),
            (pose.ankle, (heel, toe), 0.032),
        ):
            shown = colour if known is not None else self._theme.colour("old")
            painter.setPen(self._pen(shown, unit * width, dashed=known is None))
            painter.drawLine(begin, end)
        painter.setPen(self._pen(colour, unit * 0.032))
        painter.drawLine(ankle, heel)
        for name, point in (("hip", hip), ("knee", knee), ("ankle", ankle)):
            self._draw_joint(painter, f"{side}_{name}", point, unit)

    def _draw_joint(self, painter: QPainter, joint: str, point: QPointF, unit: float) -> None:
        wrong = joint in self._wrong
        painter.setBrush(self._theme.colour("card"))
        painter.setPen(
            QPen(self._theme.colour("bad" if wrong else "text"), unit * (0.02 if wrong else 0.012))
        )
        radius = unit * (0.034 if wrong else 0.026)
        painter.drawEllipse(point, radius, radius)

    @staticmethod
    def _pen(colour: QColor, width: float, *, dashed: bool = False) -> QPen:
        pen = QPen(colour, width)
        pen.setCapStyle(Qt.PenCapStyle.FlatCap if dashed else Qt.PenCapStyle.RoundCap)
        if dashed:
            pen.setStyle(Qt.PenStyle.DotLine)
        return pen


def chain(pose: Pose, lean: float) -> tuple[QPointF, QPointF, QPointF, QPointF]:
    """Knee, ankle, heel and toe as seen from the hip, in body heights; x forward, y down."""
    thigh = (pose.hip or 0.0) - lean
    shank = thigh - (pose.knee or 0.0)
    sole = shank + (pose.ankle or 0.0)
    knee = QPointF(math.sin(thigh), math.cos(thigh)) * THIGH
    ankle = knee + QPointF(math.sin(shank), math.cos(shank)) * SHANK
    down, forward = QPointF(math.sin(sole), math.cos(sole)), QPointF(math.cos(sole), -math.sin(sole))
    heel = ankle + down * ANKLE - forward * HEEL
    toe = ankle + down * ANKLE + forward * (FOOT - HEEL)
    return knee, ankle, heel, toe
