"""A confirmation before something is done; never in the way of STOP."""

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from server_gui.views.widgets.plain import PlainLabel

WIDTH = 420


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
        self.words.setMinimumWidth(WIDTH)
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
        (field or self.cancel).setFocus()

    def add(self, field: QLineEdit) -> None:
        """Add another field, above the buttons."""
        self._column.insertWidget(self._column.count() - 1, field)
        QWidget.setTabOrder(self.field or self.words, field)


def ask(
    parent: QWidget,
    title: str,
    text: str,
    action: str,
    do: Callable[[], None],
    field: QLineEdit | None = None,
) -> Question:
    """Show a question; `do` is called when `action` is chosen. One of a title at a time."""
    for known in parent.findChildren(Question):
        if known.windowTitle() == title and known.isVisible():
            known.raise_()
            return known
    question = Question(parent, title, text, action, do, field)
    question.show()
    return question
