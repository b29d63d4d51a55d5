"""The page before there is a robot: how to get one, or a simulated one at once."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import PlainLabel

WORDS = """<p>No robot is in the list yet.</p>
<p>Type the address of a robot's gateway at the left, below <i>Robots</i>: HOST:PORT, as
<code>gwrms gateway</code> prints it.<br>Robots that are always there go into
<code>~/.config/gwrms/server.toml</code>.</p>
<p>Without hardware, a whole simulated exoskeleton walks on this computer:</p>"""


class EmptyView(QWidget):
    """`simulator` asks for the simulated robot, `recordings` for what was recorded before."""

    simulator = Signal()
    recordings = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.setObjectName("page")
        title = PlainLabel("Welcome to GWRMS")
        title.setObjectName("title")
        title.setStyleSheet("font-size: 180%;")
        words = QLabel(WORDS)
        words.setWordWrap(True)
        words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.start = QPushButton("Start the simulator")
        self.start.setObjectName("primary")
        self.start.clicked.connect(self._start)
        look = QPushButton("Look at recordings")
        look.clicked.connect(self.recordings)
        self._said = PlainLabel()
        self._said.setObjectName("dim")
        self._said.setWordWrap(True)
        self._said.setAlignment(Qt.AlignmentFlag.AlignCenter)
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(self.start)
        row.addWidget(look)
        row.addStretch(1)
        everything = QVBoxLayout(self)
        everything.addStretch(1)
        everything.addWidget(title, 0, Qt.AlignmentFlag.AlignCenter)
        everything.addWidget(words)
        everything.addLayout(row)
        everything.addWidget(self._said)
        everything.addStretch(2)

    def say(self, text: str, *, again: bool) -> None:
        """Say how the start goes; `again`: it can be asked for once more."""
        self._said.setText(text)
        self.start.setEnabled(again)

    def _start(self) -> None:
        self.say("The simulator is starting; this takes a few seconds …", again=False)
        self.simulator.emit()
