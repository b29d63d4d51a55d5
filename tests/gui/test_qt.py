"""The pinned Qt works on this machine without a screen."""

import os
import subprocess
import sys

from tests.support.waiting import WAIT_S

DRAW = """
from PySide6.QtWidgets import QApplication, QLabel
application = QApplication([])
label = QLabel("left_knee")
label.resize(120, 40)
image = label.grab().toImage()
print(len({image.pixel(x, y) for x in range(image.width()) for y in range(image.height())}))
"""

MEASURED = """
import shiboken6
from PySide6.QtWidgets import QApplication, QComboBox, QLabel
from server_gui.views.theme import Theme
application = QApplication([])
theme = Theme(application)
boxes = [QComboBox() for _ in range(300)]
for box in boxes:
    box.view().sizeHint()
    box.sizeHint()
theme.set(scale=2.0)
for box in boxes:
    box.sizeHint()
for box in boxes:
    shiboken6.delete(box)
labels = [QLabel() for _ in range(500)]
for _ in range(9):
    application.setStyleSheet(application.styleSheet() + " ")
"""


def test_a_widget_is_drawn_offscreen_by_the_pinned_qt() -> None:
    # In a process of its own: Qt would leave threads and global state in this one.
    drawn = _alone(DRAW)
    assert drawn.returncode == 0, drawn.stderr
    assert int(drawn.stdout) > 1, "the label was drawn in one colour: no text on it"


def test_the_end_of_a_widget_that_was_measured_and_never_shown_is_heard_of() -> None:
    styled = _alone(MEASURED)
    assert styled.returncode == 0, styled.stderr


def _alone(script: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        timeout=WAIT_S,
        check=False,
    )
