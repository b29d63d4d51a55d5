"""The titles of a table that is sorted by them, by mouse or by keys; the arrow points to where more is."""

from PySide6.QtCore import QPointF, QRect, QSize, Qt
from PySide6.QtGui import QFocusEvent, QKeyEvent, QPainter, QPolygonF
from PySide6.QtWidgets import QHeaderView, QWidget

ARROW = 9  # pixels wide, with the room around it


class SortHeader(QHeaderView):
    """Tab leads here from the table: ← → chooses a title, Return or Space sorts by it, or the other way.

    Qt's own arrow points down where the rows go up. Lowest first is ▲ here, highest first ▼.
    """

    def __init__(self, table: QWidget) -> None:
        super().__init__(Qt.Orientation.Horizontal, table)
        self._at = 0  # the title that the keys have chosen
        self.setSectionsClickable(True)
        self.setHighlightSections(False)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._name()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        match Qt.Key(event.key()):
            case Qt.Key.Key_Left:
                self._step(-1)
            case Qt.Key.Key_Right:
                self._step(1)
            case Qt.Key.Key_Return | Qt.Key.Key_Enter | Qt.Key.Key_Space if not event.modifiers():
                self._sort()
            case _:
                event.ignore()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self._step(0)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.viewport().update()

    def sectionSizeFromContents(self, section: int) -> QSize:
        size = super().sectionSizeFromContents(section)
        return QSize(size.width() + ARROW, size.height())

    def paintSection(self, painter: QPainter, rect: QRect, section: int) -> None:
        painter.save()
        super().paintSection(painter, rect, section)
        painter.restore()
        painter.save()
        if section == self.sortIndicatorSection():
            self._draw_arrow(painter, rect)
        if self.hasFocus() and section == self._at:
            painter.setPen(self.palette().highlight().color())
            painter.drawRect(rect.adjusted(1, 1, -2, -2))
        painter.restore()

    def _draw_arrow(self, painter: QPainter, rect: QRect) -> None:
        half, middle = ARROW / 3, rect.center().y() + 0.5
        right = rect.right() - 3
        up = self.sortIndicatorOrder() is Qt.SortOrder.AscendingOrder
        base, tip = (middle + half / 2, middle - half) if up else (middle - half / 2, middle + half)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self.palette().text())
        points = ((right - 2 * half, base), (right, base), (right - half, tip))
        painter.drawPolygon(QPolygonF([QPointF(*point) for point in points]))

    def _step(self, by: int) -> None:
        shown = [section for section in range(self.count()) if not self.isSectionHidden(section)]
        if not shown:
            return
        place = shown.index(self._at) if self._at in shown else 0
        self._at = shown[min(max(place + by, 0), len(shown) - 1)]
        self._name()
        self.viewport().update()

    def _sort(self) -> None:
        """As a click would: the other way round where it is sorted by this title already."""
        model = self.model()
        order = model.headerData(self._at, Qt.Orientation.Horizontal, Qt.ItemDataRole.InitialSortOrderRole)
        wanted = Qt.SortOrder.AscendingOrder if order is None else Qt.SortOrder(order)
        if self._at == self.sortIndicatorSection():
            down = self.sortIndicatorOrder() is Qt.SortOrder.AscendingOrder
            wanted = Qt.SortOrder.DescendingOrder if down else Qt.SortOrder.AscendingOrder
        self.setSortIndicator(self._at, wanted)
        self._name()

    def _name(self) -> None:
        """Name it for who hears it read."""
        order, title = "", ""
        if self.count():
            title = str(self.model().headerData(self._at, Qt.Orientation.Horizontal) or "")
        if self._at == self.sortIndicatorSection():
            up = self.sortIndicatorOrder() is Qt.SortOrder.AscendingOrder
            order = ", lowest first" if up else ", highest first"
        self.setAccessibleName(f"Titles: sort by {title}{order}" if title else "Titles")
