"""What each drive has said to a STOP while the robot is commissioned: a row a drive, with its time."""

from collections.abc import Collection
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QWidget

from server_gui.core.commissioning.messages import StoppedMessage
from server_gui.views.widgets.card import Card, set_text, set_tone
from server_gui.views.widgets.plain import unbroken
from server_gui.views.widgets.wrapping_label import WrappingLabel

TITLES: Final = ("Drive", "State", "Confirmed")


class StoppedCard(Card):
    """Hidden as long as no STOP was answered."""

    def __init__(self) -> None:
        super().__init__("STOP, drive by drive")
        self._known: tuple[StoppedMessage | None, Collection[str]] = (None, ())
        self._rows: list[tuple[WrappingLabel, ...]] = []
        inner = QWidget()
        self._grid = QGridLayout(inner)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setVerticalSpacing(1)
        self._grid.setHorizontalSpacing(12)
        for column, title in enumerate(TITLES):
            label = WrappingLabel("dim")
            label.setText(title)
            self._grid.addWidget(label, 0, column)
            self._grid.setColumnStretch(column, 1)
        self.body.addWidget(inner)
        self.hide()

    @property
    def texts(self) -> list[tuple[str, ...]]:
        """The shown rows."""
        return [tuple(cell.text() for cell in row) for row in self._rows if not row[0].isHidden()]

    def show_proof(self, stopped: StoppedMessage | None, off: Collection[str] = ()) -> None:
        """Show what the drives have said, of which some were `off` before, or nothing."""
        if (stopped, off) == self._known:
            return
        self._known = stopped, off
        rows = () if stopped is None else stopped.rows(off)
        self.setVisible(bool(rows))
        while len(self._rows) < len(rows):
            self._add()
        for place, row in enumerate(self._rows):
            for column, cell in enumerate(row):
                cell.setVisible(place < len(rows))
                if place < len(rows):
                    set_text(cell, unbroken(rows[place][column]))
            if stopped is not None and place < len(rows):
                has_confirmed = stopped.has_confirmed(rows[place][0])
                set_tone(row[-1], "plain" if has_confirmed else "bad")
        if stopped is not None:
            count, every = sum(map(stopped.has_confirmed, stopped.drives)), len(stopped.drives)
            self.set_note(f"{count} of {every} confirmed", f"{count}/{every}")

    def _add(self) -> None:
        row = (WrappingLabel(), WrappingLabel(), WrappingLabel("dim"))
        for column, cell in enumerate(row):
            self._grid.addWidget(cell, len(self._rows) + 1, column, Qt.AlignmentFlag.AlignTop)
        self._rows.append(row)
