"""A confirmation before something is done; never in the way of STOP."""

from collections.abc import Callable, Iterable, Sequence
from typing import Final

from PySide6.QtCore import QPoint, QRect, QSize, Qt, QTimer
from PySide6.QtWidgets import (
    QDialog,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QStatusBar,
    QVBoxLayout,
    QWidget,
)

from server_gui.views.widgets.free_place import KEPT, free_place
from server_gui.views.widgets.plain import PlainLabel
from server_gui.views.widgets.stop_button import StopButton
from server_gui.views.widgets.visibility import is_seen

WIDTHS: Final = (420, 500, 580, 700)  # of its words; the first for which there is room
Watched = Sequence[QWidget]  # what is looked at while a question is answered
LOOK_MS: Final = 100


class Question(QDialog):
    """Never modal: a window behind a modal one takes no click on STOP. Return cancels, but in a `field`."""

    def __init__(
        self,
        parent: QWidget,
        title: str,
        text: str,
        action: str,
        do: Callable[[], None],
        field: QLineEdit | None = None,
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.setModal(False)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.words = PlainLabel(text)
        self.words.setWordWrap(True)
        self.cancel, self.act = QPushButton("Cancel"), QPushButton(action)
        self.act.setAutoDefault(False)
        self.field = field
        (self.cancel if field is None else self.act).setDefault(True)
        self.cancel.clicked.connect(self.reject)
        self.act.clicked.connect(self.accept)
        self.accepted.connect(do)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self.cancel)
        buttons.addWidget(self.act)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 14, 16, 12)
        column.setSpacing(12)
        column.addWidget(self.words)
        if field is not None:
            column.addWidget(field)
        column.addLayout(buttons)
        self._column = column
        self.is_moot: Callable[[], bool] = lambda: False
        (field or self.cancel).setFocus()
        self._before: list[QRect] = []  # where STOPs and their results were at the last look
        self._over = parent.window()
        looks = QTimer(self, interval=LOOK_MS)
        looks.timeout.connect(lambda: self._look(self._over))
        looks.start()

    def add(self, field: QLineEdit) -> None:
        """Add another field, above the buttons; it needs room, which is looked for again."""
        self._column.insertWidget(self._column.count() - 1, field)
        field.show()  # what is not shown yet gets no room
        field.ensurePolished()
        QWidget.setTabOrder(self.field or self.words, field)
        self.keep_in_sight(self._over, ())

    def keep_in_sight(self, window: QWidget, watched: Sequence[Watched]) -> None:
        """Lie over no STOP of the window, and over what is watched as little as can be, the first least."""
        frame = window.frameGeometry().size() - window.size()  # a question has much the same
        room = in_sight(window)
        stops: Watched = window.findChildren(StopButton)
        bars: Watched = window.findChildren(QStatusBar)  # whether it records, and what F12 is
        kept = [list(_seen(widgets)) for widgets in (stops, _results(window), *watched, bars)]
        self._before = kept[0] + kept[1]
        sizes = [self._fit(wide) + frame for wide in WIDTHS]
        place = free_place(sizes, room, kept)
        self._fit(WIDTHS[sizes.index(place.size())])
        self.move(place.topLeft())

    def _look(self, window: QWidget) -> None:
        """Go where it asks what is so no more; else leave what has come to lie under it."""
        if self.is_moot():
            self.reject()
        else:
            self._leave_stops(window)

    def _leave_stops(self, window: QWidget) -> None:
        """Leave a STOP, or the result of one, that has come to lie under it; where none has moved, stay."""
        now, taken = list(_seen([*window.findChildren(StopButton), *_results(window)])), self.frameGeometry()
        before, self._before = self._before, now
        if now != before and any(taken.intersects(one) for one in now):
            self.keep_in_sight(window, ())

    def _fit(self, wide: int) -> QSize:
        """Fit it around words of at least this width, and return its size."""
        self.words.setMinimumSize(wide, self.words.heightForWidth(wide))
        self._column.activate()
        self.adjustSize()
        return self.size()


def ask(
    parent: QWidget,
    title: str,
    text: str,
    action: str,
    do: Callable[[], None],
    field: QLineEdit | None = None,
    watched: Sequence[Watched] = (),
    is_moot: Callable[[], bool] = lambda: False,
) -> Question:
    """Show a question; `do` is called when `action` is chosen. One of a title at a time.

    It leaves every STOP in sight, and what is `watched`, the most important first. It goes once it `is_moot`.
    """
    for known in parent.findChildren(Question):
        if known.windowTitle() == title and known.isVisible():
            known.raise_()
            return known
    question = Question(parent, title, text, action, do, field)
    question.is_moot = is_moot
    question.keep_in_sight(parent.window(), watched)
    question.show()
    return question


def in_sight(window: QWidget) -> QRect:
    """Return what of a window is on its screen."""
    return window.frameGeometry() & window.screen().availableGeometry()


def _results(window: QWidget) -> Watched:
    """Return what says what became of a STOP, also where it is hidden yet."""
    return [one for one in window.findChildren(QWidget) if one.property(KEPT)]


def _seen(widgets: Iterable[QWidget]) -> Iterable[QRect]:
    """Yield what of each is in sight, on the screen."""
    for widget in widgets:
        if is_seen(widget):
            seen = widget.visibleRegion().boundingRect()
            yield seen.translated(widget.mapToGlobal(QPoint(0, 0)))
