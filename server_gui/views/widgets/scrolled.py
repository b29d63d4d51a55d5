"""A view that is scrolled where the screen is small or the text large, rather than the window made larger."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QScrollArea, QWidget


class Scrolled(QScrollArea):
    """Has no focus of its own. Words that need more lines where they are narrow get them."""

    def __init__(self, view: QWidget) -> None:
        super().__init__()
        self._view = view
        self.setWidgetResizable(True)
        self.setWidget(view)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        layout = self._view.layout()
        if layout is not None and layout.hasHeightForWidth():
            width = max(self.viewport().width(), layout.totalMinimumSize().width())
            self._view.setMinimumHeight(layout.totalMinimumHeightForWidth(width))
