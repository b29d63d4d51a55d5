"""A few lines, each a mark and what it says; as many as there is something to say."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QWidget

from server_gui.views.predictions import PredictionRow
from server_gui.views.theme import Theme
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.shrinking_label import ShrinkingLabel


class Lines(QWidget):
    """At most `most` of them; what has no room is in the tool tip."""

    def __init__(self, theme: Theme, name: str, most: int) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self._grid = grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(6)
        grid.setVerticalSpacing(0)  # between lines that are hidden Qt has none
        grid.setColumnStretch(1, 1)
        self._rows = [(MarkIcon(theme, 10), ShrinkingLabel()) for _ in range(most)]
        for row, (icon, label) in enumerate(self._rows):
            grid.addWidget(icon, row, 0, Qt.AlignmentFlag.AlignVCenter)
            grid.addWidget(label, row, 1)
        self._reserved = most
        theme.changed.connect(self._reserve_anew)
        self.reserve(most)

    def _reserve_anew(self) -> None:
        self.reserve(self._reserved)

    def reserve(self, count: int) -> None:
        """Keep the room of so many lines: what stands above and below is not moved as they come and go."""
        self._reserved = count
        label = self._rows[0][1].sizeHint().height()
        for row in range(len(self._rows)):
            self._grid.setRowMinimumHeight(row, label + 1 if row < count else 0)
        self.updateGeometry()

    @property
    def texts(self) -> list[str]:
        """The shown texts."""
        return [label.text() for _, label in self._rows if not label.isHidden()]

    def show_lines(self, lines: Sequence[PredictionRow]) -> None:
        """Show these."""
        tips = ["\n".join(filter(None, (line.wordings[0], line.tip))) for line in lines]
        for place, (icon, label) in enumerate(self._rows):
            known = place < len(lines)
            icon.setVisible(known)
            label.setVisible(known)
            if known:
                icon.show_mark(lines[place].mark)
                label.say(*lines[place].wordings)
        set_tip(self, "\n".join(tips))
