"""A question that must be answered before something is done; never in the way of STOP."""

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from server_gui.views.widgets.plain import PlainLabel

WIDTH = 420


class Question(QDialog):
    """Never modal: a window behind a modal one takes no click on STOP. Return cancels."""

    def __init__(self, parent: QWidget, title: str, text: str, action: str, do: Callable[[], None]) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.setModal(False)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.words = PlainLabel(text)
        self.words.setWordWrap(True)
        self.words.setMinimumWidth(WIDTH)
        self.cancel, self.act = QPushButton("Cancel"), QPushButton(action)
        self.act.setAutoDefault(False)
        self.cancel.setDefault(True)
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
        column.addLayout(buttons)
        self.cancel.setFocus()


def ask(parent: QWidget, title: str, text: str, action: str, do: Callable[[], None]) -> Question:
    """Show a question; `do` is called when `action` is chosen. One of a title at a time."""
    for known in parent.findChildren(Question):
        if known.windowTitle() == title and known.isVisible():
            known.raise_()
            return known
    question = Question(parent, title, text, action, do)
    question.show()
    return question
