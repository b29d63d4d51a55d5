"""A framed piece of the window: a title, a note at the right, and a body."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.plain import PlainLabel


class Card(QFrame):
    """Put widgets into `body`."""

    def __init__(self, title: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("card")
        self.setAccessibleName(title)
        self._title = PlainLabel(title)
        self._title.setObjectName("title")
        self._note = ElidedLabel("note")
        self._note.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        head = QHBoxLayout()
        head.addWidget(self._title)
        head.addWidget(self._note, 1)
        self.body = QVBoxLayout()
        self.body.setContentsMargins(0, 0, 0, 0)
        self.body.setSpacing(4)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(10, 7, 10, 8)
        everything.setSpacing(4)
        everything.addLayout(head)
        everything.addLayout(self.body, 1)

    def set_title(self, title: str) -> None:
        set_text(self._title, title)

    @property
    def note(self) -> str:
        return self._note.text()

    def set_note(self, text: str) -> None:
        """Set the note at the right of the title."""
        set_text(self._note, text)


def set_text(label: QLabel, text: str) -> None:
    """Change a label only where it says something else: that is cheaper than to draw it again."""
    if label.text() != text:
        label.setText(text)
