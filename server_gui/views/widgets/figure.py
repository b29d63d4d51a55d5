"""The wearer from the right side, as a stick figure that the real angles drive."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from PySide6.QtCore import QPointF, QRectF, QSize, QSizeF, Qt
from PySide6.QtGui import (
    QColor,
    QFont,
    QFontMetrics,
    QFontMetricsF,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.views.theme import Theme

# Segments as shares of the body's height: Drillis & Contini 1966, in Winter, Biomechanics and Motor Control.
TRUNK, THIGH, SHANK, ANKLE, FOOT = 0.288, 0.245, 0.246, 0.039, 0.152
HEEL: Final = 0.04  # behind the ankle
HEAD: Final = 0.065  # radius
REACH: Final = 1.12  # the drawing's height
SIDES: Final = ("left", "right")
JOINTS: Final = ("hip", "knee", "ankle")
STEPS: Final = 16  # points of a segment, within which letters are kept off it
ANGLES_SIZES: Final = (0.95, 0.85, 0.75, 0.65, 0.55, 0.45)  # of the text's


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
        self.setMinimumSize(130, 96)
        self.setAccessibleName("Posture from the right side")

    def sizeHint(self) -> QSize:
        return QSize(160, 120)

    def show_pose(
        self,
        legs: Mapping[str, Pose],
        tilt: float | None,
        wrong: frozenset[str],
        texts: Mapping[str, Sequence[str]],
        *,
        live: bool,
    ) -> None:
        """Draw this: a leg that is not among `legs` is none of the robot's.

        `wrong` names the joints to be ringed, `texts` are each side's angles in words.
        """
        self._legs, self._tilt, self._wrong, self._live = legs, tilt, wrong, live
        self._texts = texts
        told = [f"{side} {' '.join(texts[side])}" for side in texts] if live else ["not known now"]
        wrongs = [f"{name.replace('_', ' ')} not ok" for name in sorted(wrong)]
        self.setAccessibleDescription(", ".join([*told, *wrongs]))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), self._theme.colour("card"))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if not self._is_known():
            painter.setPen(self._theme.colour("dim"))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, "posture not known")
            painter.end()
            return
        painter.setFont(self._theme.number_font(0.95))
        metrics = painter.fontMetrics()
        beside = self.width() / 2 - metrics.horizontalAdvance(" " * 19) > self.height() * 0.1
        above = 0 if beside else 3 * metrics.height()  # the words
        unit = min((self.height() - above) * 0.94 / REACH, self.width() * 1.25)
        lean = self._tilt or 0.0
        chains = {side: chain(pose, lean) for side, pose in self._legs.items()}
        stands = chain(Pose(None, None, None), 0.0)  # of a robot without legs
        drop = max(point.y() for points in chains.values() or (stands,) for point in points)
        ground = self.height() * 0.95
        hip = QPointF(self.width() / 2, ground - drop * unit)
        painter.setPen(QPen(self._theme.colour("border"), 2))
        painter.drawLine(QPointF(self.width() * 0.06, ground), QPointF(self.width() * 0.94, ground))
        first, last = ("right", "left") if self._is_wrong("left") and not self._is_wrong("right") else SIDES
        if first in chains:
            self._draw_leg(painter, first, chains[first], hip, unit)
        self._draw_trunk(painter, hip, lean, unit)
        if last in chains:
            self._draw_leg(painter, last, chains[last], hip, unit)
        placed = {side: [hip, *(hip + point * unit for point in points)] for side, points in chains.items()}
        self._name_sides(painter, placed, unit * 0.03)
        self._name_joints(painter, chains, hip, unit)
        self._draw_angles(painter)
        painter.end()

    def _is_known(self) -> bool:
        angles = [angle for leg in self._legs.values() for angle in (leg.hip, leg.knee, leg.ankle)]
        return any(angle is not None for angle in [*angles, self._tilt])

    def _is_wrong(self, side: str) -> bool:
        return any(joint.startswith(side) for joint in self._wrong)

    def _name_sides(self, painter: QPainter, legs: Mapping[str, Sequence[QPointF]], thick: float) -> None:
        """Draw the sides' names before the toes, on no leg: colour alone says nothing to some people."""
        painter.setFont(self._theme.text_font(bold=True))
        metrics = painter.fontMetrics()
        at = {side: points[-1] + QPointF(6, 3) for side, points in legs.items()}
        if len(at) == len(SIDES):
            left, right = at["left"], at["right"]
            high, beside = metrics.ascent(), abs(left.x() - right.x()) > metrics.maxWidth()
            if not beside and abs(left.y() - right.y()) < high:  # neither letter lies over the other
                left.setY(right.y() - high)
        taken: list[QRectF] = []
        for side, wanted in at.items():
            point = beside_legs(side[0].upper(), wanted, metrics, legs.values(), thick, taken)
            letter = QPainterPath()
            letter.addText(point, painter.font(), side[0].upper())
            painter.strokePath(letter, QPen(self._theme.colour("card"), 3))  # it may stand on the other leg
            painter.fillPath(letter, self._theme.colour(side if self._live else "old"))

    def _name_joints(
        self, painter: QPainter, chains: Mapping[str, tuple[QPointF, ...]], hip: QPointF, unit: float
    ) -> None:
        """Name each joint in trouble behind the wearer, where no leg swings to."""
        at = {
            (side, joint): hip + point * unit
            for side, points in chains.items()
            for joint, point in zip(JOINTS, (QPointF(), *points), strict=False)
            if f"{side}_{joint}" in self._wrong
        }
        painter.setFont(self._theme.text_font(bold=True))
        metrics = QFontMetricsF(painter.font())
        names = placed_names(at, metrics, unit * 0.06, QSizeF(self.size()))
        for _, box, joints in names:
            painter.setPen(QPen(self._theme.colour("bad" if self._live else "old"), 1))
            middle = QPointF(box.right(), box.center().y())
            for joint in joints if len(at) > 1 else ():  # of several it is shown which is meant
                painter.drawLine(middle, joint)
        for text, box, _ in names:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(self._theme.colour("card"))
            painter.drawRoundedRect(box, 3, 3)
            painter.setPen(self._theme.colour("bad" if self._live else "old"))
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)

    def _draw_angles(self, painter: QPainter) -> None:
        """Hip, knee and ankle of each side in words."""
        rows = [
            (" ", JOINTS, "dim"),
            *((side[0].upper(), texts, side) for side, texts in self._texts.items()),
        ]
        said = [f"{head}{''.join(f'{text:>6}' for text in texts)}" for head, texts, _ in rows]
        painter.setFont(self._font_for(said))
        line = painter.fontMetrics().height()
        for row, (_, _, colour) in enumerate(rows):
            painter.setPen(self._theme.colour(colour if self._live or colour == "dim" else "old"))
            box = QRectF(0, row * line, self.width(), line)
            painter.drawText(box, Qt.AlignmentFlag.AlignRight, said[row])

    def _font_for(self, lines: Sequence[str]) -> QFont:
        """Return the usual one, or as much smaller as it takes for every number to be whole."""
        for factor in ANGLES_SIZES:
            font = self._theme.number_font(factor)
            if max(map(QFontMetricsF(font).horizontalAdvance, lines)) < self.width():
                break
        return font

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
        pose = self._legs[side]
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


