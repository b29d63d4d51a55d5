"""A view that is scrolled where the screen is small or the text large, rather than the window made larger."""

from PySide6.QtCore import QEvent, QObject, QPoint, Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QComboBox, QScrollArea, QWidget


class ScrollArea(QScrollArea):
    """Has no focus of its own. Words that need more lines where they are narrow get them, also later ones.

    The wheel scrolls: what it would change under the pointer unseen, a choice or a number, it changes only
    where that has the focus.
    """

    def __init__(self, view: QWidget | None = None) -> None:
        super().__init__()
        self._has_grown = False
        self._is_fitting = False
        self.setWidgetResizable(True)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        if view is not None:
            self.setWidget(view)

    def setWidget(self, widget: QWidget) -> None:
        super().setWidget(widget)
        for field in (*widget.findChildren(QComboBox), *widget.findChildren(QAbstractSpinBox)):
            field.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
            field.installEventFilter(self)

    def show_part(self, part: QWidget, *, first: bool = False) -> None:
        """Scroll to a part that has just come, once it has its place; `first`: to its top."""
        view = self.widget()
        layout = None if view is None else view.layout()
        if view is None or layout is None:
            return
        layout.activate()
        self._grow()
        QApplication.sendPostedEvents(view, QEvent.Type.LayoutRequest.value)
        if first:
            self.verticalScrollBar().setValue(part.mapTo(view, QPoint(0, 0)).y())
        else:
            self.ensureWidgetVisible(part, 0, 0)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Wheel and isinstance(watched, QComboBox | QAbstractSpinBox):
            if not watched.hasFocus():
                event.ignore()  # it goes to whoever is behind
                return True
            return False
        if watched is self.widget():
            if event.type() == QEvent.Type.LayoutRequest:
                self._grow()
            elif event.type() == QEvent.Type.Resize:
                return self._fit(watched, event)
        return super().eventFilter(watched, event)

    def _fit(self, view: QWidget, event: QEvent) -> bool:
        """Let Qt show or hide the scroll bar once for each size of the view.

        That resizes the view again, which says by then what it needs at the size before: where it needs more
        at one of the two, Qt went on for ever. What it needs at the new size it says by a layout request.
        """
        if self._is_fitting:
            return False
        self._is_fitting = True
        try:
            return super().eventFilter(view, event)
        finally:
            self._is_fitting = False

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


def bring_into_sight(part: QWidget, *, first: bool = False) -> None:
    """Scroll to a part that has just been shown, where its page is scrolled at all."""

    def show() -> None:
        parent = part.parentWidget()
        while parent is not None and not isinstance(parent, ScrollArea):
            parent = parent.parentWidget()
        if parent is not None and part.isVisible():
            parent.show_part(part, first=first)

    QTimer.singleShot(0, part, show)  # once layouts have noticed it
