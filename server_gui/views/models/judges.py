"""Wearers with labels, and which of them a training is judged by: a row each, with a box to check."""

from typing import Final

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QTreeWidget, QTreeWidgetItem

from gateway.plain_text import plain
from server_gui.core.models.lessons import Lesson, Lessons
from server_gui.views.theme import Theme
from server_gui.views.widgets import columns
from server_gui.views.widgets.elided import WrappingDelegate
from server_gui.views.widgets.plain import tip

TITLES: Final = ("Judged by", "Sessions", "Labelled")
NAME, SESSIONS, LABELLED = range(len(TITLES))
MOST: Final = 6  # rows that it has room for; more are scrolled
AROUND: Final = 6  # pixels beside and around its text, at text of 100 %
WRAPPED: Final = Qt.TextFlag.TextWordWrap.value
NAMELESS: Final = "A session that does not say whose it is; gwrms label SESSION --wearer NAME does"


class Judges(QTreeWidget):
    """What is checked stays so while the wearer is listed."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._shown: tuple[Lesson, ...] | None = None
        self.setHeaderLabels(TITLES)
        self.setRootIsDecorated(False)
        self._lines = WrappingDelegate(LABELLED)
        self.setItemDelegate(self._lines)
        columns.prepare(self)
        self.itemClicked.connect(self._turn)
        self.itemActivated.connect(self._turn)
        self.show_lessons(Lessons())

    @property
    def chosen(self) -> tuple[str, ...]:
        """The wearers that are checked, or sessions without one's name."""
        return tuple(item.text(NAME) for item in self._items() if _is_checked(item))

    def show_lessons(self, lessons: Lessons) -> bool:
        """Show a row for each wearer; return whether they are others than before."""
        if lessons.each == self._shown:
            return False
        checked = set(self.chosen)
        self._shown = lessons.each
        self.clear()
        for lesson in lessons.each:
            self._add(lesson, checked=lesson.name in checked)
        self._fit()
        return True

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _add(self, lesson: Lesson, *, checked: bool) -> None:
        item = QTreeWidgetItem(self, [plain(lesson.name), str(lesson.sessions), plain(lesson.said)])
        item.setTextAlignment(SESSIONS, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        item.setFont(SESSIONS, self._theme.number_font())
        item.setData(LABELLED, Qt.ItemDataRole.ToolTipRole, tip(lesson.said))
        if not lesson.is_named:
            item.setData(NAME, Qt.ItemDataRole.ToolTipRole, tip(NAMELESS))
        item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsUserCheckable)  # its whole row is what is clicked
        if lesson.why_not:
            item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEnabled)
        else:
            item.setCheckState(NAME, Qt.CheckState.Checked if checked else Qt.CheckState.Unchecked)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        item = self.currentItem()
        if event.key() == Qt.Key.Key_Space and item is not None:
            self._turn(item)
        else:
            super().keyPressEvent(event)

    def _turn(self, item: QTreeWidgetItem) -> None:
        if item.flags() & Qt.ItemFlag.ItemIsEnabled:
            item.setCheckState(NAME, Qt.CheckState.Unchecked if _is_checked(item) else Qt.CheckState.Checked)

    def _items(self) -> list[QTreeWidgetItem]:
        found = (self.topLevelItem(place) for place in range(self.topLevelItemCount()))
        return [item for item in found if item is not None]

    def _fit(self) -> None:
        """Share its width, names whole before all; what is labelled has the lines that it needs."""
        columns.fit(self, {LABELLED: self._theme.px(120)})
        around = self._theme.px(AROUND)
        box = QRect(0, 0, max(self.columnWidth(LABELLED) - 2 * around, 1), 100_000)
        for item in self._items():
            said = self.fontMetrics().boundingRect(box, WRAPPED, item.text(LABELLED)).height()
            item.setSizeHint(LABELLED, QSize(0, max(said + around, self._theme.px(20))))
        shown = self._items()[:MOST]
        high = sum(self.rowHeight(self.indexFromItem(item)) for item in shown) or self._theme.px(20)
        self.setFixedHeight(high + 2 * self.frameWidth() + self.header().sizeHint().height())


def _is_checked(item: QTreeWidgetItem) -> bool:
    state = item.data(NAME, Qt.ItemDataRole.CheckStateRole)
    return state is not None and Qt.CheckState(state) is Qt.CheckState.Checked
