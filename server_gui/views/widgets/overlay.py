"""An overlay on a part of the window, opened and closed by the user: it moves nothing."""

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QFrame, QPushButton, QScrollArea, QVBoxLayout, QWidget

from server_gui.views.theme import Theme

AROUND = 8  # pixels between it and the edges of what is below


class Overlay(QFrame):
    """Shows `words`, scrolled where they have no room; over `below`, at most `widest` at text of 100 %."""

    def __init__(self, name: str, words: QWidget, theme: Theme, below: QWidget, widest: int) -> None:
        super().__init__(below)
        self._theme = theme
        self._below = below
        self._widest = widest
        self.setObjectName("card")
        self.setAccessibleName(name)
        words.setObjectName("page")
        scrolled = self._scrolled = QScrollArea()
        scrolled.setWidgetResizable(True)
        scrolled.setAccessibleName(name)
        self.close_button = QPushButton("Close")
        self.close_button.clicked.connect(self.turn)
        everything = QVBoxLayout(self)
        everything.addWidget(scrolled, 1)
        scrolled.setWidget(words)  # at its place: Qt styles all of it anew wherever it is put into another
        everything.addWidget(self.close_button, 0, Qt.AlignmentFlag.AlignRight)
        away = QShortcut(QKeySequence(Qt.Key.Key_Escape), self, self.turn)
        away.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
        below.installEventFilter(self)
        theme.scaled.connect(self._fit)
        self.hide()

    @property
    def room(self) -> int:
        """How wide the words may be (pixels) without being scrolled aside."""
        return self._scrolled.viewport().width()

    def turn(self) -> None:
        """Show it, or put it away."""
        self.setVisible(self.isHidden())
        if self.isVisible():
            self._fit()
            self.raise_()
            self.close_button.setFocus()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and self.isVisible():
            self._fit()
        return False

    def _fit(self) -> None:
        room = self._below.rect().adjusted(AROUND, AROUND, -AROUND, -AROUND)
        width = min(room.width(), self._theme.px(self._widest))
        high = min(self.high(width), room.height())
        self.setGeometry(room.x() + (room.width() - width) // 2, room.y(), width, high)

    def high(self, width: int) -> int:
        """Return its height at that width, if there is so much room: all of it, unless it needs less."""
        return self._below.height()
