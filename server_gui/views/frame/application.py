"""The one Qt application of this process, and the theme as it was kept from the last time."""

import sys

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication

from server_gui.views.frame.saved_state import kept_look, kept_scale
from server_gui.views.theme import Look, Theme


def application() -> QApplication:
    """Return the application, which is made where there is none yet."""
    made = QApplication.instance()
    if not isinstance(made, QApplication):
        made = QApplication(sys.argv[:1])
        made.setApplicationName("gwrms")
        made.setStyle("Fusion")
    return made


def kept_settings() -> QSettings:
    """Return the window's persistent settings."""
    return QSettings("gwrms", "gui")


def kept_theme(
    qt: QApplication, kept: QSettings, look: Look | None = None, scale: float | None = None
) -> Theme:
    """Return the look and the size of text that are asked for, or else were chosen last."""
    return Theme(qt, look or kept_look(kept), kept_scale(kept) if scale is None else scale)
