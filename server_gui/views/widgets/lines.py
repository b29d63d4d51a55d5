"""A few lines, each a mark, what it says and a dim detail; as many as there is something to say."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QWidget

from server_gui.views.foreseen import Line
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.mark import MarkIcon


class Lines(QWidget):
    """At most `most` of them; what has no room is in the tool tip."""

    def __init__(self, theme: Theme, name: str, most: int) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(6)
        grid.setVerticalSpacing(1)
        grid.setColumnStretch(1, 4)
        grid.setColumnStretch(2, 5)
        self._rows = [(MarkIcon(theme, 10), ElidedLabel(), ElidedLabel("dim")) for _ in range(most)]
        for row, widgets in enumerate(self._rows):
            for column, widget in enumerate(widgets):
                grid.addWidget(
                    widget, row, column, Qt.AlignmentFlag.AlignVCenter if column == 0 else Qt.AlignmentFlag(0)
                )

    @property
    def texts(self) -> list[tuple[str, str]]:
        """What it says."""
        return [(main.text(), detail.text()) for _, main, detail in self._rows if not main.isHidden()]

    def show_lines(self, lines: Sequence[Line]) -> None:
        """Show these."""
        for place, widgets in enumerate(self._rows):
            icon, main, detail = widgets
            known = place < len(lines)
            for widget in widgets:
                widget.setVisible(known)
            if known:
                icon.show_mark(lines[place].mark)
                set_text(main, lines[place].text)
                set_text(detail, lines[place].detail)
        tip = "\n".join(f"{line.text}: {line.detail}" if line.detail else line.text for line in lines)
        if tip != self.toolTip():
            self.setToolTip(tip)