def beside_legs(
    text: str,
    wanted: QPointF,
    metrics: QFontMetrics,
    legs: Iterable[Sequence[QPointF]],
    thick: float,
    taken: list[QRectF],
) -> QPointF:
    """Return where a letter stands, as near as it can to the right of what is wanted: on no leg or letter."""
    steps = [number / STEPS for number in range(STEPS + 1)]
    drawn = [
        one + (other - one) * step for points in legs for one, other in pairwise(points) for step in steps
    ]
    wide, high = metrics.horizontalAdvance(text), metrics.capHeight()
    point = QPointF(wanted)
    while math.isfinite(point.x()):
        box = QRectF(point.x(), point.y() - high, wide, high)
        around = box.adjusted(-thick - 1, -thick - 1, thick + 1, thick + 1)
        met = [one.x() + thick + 2 for one in drawn if around.contains(one)]
        met += [one.right() + 2 for one in taken if one.intersects(around)]
        if not met:
            taken.append(box)
            return point
        point.setX(max(point.x() + 1.0, max(met)))
    return point


Named = tuple[str, QRectF, Sequence[QPointF]]  # a name, where it stands, and the joints that it names


def placed_names(
    at: Mapping[tuple[str, str], QPointF], metrics: QFontMetricsF, beside: float, room: QSizeF
) -> list[Named]:
    """Return where the names of these joints stand, none over another: both sides of one have one name."""
    named: list[tuple[str, Sequence[QPointF]]] = []
    for joint in JOINTS:
        sides = [side for side in SIDES if (side, joint) in at]
        name = f"both {joint}s" if len(sides) == len(SIDES) else f"{' '.join(sides)} {joint}"
        if sides:
            named.append((name, [at[side, joint] for side in sides]))
    named.sort(key=lambda one: max(point.y() for point in one[1]))
    high = metrics.height() + 2
    tops: list[float] = []
    for _, points in named:
        wanted = sum(point.y() for point in points) / len(points) - high / 2
        tops.append(max(wanted, tops[-1] + high + 1) if tops else wanted)
    below = room.height()
    for place in reversed(range(len(tops))):  # what would stand below the picture, and what it meets then
        tops[place] = min(tops[place], below - high)
        below = tops[place] - 1
    found: list[Named] = []
    for (name, points), top in zip(named, tops, strict=True):
        wide = metrics.horizontalAdvance(name) + 8
        left = min(point.x() for point in points) - beside - wide
        found.append((name, QRectF(max(0.0, left), top, wide, high), points))
    return found


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
