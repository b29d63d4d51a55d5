"""Splash screen until the window is there: the finished and the present step.

It imports nothing but Qt and the theme, so that it is there before the rest of the window is.
"""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication, QFrame, QGridLayout, QVBoxLayout

from server_gui.core.desk.first_steps import FirstSteps
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import PlainLabel

DONE, NOW, LATER = "✓", "▸", "·"
COLOURS: Final = {DONE: "good", NOW: "accent", LATER: "dim"}
WIDTH: Final = 400


class Splash(QFrame):
    """Takes no keyboard and stands in the way of nothing: a click closes it."""

    def __init__(self, steps: FirstSteps, theme: Theme) -> None:
        super().__init__(None, Qt.WindowType.SplashScreen | Qt.WindowType.FramelessWindowHint)
        self._steps = steps
        self._theme = theme
        self._shown: object = None
        self.setObjectName("card")
        self.setWindowTitle("GWRMS is starting")
        self.setAccessibleName("GWRMS is starting")
        self.setAttribute(Qt.WidgetAttribute.WA_ShowWithoutActivating)
        title, below = PlainLabel("GWRMS"), PlainLabel("A simulated exoskeleton starts on this computer")
        title.setStyleSheet(f"color: {theme.colour('accent').name()};")  # no margin: in line with the rest
        title.setFont(theme.text_font(1.6, bold=True))
        below.setObjectName("dim")
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        self._marks, self._words = [], []
        for row, step in enumerate(steps.steps):
            mark, words = PlainLabel(LATER), PlainLabel(step.value)
            self._marks.append(mark)
            self._words.append(words)
            grid.addWidget(mark, row, 0)
            grid.addWidget(words, row, 1)
        self._said = PlainLabel("This closes by itself; a click closes it now")
        self._said.setObjectName("dim")
        self._said.setWordWrap(True)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(22, 18, 22, 18)
        everything.setSpacing(10)
        for part in (title, below):
            everything.addWidget(part)
        everything.addLayout(grid)
        everything.addWidget(self._said)
        self.setFixedWidth(theme.px(WIDTH))
        self.refresh()
        self._centre()

    @property
    def texts(self) -> tuple[str, ...]:
        """Each step as it is shown."""
        pairs = zip(self._marks, self._words, strict=True)
        return tuple(f"{mark.text()} {words.text()}" for mark, words in pairs)

    def refresh(self) -> None:
        """Show how far it is, and draw that at once: what follows may take the thread for a second."""
        if self._shown == (now := dict(self._steps.took_s)):
            return
        self._shown = now
        for place, step in enumerate(self._steps.steps):
            took_s = now.get(step)
            sign = DONE if took_s is not None else NOW if step is self._steps.now else LATER
            self._marks[place].setText(sign)
            self._marks[place].setStyleSheet(f"color: {self._theme.colour(COLOURS[sign]).name()};")
            self._words[place].setText(step.value + ("" if took_s is None else f" · {took_s:.1f} s"))
        if self.isVisible():
            self.repaint()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.close()

    def _centre(self) -> None:
        self.adjustSize()
        room = QApplication.primaryScreen().availableGeometry()
        self.move(room.center() - self.rect().center())
