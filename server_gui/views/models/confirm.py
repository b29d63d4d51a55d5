"""Confirmation of a promotion or rollback, with its effect; it blocks nothing."""

from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QPushButton

from server_gui.core.models.changes import ModelChange
from server_gui.core.models.models import Models
from server_gui.views.widgets.card import Card, set_primary, set_text, set_tone
from server_gui.views.widgets.plain import PlainLabel
from server_gui.views.widgets.scroll_area import bring_into_sight


class Confirm(Card):
    """Hidden while there is nothing to be confirmed."""

    def __init__(self, models: Models) -> None:
        super().__init__("")
        self._models = models
        self._shown: ModelChange | None = None
        self.words = PlainLabel()
        self.words.setWordWrap(True)
        self.warning = PlainLabel()
        self.warning.setWordWrap(True)
        self.warning.setObjectName("dim")
        set_tone(self.warning, "warn")
        self.why = QLineEdit()
        self.why.setPlaceholderText("Why: kept in the history")
        self.why.setAccessibleName("Why this is changed")
        self.yes, self.no = QPushButton(), QPushButton("Change nothing")
        self.yes.clicked.connect(lambda: self._models.confirm(self.why.text().strip()))
        self.no.clicked.connect(models.forget)
        row = QHBoxLayout()
        row.addWidget(self.why, 1)
        row.addWidget(self.no)
        row.addWidget(self.yes)
        self.body.addWidget(self.warning)
        self.body.addWidget(self.words)
        self.body.addLayout(row)
        self.hide()

    def refresh(self) -> None:
        """Show what waits to be confirmed."""
        change = self._models.change
        if change is self._shown:
            return
        self._shown = change
        self.setVisible(change is not None)
        if change is not None:
            self.set_title(f"{change.title}?")
            self.setAccessibleName(change.title)
            set_text(self.words, "\n".join(change.sentences))
            set_text(self.warning, f"▲ {change.lost}")
            self.warning.setVisible(bool(change.lost))
            self.yes.setText(_does(change))
            set_primary(self.yes, not change.lost)
            set_primary(self.no, bool(change.lost))
            self.why.clear()
            self.no.setFocus()
            bring_into_sight(self.yes)


def _does(change: ModelChange) -> str:
    """Return what is done; of what loses classes, that it does."""
    does = "Roll back" if change.is_rollback else "Promote"
    return f"{does} without these classes" if change.lost else does
