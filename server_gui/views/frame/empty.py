"""The page before there is a robot: add one, pair with one, start a simulated one, or open a recording."""

from collections.abc import Callable

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from gateway.client import Address, BadAddress
from gateway.wire.pairing import is_link
from server_gui.core.desk.first_steps import STARTS
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.plain import PlainLabel

WIDTH = 560  # at text of 100 %: longer lines are not read
ADDRESS = "192.168.100.200:7420"  # whole in its field
AROUND = 24  # pixels around what is typed, at text of 100 %
ADD = (
    "Address that “gwrms gateway” prints. A robot that has keys shows a code to pair with: "
    "“sudo gwrms keys pair”."
)
HINT = "Robots that are to be followed at every start go into ~/.config/gwrms/server.toml."
SIMULATE = "A whole exoskeleton without hardware walks on this computer. It can be stopped, tuned and broken."
COMMISSION = "Make a robot's file for unknown drives: answer questions, and move the joints by hand."
OPEN = "Everything that was recorded, played in the same views; no robot is needed."


class EmptyView(QWidget):
    """`added` brings an address, `pairing` one to pair with, as far as it was typed.

    `simulator` asks for the simulated robot, `recordings` for the past.
    """

    added = Signal(str)
    pairing = Signal(str)
    simulator = Signal()
    recordings = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setObjectName("page")
        self.title = PlainLabel("Welcome to GWRMS")
        self.title.setObjectName("title")
        self.address, self.add = QLineEdit(), QPushButton("Add")
        self.address.setPlaceholderText("HOST:PORT")
        self.address.setAccessibleName("Address of the first robot")
        self.address.returnPressed.connect(self._add)
        self.add.setAccessibleName("Add this robot")
        self.add.setToolTip(HINT)
        self.add.clicked.connect(self._add)
        self.pair = QPushButton("Pair with a code…")
        self.pair.clicked.connect(lambda: self.pairing.emit(self.address.text().strip()))
        self.start, self.open = QPushButton("Start the simulated robot"), QPushButton("Open a recording")
        self.start.setObjectName("primary")
        self.start.clicked.connect(self._start)
        self.open.clicked.connect(self.recordings)
        self.wrong, self.said = _words(""), _words("")
        self.wrong.hide()
        self.said.hide()
        self._column = QVBoxLayout()
        self._column.setSpacing(10)
        self._column.addWidget(self.title, 0, Qt.AlignmentFlag.AlignCenter)
        self._column.addWidget(self._adding())
        self._column.addWidget(_offer("Simulated robot", SIMULATE, self.start, self.said))
        self._column.addWidget(_offer("Recording", OPEN, self.open))
        middle = QWidget()
        middle.setLayout(self._column)
        self._middle = middle
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(middle, 20)
        row.addStretch(1)
        everything = QVBoxLayout(self)
        everything.addStretch(1)
        everything.addLayout(row)
        everything.addStretch(2)
        theme.changed.connect(self._restyle)
        self._restyle()

    def say(self, text: str, *, again: bool) -> None:
        """Say how the start goes; `again`: it can be asked for once more."""
        if self.said.text() != text or self.start.isEnabled() != again:
            self.said.setText(text)
            self.said.setVisible(bool(text))
            self.start.setEnabled(again)

    def offer_commissioning(self, go: Callable[[], None]) -> None:
        """Offer the page for robots that have no file yet."""
        button = QPushButton("Commission a robot")
        button.setObjectName("commission")
        button.clicked.connect(go)
        self._column.insertWidget(3, _offer("New robot", COMMISSION, button))

    # --- inside

    def _adding(self) -> Card:
        card = _offer("A robot", ADD)
        row = QHBoxLayout()
        row.addWidget(self.address, 1)
        row.addWidget(self.add)
        row.addWidget(self.pair)
        card.body.addLayout(row)
        card.body.addWidget(self.wrong)
        return card

    def _add(self) -> None:
        text = self.address.text().strip()
        if is_link(text):
            self.pairing.emit(text)
            return
        try:
            where = str(Address.parse(text))
        except BadAddress as error:
            self.wrong.setText(str(error))
            self.wrong.show()
            return
        self.wrong.hide()
        self.added.emit(where)

    def _start(self) -> None:
        self.say(STARTS, again=False)
        self.simulator.emit()

    def _restyle(self) -> None:
        self.title.setFont(self._theme.text_font(1.8, bold=True))
        widest = self.address.fontMetrics().horizontalAdvance(ADDRESS)
        self.address.setMinimumWidth(widest + self._theme.px(AROUND))
        self._middle.setMaximumWidth(self._theme.px(WIDTH))


def _offer(title: str, text: str, *more: QWidget) -> Card:
    card = Card(title)
    card.body.addWidget(_words(text))
    for each in more:
        row = QHBoxLayout()
        row.addWidget(each, 0 if isinstance(each, QPushButton) else 1)
        if isinstance(each, QPushButton):
            row.addStretch(1)
        card.body.addLayout(row)
    return card


def _words(text: str) -> PlainLabel:
    label = PlainLabel(text)
    label.setObjectName("dim")
    label.setWordWrap(True)
    return label
