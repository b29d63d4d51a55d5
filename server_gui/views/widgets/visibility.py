"""Visibility and keyboard focus of a widget."""

from PySide6.QtWidgets import QApplication, QWidget


def has_focus_in(panel: QWidget) -> bool:
    """Return whether the keyboard is in it."""
    focused = QApplication.focusWidget()
    return focused is not None and panel.isAncestorOf(focused)


def is_seen(widget: QWidget) -> bool:
    """Return whether any of it is on the screen: not behind another panel, and not scrolled away."""
    return widget.isVisible() and not widget.visibleRegion().isEmpty()
