"""The names of the pages, in as many rows as they need: each is in sight, however narrow the window."""

from PySide6.QtCore import QEvent
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QAbstractButton, QButtonGroup, QPushButton, QTabWidget, QWidget

from server_gui.views.theme import LOOSE, TIGHT


class PageBar(QWidget):
    """In place of the bar that `pages` has itself, which puts some behind arrows; `corner` is beside it."""

    def __init__(self, pages: QTabWidget, corner: QWidget) -> None:
        super().__init__()
        self.setObjectName("dock")
        self.setAccessibleName("Pages")
        pages.tabBar().hide()
        self._group = QButtonGroup(self)
        for place in range(pages.count()):
            button = QPushButton(pages.tabText(place), self)
            button.setObjectName("page_name")
            button.setCheckable(True)
            self._group.addButton(button, place)
        self._corner = corner
        self._is_tight = False
        corner.setParent(self)
        self._group.idClicked.connect(pages.setCurrentIndex)
        pages.currentChanged.connect(self._mark)
        self._mark(pages.currentIndex())

    @property
    def buttons(self) -> list[QAbstractButton]:
        """In the order of the pages."""
        return self._group.buttons()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:  # text has another size, or the corner another button
            self.arrange()
        return super().event(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.arrange()

    def _mark(self, place: int) -> None:
        self._group.button(place).setChecked(True)

    def _tighten(self, room: int) -> None:
        """Put names closer to each other where that saves a row."""
        saved = 2 * (LOOSE - TIGHT) * len(self.buttons)
        wide = sum(button.sizeHint().width() for button in self.buttons)
        loose = wide + saved if self._is_tight else wide
        is_tight = loose - saved <= room < loose
        if is_tight != self._is_tight:
            self._is_tight = is_tight
            for button in self.buttons:
                button.setProperty("tight", is_tight)
                button.style().polish(button)

    def arrange(self) -> None:
        """Arrange from left to right; what has no room beside the corner begins another row."""
        corner = self._corner.sizeHint()
        self._tighten(self.width() - corner.width())
        high = max(corner.height(), *(button.sizeHint().height() for button in self.buttons))
        self._corner.setGeometry(self.width() - corner.width(), 0, corner.width(), high)
        left, row, room = 0, 0, self.width() - corner.width()
        for button in self.buttons:
            wide = button.sizeHint().width()
            if left and left + wide > room:
                left, row, room = 0, row + 1, self.width()
            button.setGeometry(left, row * high, wide, high)
            left += wide
        if self.minimumHeight() != (row + 1) * high or self.maximumHeight() != (row + 1) * high:
            self.setFixedHeight((row + 1) * high)
