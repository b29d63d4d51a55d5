"""A label with as many lines as its text needs: none of it is ever cut."""

from typing import Final

from PySide6.QtCore import QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QLabel

from server_gui.views.widgets.plain import PlainLabel

LEAST: Final = 8  # letters


class WrappingHeight(QLabel):
    """Its height follows its width also within nested layouts, which forget a label's own rule for that."""

    def wrap(self) -> None:
        """Have lines from now on, as many as are needed."""
        self.setWordWrap(True)
        policy = self.sizePolicy()
        policy.setHeightForWidth(False)
        self.setSizePolicy(policy)

    def hasHeightForWidth(self) -> bool:
        return False

    def sizeHint(self) -> QSize:
        return QSize(super().sizeHint().width(), self._height)

    def minimumSizeHint(self) -> QSize:
        return QSize(1, self._height)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if event.size().width() != event.oldSize().width():
            self.updateGeometry()

    @property
    def _height(self) -> int:
        if self.width() < self.fontMetrics().averageCharWidth() * LEAST:  # it has no place yet
            return self.fontMetrics().height()
        return max(super().heightForWidth(self.width()), 0)


class WrappingLabel(WrappingHeight, PlainLabel):
    """Label of plain text that wraps."""

    def __init__(self, name: str = "") -> None:
        super().__init__()
        self.setObjectName(name)
        self.wrap()
