"""The STOP button: acts when it is pressed, not when it is let go, and names the robot that it stops."""

from typing import Final

from PySide6.QtCore import QRect, QSize, Qt, Signal
from PySide6.QtGui import QFont, QFontMetrics, QKeyEvent, QPaintEvent, QPalette
from PySide6.QtWidgets import (
    QApplication,
    QPushButton,
    QStyle,
    QStyleOptionButton,
    QStylePainter,
    QWidget,
)

from gateway.plain_text import plain

HINT = (
    "Quick stop on every drive (F12 or Ctrl+Space). It is software over a network, NOT a safety-rated "
    "emergency stop: keep the hardware one within reach."
)
MIDDLE: Final = Qt.TextElideMode.ElideMiddle
AROUND = 34  # pixels of frame and padding at both sides, at most
LEAST_AROUND: Final = 8


class StopButton(QPushButton):
    """`stopped` is emitted the moment that it is pressed, by mouse or keyboard."""

    stopped = Signal()

    def __init__(self, name: str = "stop", parent: QWidget | None = None) -> None:
        super().__init__("STOP", parent)
        self.most: int | None = None  # wide; None: as the layout has it
        self._robot: str | None = None
        self._is_light = False
        self.setObjectName(name)
        self.setToolTip(HINT)
        self.setAccessibleDescription(HINT)
        self.setAutoDefault(False)
        self.pressed.connect(self.stopped)

    def name(self, robot: str | None) -> None:
        """Set the name of the robot, in smaller letters or two lines if there is no room for it in one."""
        self._robot = None if robot is None else plain(robot)
        self.setAccessibleName("STOP" if robot is None else f"STOP {plain(robot)}")
        text = "STOP" if robot is None else f"STOP  {plain(robot)}"
        if self.text() != text:
            self.setText(text)
            self.updateGeometry()

    def allow(self, most: int) -> None:
        """Let it be as wide as its name needs, up to so many pixels."""
        if most != self.most:
            self.most = most
            self.updateGeometry()

    def be_light(self, is_light: bool) -> None:
        """Have the name in light letters, as those beside it that have no room for others."""
        if is_light is not self._is_light:
            self._is_light = is_light
            self.update()

    @property
    def has_room_in_bold(self) -> bool:
        """Whether all of the name has room in one line of bold letters."""
        small = QFont(QApplication.font())
        small.setBold(True)
        room = self.width() - self._around - self._word - self._gap
        return self._robot is None or QFontMetrics(small).horizontalAdvance(self._robot) <= room

    @property
    def lines(self) -> list[str]:
        """The name as it is drawn; where even two lines have no room, each is cut in its middle."""
        return self._lines[0]

    @property
    def is_whole(self) -> bool:
        """Whether the word STOP and all of the name have room."""
        return "…" not in "".join(self.lines) and self.width() >= self.sizeHint().width()

    def minimumSizeHint(self) -> QSize:
        """Size of the word alone: a long name makes nothing wider."""
        whole = super().sizeHint()
        return QSize(min(whole.width(), self._word + self._around), whole.height())

    def sizeHint(self) -> QSize:
        """As wide as it may be where that is said, else as little as it needs: layouts stretch it."""
        if self.most is None or self._robot is None:
            return self.minimumSizeHint()
        lines, font = self._lines
        wide = max(QFontMetrics(font).horizontalAdvance(line) for line in lines)
        return QSize(self._word + self._gap + wide + self._around, super().sizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        option = QStyleOptionButton()
        self.initStyleOption(option)
        option.text = ""
        painter = QStylePainter(self)
        painter.drawControl(QStyle.ControlElement.CE_PushButton, option)
        painter.setPen(self.palette().color(QPalette.ColorRole.ButtonText))
        lines, font = self._lines
        metrics = QFontMetrics(font)
        wide = max((metrics.horizontalAdvance(line) for line in lines), default=-self._gap)
        left = (self.width() - self._word - self._gap - wide) // 2
        middle = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft
        painter.setFont(self.font())
        painter.drawText(QRect(left, 0, self._word + 1, self.height()), middle, "STOP")
        painter.setFont(font)
        high, left = metrics.lineSpacing(), left + self._word + self._gap
        top = (self.height() - high * len(lines)) // 2
        for place, line in enumerate(lines):
            painter.drawText(QRect(left, top + place * high, wide + 1, high), middle, line)
        painter.end()

    @property
    def _word(self) -> int:
        return QFontMetrics(self.font()).horizontalAdvance("STOP")

    @property
    def _around(self) -> int:
        """Pixels of frame and padding at both sides, as the style has it."""
        text = self.fontMetrics().horizontalAdvance(self.text())
        return min(max(super().sizeHint().width() - text, LEAST_AROUND), AROUND)

    @property
    def _gap(self) -> int:
        return QFontMetrics(self.font()).horizontalAdvance("  ")

    @property
    def _lines(self) -> tuple[list[str], QFont]:
        """In large letters if that has room, else in those of other text, in one line or two."""
        large, small, light = self.font(), QFont(QApplication.font()), QApplication.font()
        small.setBold(True)
        light.setBold(False)  # said, since a painter takes what a font leaves open from its widget
        if self._robot is None:
            return [], large
        room = (self.width() if self.most is None else self.most) - self._around - self._word - self._gap
        two = _in_two(self._robot)
        one = [self._robot]
        forms = [(one, large), (one, small), (one, light), (two, small), (two, light)]
        if super().sizeHint().height() < 2 * QFontMetrics(small).lineSpacing():
            forms, two = forms[:3], one
        if self._is_light:
            forms = [(lines, font) for lines, font in forms if not font.bold()]
        for lines, font in forms:
            if all(QFontMetrics(font).horizontalAdvance(line) <= room for line in lines):
                return lines, font
        return [QFontMetrics(light).elidedText(line, MIDDLE, max(room, 0)) for line in two], light

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Return presses it too."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat():
            self.stopped.emit()
        else:
            super().keyPressEvent(event)


def _in_two(name: str) -> list[str]:
    """Return a name, and where that is said, its address below; else halves."""
    first, at, address = name.partition(" at ")
    half = -(-len(name) // 2)
    return [first, address] if at else [name[:half], name[half:]]
