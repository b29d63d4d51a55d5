"""A view that is scrolled where the screen is small or the text large, rather than the window made larger."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QScrollArea, QWidget


def scrolled(view: QWidget) -> QScrollArea:
    """The view in an area that has no focus of its own."""
    area = QScrollArea()
    area.setWidgetResizable(True)
    area.setWidget(view)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return area
