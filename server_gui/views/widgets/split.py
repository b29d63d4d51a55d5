"""Two parts with a handle between them: beside each other, or above each other where they are narrow."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QSplitter

from server_gui.views.theme import Theme


class Split(QSplitter):
    """Its parts stand above each other where it is narrower than `narrow` (at text of 100 %)."""

    def __init__(self, theme: Theme, narrow: int) -> None:
        super().__init__()
        self._theme = theme
        self._narrow = narrow

    def resizeEvent(self, event: QResizeEvent) -> None:
        is_narrow = self.width() < self._theme.px(self._narrow)
        self.setOrientation(Qt.Orientation.Vertical if is_narrow else Qt.Orientation.Horizontal)
        super().resizeEvent(event)
