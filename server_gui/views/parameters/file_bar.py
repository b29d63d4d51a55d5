"""The file that parameters are compared with: how many differ, and staging them."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QVBoxLayout

from server_gui.core.desk.desk import Desk
from server_gui.core.tuning.comparison import Comparison
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import PlainLabel, set_tip


class FileBar(QFrame):
    """Hidden while no file is open. `stage` and `forget` are what people decide."""

    stage = Signal()
    forget = Signal()

    def __init__(self, desk: Desk) -> None:
        super().__init__()
        self._desk = desk
        self.setObjectName("card")
        self.setAccessibleName("File that is compared with")
        self.words = PlainLabel()
        self.words.setWordWrap(True)
        self.stage_button, close = QPushButton("Load as edits"), QPushButton("Close file")
        self.stage_button.setToolTip("Makes edits of the differences, to be reviewed. Nothing is written")
        self.stage_button.clicked.connect(self.stage)
        close.clicked.connect(self.forget)
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(close)
        row.addWidget(self.stage_button)
        everything = QVBoxLayout(self)
        everything.addWidget(self.words)
        everything.addLayout(row)
        self.hide()

    def refresh(self) -> None:
        """Compare with what the robot holds now."""
        station = self._desk.selected
        file = None if station is None else station.file
        self.setVisible(file is not None)
        if station is None or file is None:
            return
        file.update(station.known, station.robot.parameters)
        count = len(file.different)
        set_text(self.words, _words(file, count))
        set_tip(self.words, "\n".join((str(file.path), *file.unchangeable)))
        self.stage_button.setEnabled(count > 0)
        text = f"Load {count} as edits" if count else "Nothing differs"
        if self.stage_button.text() != text:
            self.stage_button.setText(text)


def _words(file: Comparison, count: int) -> str:
    said = [f"{file.path.name}: {count} of {len(file.rows)} differ"]
    if file.unchangeable:
        said.append(f"{len(file.unchangeable)} cannot be changed on this robot")
    return " · ".join(said) + "".join(f"\n▲ {remark}" for remark in file.saved.remarks)
