"""Which recording is beside the one that is played, what both are aligned by, and how it is put away."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QPushButton, QWidget

from server_gui.core.archive.side_by_side import By, SideBySide
from server_gui.views.recordings.timeline import day_text
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

ALIGN_HINT: Final = "The points of both recordings that are aligned; both play from there together"
CLOSE_HINT: Final = "Show the first recording alone"


class BesideBar(QWidget):
    """Hidden while there is no second one; `closed` when it was put away."""

    closed = Signal()

    def __init__(self, beside: SideBySide) -> None:
        super().__init__()
        self._beside = beside
        self._refused = ""
        self.said = WrappingLabel()
        self.by = QComboBox()
        self.by.setAccessibleName("Both recordings are aligned by")
        self.by.addItems([by.value for by in By])
        self.by.activated.connect(self._align)
        set_tip(self.by, ALIGN_HINT)
        self.close_button = QPushButton("Put away")
        self.close_button.setAccessibleName("Close the second recording")
        set_tip(self.close_button, CLOSE_HINT)
        self.close_button.clicked.connect(self._close)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.said, 1)
        row.addWidget(self.by)
        row.addWidget(self.close_button)
        self.hide()

    def refresh(self) -> None:
        """Show how it is now."""
        beside = self._beside
        is_told = beside.session is not None or bool(beside.problem)
        self.setVisible(is_told)
        if not is_told:
            return
        tape = beside.second.tape
        if beside.problem:
            again = "" if tape is None else ", it is tried again"
            said = f"▲ it cannot be shown beside{again}: {beside.problem}"
        elif tape is None:
            said = "reading …"
        else:
            said = f"{tape.session.robot}, {day_text(tape.first_ns)}, aligned by"
        set_text(self.said, "\n".join(filter(None, (f"┅ thin, dashed: {said}", self._refused))))
        self.by.setEnabled(tape is not None)
        if self.by.currentText() != beside.by.value and not self.by.view().isVisible():
            self.by.setCurrentText(beside.by.value)

    def _align(self, place: int) -> None:
        refused = self._beside.align(list(By)[place])
        self._refused = f"▲ {refused}" if refused else ""
        self.refresh()

    def _close(self) -> None:
        self._beside.close()
        self._refused = ""
        self.refresh()
        self.closed.emit()
