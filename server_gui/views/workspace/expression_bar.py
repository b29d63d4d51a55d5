"""A line to write an expression in, which says while one types what is wrong with it, and where."""

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QCompleter, QHBoxLayout, QLineEdit, QPushButton, QSizePolicy

from server_gui.core.workspace.curve_binding import CurveBinding
from server_gui.core.workspace.expressions import FUNCTIONS
from server_gui.core.workspace.grammar import LONGEST
from server_gui.core.workspace.workspace import said
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import PlainLabel, set_tip

EXAMPLE = "apart = left_knee.position - right_knee.position"  # of what every robot with two knees has
HELP = f"Channels, numbers such as 5 [°], + − * / ( ), and {', '.join(sorted(FUNCTIONS))}; a name before ="


class ExpressionBar(Card):
    """`written` brings an expression that means something on this robot."""

    written = Signal(str)

    def __init__(self, theme: Theme, meaning: Callable[[str], CurveBinding]) -> None:
        super().__init__("Expression")
        self._theme = theme
        self._meaning = meaning
        self.field = QLineEdit()
        self.field.setMaxLength(LONGEST)
        self.field.setPlaceholderText(EXAMPLE)
        self.field.setAccessibleName("Expression over channels")
        set_tip(self.field, HELP)
        self.field.textChanged.connect(self._judge)
        self.field.returnPressed.connect(self._add)
        self.add = QPushButton("Add")
        self.add.setAccessibleName("Add the expression")
        self.add.clicked.connect(self._add)
        self.place = PlainLabel()
        self.place.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.words = PlainLabel(HELP)
        self.words.setObjectName("dim")
        self.words.setWordWrap(True)
        row = QHBoxLayout()
        row.addWidget(self.field, 1)
        row.addWidget(self.add)
        self.body.addLayout(row)
        self.body.addWidget(self.place)
        self.body.addWidget(self.words)
        self._judge()
        self._scale()
        theme.changed.connect(self._scale)
        self.hide()

    def open(self, wanted: bool) -> None:
        """Show it, ready to be typed in, or put it away."""
        self.setVisible(wanted)
        if wanted:
            self.field.setFocus()

    def _scale(self) -> None:
        for part in (self.field, self.place):
            part.setFont(self._theme.number_font())  # so that a place below it is below its letter

    def show_channels(self, names: Sequence[str]) -> None:
        """Offer these while one types the first."""
        completer = QCompleter(list(names), self.field)
        completer.setFilterMode(Qt.MatchFlag.MatchContains)
        self.field.setCompleter(completer)
        self._judge()

    def _judge(self) -> None:
        text = self.field.text()
        if not text.strip():
            self.add.setEnabled(False)
            self.place.hide()
            set_text(self.words, HELP)
            return
        meant = self._meaning(text)
        self.add.setEnabled(not meant.problem)
        lines = meant.mark.splitlines()[:2]
        set_text(self.place, "\n".join([*lines[:1], *(line[: line.rindex("^") + 1] for line in lines[1:])]))
        self.place.setVisible(bool(meant.mark))
        set_text(
            self.words, f"▲ {meant.problem}" if meant.problem else f"{meant.name}, in {said(meant.unit)}"
        )

    def _add(self) -> None:
        if self.add.isEnabled():
            self.written.emit(self.field.text().strip())
