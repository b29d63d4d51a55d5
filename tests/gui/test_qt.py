"""The pinned Qt works on this machine without a screen."""

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


def test_a_widget_is_drawn_offscreen_by_the_pinned_qt() -> None:
    # In a process of its own: Qt would leave threads and global state in this one.
    drawn = subprocess.run(
        [sys.executable, "-c", DRAW],
        env={"QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        timeout=WAIT_S,
        check=False,
    )
    assert drawn.returncode == 0, drawn.stderr
    assert int(drawn.stdout) > 1, "the label was drawn in one colour: no text on it"
