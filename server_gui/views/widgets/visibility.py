"""Visibility and keyboard focus of a widget."""

from PySide6.QtWidgets import QApplication, QDockWidget, QWidget


def has_focus_in(panel: QWidget) -> bool:
    """Return whether the keyboard is in it."""
    focused = QApplication.focusWidget()
    return focused is not None and panel.isAncestorOf(focused)


def is_seen(widget: QWidget) -> bool:
    """Return whether any of it is on the screen: not behind another panel, and not scrolled away.

    What floats never counts: Qt does not know whether another window or the screen's edge hides it.
    """
    floats = isinstance(widget.window(), QDockWidget)
    return widget.isVisible() and not floats and not widget.visibleRegion().isEmpty()


def is_all_seen(widget: QWidget) -> bool:
    """Return whether all of it is on the screen, likewise."""
    return is_seen(widget) and widget.visibleRegion().boundingRect() == widget.rect()


def let_go(widget: QWidget) -> None:
    """Have the keyboard nowhere where it is in this, which goes: else Qt gives it to what is next to it."""
    focused = QApplication.focusWidget()
    if focused is not None and (focused is widget or widget.isAncestorOf(focused)):
        focused.clearFocus()
