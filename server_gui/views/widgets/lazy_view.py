"""A placeholder for a view that is built when it is first shown or asked for."""

from collections.abc import Callable
from functools import cached_property
from typing import Generic, TypeVar

from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from server_gui.views.widgets.scroll_area import ScrollArea

V = TypeVar("V", bound=QWidget)


class LazyView(QWidget, Generic[V]):
    """Its `view` is scrolled, unless it does that itself."""

    def __init__(self, make: Callable[[], V], *, scrolled: bool = True) -> None:
        super().__init__()
        self._make = make
        self._is_scrolled = scrolled
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)

    @cached_property
    def view(self) -> V:
        """The view; made now if it does not exist yet."""
        view = self._make()
        if self._is_scrolled:
            room = ScrollArea()
            self._column.addWidget(room)
            room.setWidget(view)  # at its place: Qt styles all of it anew wherever it is put into another
            room.show()
        else:
            self._column.addWidget(view)
            view.show()
        return view

    @property
    def is_made(self) -> bool:
        """Whether there is something that could need to be told anything."""
        return "view" in self.__dict__

    def setVisible(self, visible: bool) -> None:
        parent = self.parentWidget()
        if visible and parent is not None and parent.isVisible():
            _ = self.view  # before it is laid out
        super().setVisible(visible)

    def showEvent(self, event: QShowEvent) -> None:
        _ = self.view  # where it is shown with what it is within
        super().showEvent(event)
