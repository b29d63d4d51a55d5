"""The whole of a recording as a bar: what went on, where it is played, what happened when, its labels."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Final

import numpy as np
from PySide6.QtCore import QLineF, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from ml.store.labels import Label
from server_gui.core.archive.outline import Outline
from server_gui.core.cloud.tape import Tape
from server_gui.core.desk.flags import Flag
from server_gui.views.marks import draw
from server_gui.views.theme import Theme
from server_gui.views.widgets.cursors import FIRST, FLAGS, told
from server_gui.views.widgets.plain import set_tip

SECOND_NS: Final = 1_000_000_000
STEPS: Final = {
    Qt.Key.Key_Left: -1.0,
    Qt.Key.Key_Right: 1.0,
    Qt.Key.Key_PageUp: -10.0,
    Qt.Key.Key_PageDown: 10.0,
}
TICKS_S: Final = (1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 14400, 43200, 86400)
# Paul Tol's light scheme, for labels: no two of them alike to those who see fewer colours.
HUES: Final = ("#77aadd", "#ee8866", "#eedd88", "#ffaabb", "#99ddff", "#44bb99", "#bbcc33", "#aaaa00")
BAR, LOW_BAR = 40, 26  # high, at text of 100 %: and where there is little room
LABELLED: Final = 0.42  # of which labels take so much, at its bottom


TIP: Final = (
    "Click or drag to jump; Shift and drag to choose a span.\n"
    "Arrows: 1 s, Page: 10 s, Home, End; N: next event, with Shift the one before; I and O: the span "
    "begins, ends here; Space: play"
)


class Timeline(QWidget):
    """`moved` brings the instant that was asked for, `chosen` begin and end of a span: UTC in ns."""

    moved = Signal(object)
    chosen = Signal(object, object)
    toggled = Signal()
    turned = Signal(int)  # to the next event, or the one before

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._tape: Tape | None = None
        self._position_ns = 0
        self._labels: Sequence[Label] = ()
        self._flags: Sequence[Flag] = ()
        self._beside: Sequence[Flag] = ()
        self._bar_px = BAR
        self._other = ""  # what the recording beside is called
        self._outline: Outline | None = None
        self._outlined = -1  # its revision
        self._dragged_from_ns: int | None = None
        self.span_ns: tuple[int, int] | None = None
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Time of the recording")
        set_tip(self, TIP)
        self.setMouseTracking(True)
        theme.changed.connect(self.updateGeometry)

    def sizeHint(self) -> QSize:
        return QSize(400, self._theme.px(34 + self._bar_px))

    def show_tape(self, tape: Tape) -> None:
        """Show another recording."""
        self._tape, self._labels, self._flags, self._beside, self.span_ns = tape, (), (), (), None
        self.show_position(tape.first_ns)

    def be_low(self, low: bool) -> None:
        """Leave room to what is above."""
        wanted = LOW_BAR if low else BAR
        if wanted != self._bar_px:
            self._bar_px = wanted
            self.updateGeometry()
            self.update()

    def show_position(self, position_ns: int) -> None:
        """Show where it is played."""
        if position_ns != self._position_ns:
            self._position_ns = position_ns
            self.setAccessibleDescription(clock_text(self._since_s(position_ns)))
            self.update()

    def show_labels(self, labels: Sequence[Label]) -> None:
        """Show its labels."""
        self._labels = labels
        self.update()

    def show_flags(self, flags: Sequence[Flag], beside: Sequence[Flag] = (), other: str = "") -> None:
        """Show what happened when; `beside`: in a second recording, which is called `other`, dashed."""
        self._flags, self._beside, self._other = flags, beside, other
        self.update()

    def show_outline(self, outline: Outline) -> None:
        """Show what went on all the time."""
        if outline.revision != self._outlined:
            self._outline, self._outlined = outline, outline.revision
            self.update()

    def told(self, flag: Flag) -> str:
        """Return what happened, in words."""
        whose = "" if flag in self._flags else f"{self._other} "
        return f"{whose}{flag.kind.value}: {flag.text}{self._outside(flag)}"

    def _outside(self, flag: Flag) -> str:
        if self._tape is None or self.is_within(flag):
            return ""
        return ", before its beginning" if flag.at_ns < self._tape.first_ns else ", after its end"

    def choose(self, begin_ns: int, end_ns: int) -> None:
        """Choose a span."""
        self.span_ns = (min(begin_ns, end_ns), max(begin_ns, end_ns))
        self.chosen.emit(*self.span_ns)
        self.update()

    def begin_span(self) -> None:
        """Begin the span where it is played."""
        if self._tape is not None:
            end_ns = self._tape.last_ns if self.span_ns is None else self.span_ns[1]
            self.choose(self._position_ns, max(end_ns, self._position_ns))

    def end_span(self) -> None:
        """End the span where it is played."""
        if self._tape is not None:
            begin_ns = self._tape.first_ns if self.span_ns is None else self.span_ns[0]
            self.choose(min(begin_ns, self._position_ns), self._position_ns)

    def choose_all(self) -> None:
        """Choose the whole recording."""
        if self._tape is not None:
            self.choose(self._tape.first_ns, self._tape.last_ns)

    # --- what people do

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if self._tape is not None and event.button() is Qt.MouseButton.LeftButton:
            flag = self._flag_at(event.position())
            at_ns = self._instant(event.position().x()) if flag is None else flag.at_ns
            shifted = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            self._dragged_from_ns = at_ns if shifted else None
            self.moved.emit(at_ns)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        flag = self._flag_at(event.position())
        set_tip(self, TIP if flag is None else f"{self._since(flag)}  {self.told(flag)}")
        if self._tape is None or not event.buttons() & Qt.MouseButton.LeftButton:
            return
        at_ns = self._instant(event.position().x())
        if self._dragged_from_ns is not None:
            self.choose(self._dragged_from_ns, at_ns)
        self.moved.emit(at_ns)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        tape, key = self._tape, Qt.Key(event.key())
        if key is Qt.Key.Key_N:
            back = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            self.turned.emit(-1 if back else 1)
            return
        if tape is None or event.modifiers():
            super().keyPressEvent(event)
            return
        ends = {Qt.Key.Key_Home: tape.first_ns, Qt.Key.Key_End: tape.last_ns}
        actions: dict[Qt.Key, Callable[[], None]] = {
            Qt.Key.Key_I: self.begin_span,
            Qt.Key.Key_O: self.end_span,
            Qt.Key.Key_Space: self.toggled.emit,
        }
        if key in STEPS:
            self.moved.emit(self._position_ns + round(STEPS[key] * SECOND_NS))
        elif key in ends:
            self.moved.emit(ends[key])
        elif key in actions:
            actions[key]()
        else:
            super().keyPressEvent(event)

    # --- how it is drawn

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._tape is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        bar = self._bar()
        painter.fillRect(bar, self._theme.colour("field"))
        self._draw_span(painter, bar)
        self._draw_outline(painter, bar)
        self._draw_labels(painter, bar)
        painter.setPen(self._theme.colour("accent" if self.hasFocus() else "border"))
        painter.drawRect(bar)
        self._draw_ticks(painter, bar)
        self._draw_beside(painter, bar)
        self._draw_flags(painter, bar)
        x = self._x(self._position_ns)
        painter.setPen(QPen(self._theme.colour("text"), 2))
        painter.drawLine(QPointF(x, 0), QPointF(x, bar.bottom() + 2))
        painter.end()

    def _draw_span(self, painter: QPainter, bar: QRectF) -> None:
        if self.span_ns is not None:
            left, right = map(self._x, self.span_ns)
            colour = self._theme.colour("accent")
            colour.setAlpha(70)
            painter.fillRect(QRectF(left, bar.top(), max(right - left, 2.0), bar.height()), colour)

    def _draw_outline(self, painter: QPainter, bar: QRectF) -> None:
        """Above the labels: how far each knee bent; hatched where it was not read."""
        if self._outline is None or not self._outline.least:
            return
        high = bar.height() * (1 - LABELLED) - 4
        painter.save()
        unread = bar.adjusted(bar.width() * self._outline.read_share, 0, 0, -bar.height() * LABELLED)
        painter.fillRect(unread, QBrush(self._theme.colour("old"), Qt.BrushStyle.BDiagPattern))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, on=False)
        for name, least in self._outline.least.items():
            most = self._outline.most[name]
            known = np.flatnonzero(~np.isnan(least))
            if not len(known):
                continue
            bottom, span = np.nanmin(least), np.nanmax(most) - np.nanmin(least)
            scale = high / span if span > 0 else 0.0
            colour = self._theme.side(name)
            colour.setAlpha(150)
            wide = bar.width() / len(least)
            pen = QPen(colour, max(wide, 1.0))
            pen.setCapStyle(Qt.PenCapStyle.FlatCap)
            painter.setPen(pen)
            floor = bar.top() + 2 + high
            places = bar.left() + (known + 0.5) * wide
            tops, bottoms = floor - (most[known] - bottom) * scale, floor - (least[known] - bottom) * scale
            painter.drawLines(
                [
                    QLineF(x, top, x, max(low, top + 1))
                    for x, top, low in zip(places, tops, bottoms, strict=True)
                ]
            )
        painter.restore()

    def _draw_labels(self, painter: QPainter, bar: QRectF) -> None:
        painter.setFont(self._theme.text_font(0.85))
        names = sorted({label.label for label in self._labels})
        for label in self._labels:
            left, right = self._x(label.began_utc_ns), self._x(label.ended_utc_ns)
            high = bar.height() * LABELLED
            box = QRectF(left, bar.bottom() - high, max(right - left, 2.0), high)
            painter.fillRect(box, QColor(HUES[names.index(label.label) % len(HUES)]))
            painter.setPen(QColor("#101010"))
            painter.drawText(box.adjusted(3, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, label.label)

    def _draw_ticks(self, painter: QPainter, bar: QRectF) -> None:
        if self._tape is None:
            return
        painter.setFont(self._theme.text_font(0.8))
        painter.setPen(self._theme.colour("dim"))
        seconds = max((self._tape.last_ns - self._tape.first_ns) / SECOND_NS, 1e-3)
        room = max(bar.width() / self._theme.px(60), 1.0)
        step = next((tick for tick in TICKS_S if seconds / tick <= room), TICKS_S[-1])
        for tick in range(0, int(seconds) + 1, step):
            x = self._x(self._tape.first_ns + tick * SECOND_NS)
            painter.drawLine(QPointF(x, bar.bottom()), QPointF(x, bar.bottom() + 4))
            place = QRectF(x - self._theme.px(30), bar.bottom() + 4, self._theme.px(60), self._theme.px(14))
            painter.drawText(place, Qt.AlignmentFlag.AlignCenter, clock_text(tick))

    def _draw_beside(self, painter: QPainter, bar: QRectF) -> None:
        """Through the bar, with a smaller mark: what happened in the second recording."""
        for flag in self._beside:
            if not self.is_within(flag):
                continue
            mark, x, side = FLAGS[flag.kind], self._x(flag.at_ns), float(self._theme.px(8))
            colour = self._theme.colour(mark.colour)
            painter.setPen(QPen(colour, 1, Qt.PenStyle.DashLine))
            painter.drawLine(QPointF(x, bar.top()), QPointF(x, bar.bottom()))
            draw(painter, mark, colour, QRectF(x - side / 2, bar.top() - side - 1, side, side))

    def is_within(self, flag: Flag) -> bool:
        """Return whether it happened in the recording: before and after it, the bar has no place for it."""
        return self._tape is not None and self._tape.first_ns <= flag.at_ns <= self._tape.last_ns

    def _draw_flags(self, painter: QPainter, bar: QRectF) -> None:
        """As in the plots: where several have no room, the worst."""
        side = float(self._theme.px(11))
        for x, kind in told(
            [(self._x(flag.at_ns), flag.kind) for flag in filter(self.is_within, self._flags)], side
        ):
            mark, box = FLAGS[kind], QRectF(x - side / 2, bar.top() - side - 1, side, side)
            draw(painter, mark, self._theme.colour(mark.colour), box)

    # --- where an instant is

    def _flag_at(self, place: QPointF) -> Flag | None:
        """Return the flag at this place, which is pointed at above the bar."""
        if place.y() > self._bar().top():
            return None
        near = self._theme.px(7)
        flags = [*filter(self.is_within, self._flags), *filter(self.is_within, self._beside)]
        pointed = [flag for flag in flags if abs(self._x(flag.at_ns) - place.x()) <= near]
        return min(pointed, key=lambda flag: FIRST.index(flag.kind), default=None)  # as it is drawn

    def _since(self, flag: Flag) -> str:
        return clock_text(self._since_s(flag.at_ns), 1)

    def _bar(self) -> QRectF:
        px = self._theme.px
        return QRectF(px(16), px(13), max(self.width() - px(32), 1), px(self._bar_px))

    def _x(self, instant_ns: int) -> float:
        if self._tape is None:
            return 0.0
        bar, length = self._bar(), max(self._tape.last_ns - self._tape.first_ns, 1)
        return bar.left() + bar.width() * min(max((instant_ns - self._tape.first_ns) / length, 0.0), 1.0)

    def _instant(self, x: float) -> int:
        if self._tape is None:
            return 0
        bar = self._bar()
        share = min(max((x - bar.left()) / bar.width(), 0.0), 1.0)
        return self._tape.first_ns + round(share * (self._tape.last_ns - self._tape.first_ns))

    def _since_s(self, instant_ns: int) -> float:
        return 0.0 if self._tape is None else (instant_ns - self._tape.first_ns) / SECOND_NS


def clock_text(seconds: float, digits: int = 0) -> str:
    """Since the beginning: m:ss, or h:mm:ss."""
    seconds = round(seconds, digits)
    whole = int(seconds)
    part = "" if not digits else f"{seconds - whole:.{digits}f}"[1:]
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}{part}" if hours else f"{minutes}:{whole % 60:02}{part}"


def day_text(instant_ns: int) -> str:
    """Return day and time by the local clock."""
    return f"{datetime.fromtimestamp(instant_ns / 1e9, UTC).astimezone():%Y-%m-%d %H:%M:%S}"
