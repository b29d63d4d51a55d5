"""The gait-phase ring: where each leg is in its stride; left is the outer ring, right the inner.

A line across a ring is what the steps that were seen say, a dot in it what a model says.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Final

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.core.desk.leg_phase import PHASES, LegPhase
from server_gui.core.processing.gait_events import Leg
from server_gui.views.theme import Theme

GAP_DEG: Final = 2.4  # between two phases
SMALL: Final = 0.75  # of the size that text has elsewhere: what is smaller is not read
LEAST: Final = 90  # wide and high, at text of 100 %: three lines have room in its middle
READ: Final = 0.85  # of it, in the smallest ring
MOST_READ: Final = 1.3  # likewise, in a larger one with as few lines
MIDDLE: Final = 0.57  # of the widget, wide: what the rings leave
FREE: Final = 1.08  # of the box in the middle: the circle that touches no ring
MOST, MOST_SHORT = 5, 3  # lines; above and below three small ones the circle has no room
LETTERS: Final = 0.7  # of a line, high
DIM: Final = 70  # opacity of the phases that are not now, of 255


LONGEST: Final = max((name for name, _ in PHASES), key=len)
Phases = dict[Leg, LegPhase | None]
Row = tuple[str, str, float, bool]  # text, colour, size, whether it is bold


class GaitRing(QWidget):
    """Shows a word in the middle, what is known of it below, and each leg's phase around."""

    def __init__(self, theme: Theme, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme = theme
        self._phases: Phases = dict.fromkeys(Leg)
        self._modelled: Phases = dict.fromkeys(Leg)
        self._word, self._below, self._live = "", "", False
        self._key: tuple[object, ...] = ()
        self.letters: tuple[float, ...] = ()  # how large they were drawn last (points)
        self._drawn = QPixmap()
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Gait phase")
        theme.changed.connect(self._restyle)
        self._restyle()

    def sizeHint(self) -> QSize:
        return self.minimumSize()

    def _restyle(self) -> None:
        side = self._theme.px(LEAST)
        self.setMinimumSize(side, side)

    def show_phases(self, phases: Phases, modelled: Phases, word: str, below: str, *, live: bool) -> None:
        """Draw these, by steps and by a model; what is not `live` is grey."""
        self._phases, self._word, self._below, self._live = phases, word, below, live
        self._modelled = modelled
        told = (f"{leg.value} {_percent(phases[leg] or modelled[leg])}" for leg in Leg)
        self.setAccessibleDescription(", ".join(filter(None, (word, below, *told))))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        rings, band, middle = self._places()
        painter.drawPixmap(0, 0, self._picture(rings, band))
        for leg, ring in rings.items():
            now = self._phases[leg]
            if now is not None:
                self._draw_needle(painter, ring, band, now.percent)
            if (modelled := self._modelled[leg]) is not None:
                self._draw_dot(painter, ring, band, modelled.percent)
        self._draw_words(painter, middle)
        painter.end()

    @property
    def read(self) -> list[str]:
        """The lines in the middle, as there is room for them."""
        return [text for text, *_ in self._rows(self._places()[2])[0]]

    def _places(self) -> tuple[dict[Leg, QRectF], float, QRectF]:
        """Return where the rings are, how wide each is, and what is left in the middle."""
        side = min(self.width(), self.height()) - 6.0
        box = QRectF((self.width() - side) / 2, (self.height() - side) / 2, side, side)
        band = side * 0.075
        outer = box.adjusted(band / 2, band / 2, -band / 2, -band / 2)
        inset = band * 1.35
        inner = outer.adjusted(inset, inset, -inset, -inset)
        return {Leg.LEFT: outer, Leg.RIGHT: inner}, band, inner.adjusted(band, band, -band, -band)

    def _colour(self, leg: Leg) -> QColor:
        return self._theme.colour(leg.value if self._live else "old")

    def _picture(self, rings: Mapping[Leg, QRectF], band: float) -> QPixmap:
        """Return both rings, the phases that are now bright; drawn when they become others."""
        ratio, names = self.devicePixelRatioF(), [now.phase if now else "" for now in self._phases.values()]
        key = (self.size(), ratio, self._theme.colours, self._live, *names)
        if key != self._key:
            self._key = key
            self._drawn = QPixmap(self.size() * ratio)
            self._drawn.setDevicePixelRatio(ratio)
            self._drawn.fill(self._theme.colour("card"))
            painter = QPainter(self._drawn)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for leg, ring in rings.items():
                self._draw_ring(painter, leg, ring, band)
            painter.end()
        return self._drawn

    def _draw_ring(self, painter: QPainter, leg: Leg, ring: QRectF, band: float) -> None:
        now = self._phases[leg]
        pen = QPen(self._colour(leg), band)
        pen.setCapStyle(Qt.PenCapStyle.FlatCap)
        begin = 0.0
        for name, end in PHASES:
            colour = self._colour(leg)
            colour.setAlpha(255 if now is not None and now.phase == name else DIM)
            pen.setColor(colour)
            painter.setPen(pen)
            first, last = 3.6 * begin + GAP_DEG / 2, 3.6 * end - GAP_DEG / 2
            painter.drawArc(ring, round((90 - first) * 16), round((first - last) * 16))
            begin = end

    def _draw_needle(self, painter: QPainter, ring: QRectF, band: float, percent: float) -> None:
        angle = math.radians(3.6 * percent)
        direction = QPointF(math.sin(angle), -math.cos(angle))
        radius = ring.width() / 2
        painter.setPen(QPen(self._theme.colour("text"), 3.0))
        middle = ring.center()
        painter.drawLine(
            middle + direction * (radius - band * 0.6), middle + direction * (radius + band * 0.6)
        )

    def _draw_dot(self, painter: QPainter, ring: QRectF, band: float, percent: float) -> None:
        angle = math.radians(3.6 * percent)
        place = ring.center() + QPointF(math.sin(angle), -math.cos(angle)) * (ring.width() / 2)
        painter.setPen(QPen(self._theme.colour("card"), 1.5))
        painter.setBrush(self._theme.colour("text"))
        painter.drawEllipse(place, band * 0.3, band * 0.3)

    def _draw_words(self, painter: QPainter, box: QRectF) -> None:
        rows, line = self._rows(box)
        # The size of the letters does not change with a phase.
        widest = [(_widest(text), colour, factor, bold) for text, colour, factor, bold in rows]
        places, fonts = self._placed(box, widest, line)
        least = self._theme.text_font(SMALL).pointSizeF()
        if any(font.pointSizeF() < least for font in fonts.values()):  # without the phases' names, then
            rows, line = self._rows(box, is_brief=True)
            places, fonts = self._placed(box, rows, line)
        self.letters = tuple(font.pointSizeF() for font in fonts.values())
        for place, (text, colour, factor, bold) in zip(places, rows, strict=True):
            font = QFont(fonts[factor])
            font.setBold(bold)
            painter.setFont(font)
            painter.setPen(self._theme.colour(colour))
            painter.drawText(place, Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextDontClip, text)

    def _placed(
        self, box: QRectF, rows: Sequence[Row], line: float
    ) -> tuple[list[QRectF], dict[float, QFont]]:
        """Return where each line stands, and by their sizes the fonts with which they have room."""
        top = box.center().y() - line * len(rows) / 2
        places: list[QRectF] = []
        fonts: dict[float, QFont] = {}  # of lines that are to be as large, the smallest: both legs are alike
        for number, (text, _, factor, bold) in enumerate(rows):
            above = top + number * line
            place = QRectF(0.0, above, self._room(box, above, line), line)
            place.moveCenter(QPointF(box.center().x(), place.center().y()))
            places.append(place)
            font = self._fitting(text, factor, place, bold=bold)
            fonts[factor] = min(fonts.get(factor, font), font, key=QFont.pointSizeF)
        return places, fonts

    def _room(self, box: QRectF, top: float, line: float) -> float:
        """Return the width for a line within the inner ring: less above and below."""
        free = box.width() * FREE / 2
        off = abs(top + line / 2 - box.center().y()) + line * LETTERS / 2
        return 2 * math.sqrt(max(free**2 - off**2, 0.0))

    def _rows(self, box: QRectF, *, is_brief: bool = False) -> tuple[list[Row], float]:
        """Return the lines that have room, and how high each is.

        In a small ring the word has its widest part. Where it `is_brief`, phases have no names.
        """
        size = min(1.6, box.width() / self._theme.px(140))
        is_short = size < SMALL
        read = min(max(READ, READ * box.width() / (self._theme.px(LEAST) * MIDDLE)), MOST_READ)
        line = max(
            box.height() / 5.2,
            QFontMetricsF(self._theme.text_font(read if is_short else 0.8 * size)).height(),
        )
        plain, bold = (read, read) if is_short else (max(1.2 * size, READ), 1.5 * size)
        colour = "text" if self._live else "old"
        legs: list[Row] = []
        for leg in Leg:
            if (now := self._phases[leg] or self._modelled[leg]) is not None:
                said = self._phase_text(leg, now, box.width(), is_short=is_short or is_brief)
                legs.append((said, leg.value if self._live else "old", plain, False))
        most = max(1, min(int(box.height() / line), MOST_SHORT if is_short else MOST))
        lines = self._word_lines(box, most - len(legs), SMALL if legs else read)
        words: list[Row] = [(one, colour, bold, True) for one in lines]
        if is_short:
            return [*legs[:1], *words, *legs[1:]], line
        below: list[Row] = [(self._below, "dim", max(0.95 * size, READ), False)] if self._below else []
        return [*words, *below, *legs][:most], line

    def _word_lines(self, box: QRectF, most: int, wanted: float) -> list[str]:
        """Return the word in one line or several, in letters of the `wanted` size if all of it has room so.

        Without its number, which stands above the cards, if need be.
        """
        parts = re.split(r"\s(?=[^%])", self._word)
        names = [part for part in parts if not any(sign.isdigit() for sign in part)]
        whole = ([self._word], parts)
        forms = (
            *((form, wanted) for form in whole),
            *((form, SMALL) for form in (*whole, [" ".join(names)], names)),
        )
        fits = (
            form
            for form, size in forms
            if len(form) <= most and all(self._width(one, size) <= box.width() for one in form)
        )
        return [one for one in next(fits, []) if one]

    def _phase_text(self, leg: Leg, now: LegPhase, room: float, *, is_short: bool) -> str:
        """Return the phase, with its name if that has room in letters that are read."""
        letter = leg.value[0].upper()
        full = f"{letter}  {now.phase} {now.percent:.0f} %"
        fits = not is_short and self._width(_widest(full)) <= room
        return full if fits else f"{letter} {now.percent:.0f} %"

    def _width(self, text: str, size: float = SMALL) -> float:
        return QFontMetricsF(self._theme.text_font(size, bold=True)).horizontalAdvance(text)

    def _fitting(self, text: str, factor: float, place: QRectF, *, bold: bool) -> QFont:
        """As large as wanted, or as there is room for."""
        font = self._theme.text_font(factor, bold=bold)
        width = QFontMetricsF(font).horizontalAdvance(text)
        if width > place.width() > 0:
            font.setPointSizeF(0.98 * font.pointSizeF() * place.width() / width)
        return font


def _widest(text: str) -> str:
    """Return a leg's line with its phase's name as it is where that is the longest; others as they are."""
    return f"{text[0]}  {LONGEST} 100 %" if text[1:3] == "  " else text


def _percent(phase: LegPhase | None) -> str:
    return "not known" if phase is None else f"{phase.percent:.0f} % of its stride, {phase.phase}"


def meaning(sources: Collection[str], instead: Sequence[str], *, model: bool) -> tuple[str, ...]:
    """Return what the rings mean, the fullest wording first; what stands `instead` of an insole stays."""
    rings, short = "outer ring left, inner right", "outer left, inner right"
    told = [f"line: steps by {', '.join(sorted(sources))}"] if sources else []
    told += ["dot: model"] if model else []
    if instead:
        return " · ".join([rings, *told]), f"{short} · {', '.join(instead)}", ", ".join(instead), instead[0]
    return tuple(dict.fromkeys((" · ".join([rings, *told]), rings, short, "outer L, inner R")))
