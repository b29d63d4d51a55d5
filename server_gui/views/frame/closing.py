"""Dialog while the window closes: the reason for waiting, and a way to wait no longer."""

import time
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QDialog, QHBoxLayout, QPushButton, QVBoxLayout

from server_gui.core.desk.shutdown import Shutdown
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import PlainLabel

LOOK_S: Final = 0.03
SAID_S: Final = 0.2  # what takes less is not worth a word
HURRIED_S: Final = 1.5  # for what goes to the disk, when nobody waits any more
WIDTH: Final = 430
KEPT: Final = (
    "What was recorded is on this computer's disk, and goes to the store at the next start at the latest."
)
COMMISSIONING: Final = (
    "A robot is being commissioned. Closing the window ends the command; what was found is kept beside the "
    "robot's file, and gone on with at the next start."
)


class Closing(QDialog):
    """Closing it hurries what it waits for."""

    def __init__(self, ending: Shutdown, theme: Theme) -> None:
        super().__init__(None, Qt.WindowType.Dialog | Qt.WindowType.WindowStaysOnTopHint)
        self._ending = ending
        self._began_s = time.monotonic()
        self.setWindowTitle("GWRMS closes")
        title, kept = PlainLabel("GWRMS closes"), PlainLabel(KEPT)
        title.setObjectName("title")
        kept.setObjectName("dim")
        self.said = PlainLabel()
        for label in (self.said, kept):
            label.setWordWrap(True)
        self.now = QPushButton("End now")
        self.now.setToolTip("Without the last upload")
        self.now.clicked.connect(self.reject)
        self.rejected.connect(ending.hurry)
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(self.now)
        everything = QVBoxLayout(self)
        for part in (title, self.said, kept):
            everything.addWidget(part)
        everything.addLayout(row)
        self.setFixedWidth(theme.px(WIDTH))

    def say(self) -> None:
        """Show the reason for waiting, if closing takes a moment."""
        took_s = time.monotonic() - self._began_s
        if took_s >= SAID_S:
            set_text(self.said, f"{self._ending.waits_for or 'the last threads end'} … ({took_s:.0f} s)")
            self.show()


def wait_closed(ending: Shutdown, theme: Theme) -> None:
    """Wait for an end that was begun; whoever closes this too waits for what goes to the disk alone."""
    closing = Closing(ending, theme)
    while not ending.wait(LOOK_S) and not ending.is_hurried:
        QApplication.processEvents()
        closing.say()
    closing.hide()
    closing.deleteLater()
    ending.wait(HURRIED_S)
