"""Curves that are dragged, and what they can be dropped on."""

import json
from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QMimeData, Signal
from PySide6.QtGui import QDragEnterEvent, QDropEvent

from server_gui.core.workspace.workspace import MOST_CURVES
from server_gui.views.widgets.card import Card

CURVES: Final = "application/x-gwrms-curves"


def dragged(texts: Sequence[str]) -> QMimeData:
    """Return the data of a drag of these curves."""
    data = QMimeData()
    data.setData(CURVES, json.dumps(list(texts)).encode())
    data.setText("\n".join(texts))
    return data


def dropped(data: QMimeData) -> list[str]:
    """Return the curves that were dragged; none where it is anything else, of another program too."""
    try:
        found = json.loads(bytes(data.data(CURVES).data()))
    except ValueError:
        return []
    texts = [text for text in found if isinstance(text, str)] if isinstance(found, list) else []
    return texts[:MOST_CURVES]


class TakesCurves(Card):
    """A plot that curves may be dropped on: `taken` brings their texts."""

    taken = Signal(list)

    def __init__(self, title: str) -> None:
        super().__init__(title)
        self.setAcceptDrops(True)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped(event.mimeData()):
            self._select(on=True)
            event.acceptProposedAction()

    def dragLeaveEvent(self, event: object) -> None:
        self._select(on=False)

    def dropEvent(self, event: QDropEvent) -> None:
        self._select(on=False)
        event.acceptProposedAction()
        self.taken.emit(dropped(event.mimeData()))

    def _select(self, *, on: bool) -> None:
        if self.property("selected") != on:
            self.setProperty("selected", on)
            self.style().polish(self)
