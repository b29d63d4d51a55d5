"""A framed piece of the window: a title, a note at the right, and a body."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.shrinking_label import ShrinkingLabel


class Card(QFrame):
    """Put widgets into `body`; into `head`, between title and note, what needs a line."""

    def __init__(self, title: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("card")
        self.setAccessibleName(title)
        self._title = ElidedLabel("title")
        self._title.setText(title)
        self._title.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Preferred)
        self._title.setMinimumWidth(1)
        self._note = ShrinkingLabel("note")
        self._note.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.head = QHBoxLayout()
        self.head.addWidget(self._title)
        self.head.addWidget(self._note, 1)
        self.body = QVBoxLayout()
        self.body.setContentsMargins(0, 0, 0, 0)
        self.body.setSpacing(4)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(10, 5, 10, 6)
        everything.setSpacing(4)
        everything.addLayout(self.head)
        everything.addLayout(self.body, 1)

    def set_title(self, title: str, *, whole: bool = False) -> None:
        """Set the title; one with numbers is never cut, and so is to be `whole`."""
        set_text(self._title, title)
        self._title.setMinimumWidth(self._title.sizeHint().width() if whole else 1)

    @property
    def note(self) -> str:
        return self._note.text()

    @property
    def note_label(self) -> ShrinkingLabel:
        return self._note

    def set_note(self, *wordings: str) -> None:
        """Set the note at the right of the title: what is said in full, and where there is less room."""
        self._note.say(*wordings)


def set_text(label: QLabel, text: str) -> None:
    """Change a label only where it says something else: that is cheaper than to draw it again."""
    if label.text() != text:
        label.setText(text)


def set_primary(button: QWidget, on: bool) -> None:
    """Make a button the one that is meant, or one of several, only where it is another."""
    name = "primary" if on else ""
    if button.objectName() != name:
        button.setObjectName(name)
        button.style().polish(button)


def set_tone(label: QWidget, tone: str) -> None:
    """Change the colour of a label or a frame, by its name in the style sheet, only where it is another."""
    if label.property("tone") != tone:
        label.setProperty("tone", tone)
        label.style().polish(label)
