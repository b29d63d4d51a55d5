"""A view that is scrolled where the screen is small or the text large, rather than the window made larger."""

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QScrollArea, QWidget


class Scrolled(QScrollArea):
    """Has no focus of its own. Words that need more lines where they are narrow get them, also later ones."""

    def __init__(self, view: QWidget | None = None) -> None:
        super().__init__()
        self._has_grown = False
        self.setWidgetResizable(True)
        if view is not None:
            self.setWidget(view)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest and watched is self.widget():
            self._grow()
        return super().eventFilter(watched, event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._grow()

    def _grow(self) -> None:
        view = self.widget()
        layout = None if view is None else view.layout()
        if view is not None and layout is not None and layout.hasHeightForWidth():
            width = max(self.viewport().width(), layout.totalMinimumSize().width())
            self._has_grown = True
            view.setMinimumHeight(layout.totalMinimumHeightForWidth(width))
        elif view is not None and self._has_grown:  # what it needs is known without its width by now
            self._has_grown = False
            view.setMinimumHeight(0)
