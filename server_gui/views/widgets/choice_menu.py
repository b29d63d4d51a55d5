"""A menu of texts of which one is chosen."""

from collections.abc import Callable

from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu


def choices(menu: QMenu, texts: list[str], chosen: str, choose: Callable[[str], None]) -> None:
    """Offer these texts, of which one is chosen; `choose` is told another."""
    group = QActionGroup(menu)
    for text in texts:
        action: QAction = menu.addAction(text)
        action.setCheckable(True)
        action.setChecked(text == chosen)
        group.addAction(action)
    group.triggered.connect(lambda action: choose(action.text()))
