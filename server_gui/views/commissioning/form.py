"""Form for commissioning: file, bus, EDS files, serial ports, computer."""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QGridLayout, QLineEdit, QPushButton, QWidget

from gateway.user_name import user_name
from server_gui.core.commissioning.request import CommissioningRequest
from server_gui.processes.local_ports import can_interfaces, serial_ports
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.files import ask_folder, ask_open
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

ABOUT: Final = (
    "Makes a robot's file from a bus of unknown drives: it asks, and you move the joints by hand, "
    "without power. Switch the drives' power off (emergency stop, STO, or the controller off), leave their "
    "logic supply on, and plug the sensors in. The how-to “Commission a robot” says more."
)
THERE: Final = (
    "Where the CAN adapter is: this computer, or one that SSH reaches without a password, as user@exo-01, "
    "where gwrms is installed. File, folders and ports are then that one's."
)


class Form(Card):
    """`wished` brings what is to begin, or to go on; its button `start` is not laid out here."""

    wished = Signal(object)

    def __init__(self, who: str = "") -> None:
        super().__init__("What is to be commissioned")
        self.file, self.bitrate, self.eds = QLineEdit(), QLineEdit(), QLineEdit()
        self.serial, self.who, self.computer = QLineEdit(), QLineEdit(who or user_name()), QLineEdit()
        self.bus = QComboBox()
        self.bus.setEditable(True)
        self.bus.addItems(can_interfaces())
        self.bus.setCurrentIndex(-1 if self.bus.count() != 1 else 0)
        hints = {
            self.file: ("exo-01.toml", "The robot's file that is to be written"),
            self.bitrate: ("as it is", "bit/s, for interfaces that are opened with one"),
            self.eds: ("those that ship", "Folders of EDS files, with spaces between them"),
            self.serial: ("none", "Ports of insoles and IMU, with spaces between them"),
            self.who: ("", "Who commissions it, for the record"),
            self.computer: ("this one", THERE),
            self.bus.lineEdit() or QLineEdit(): (
                "can0",
                "can0, INTERFACE:CHANNEL, or a file that has [can.…]",
            ),
        }
        for field, (hint, tip) in hints.items():
            field.setPlaceholderText(hint)
            set_tip(field, tip)
            field.returnPressed.connect(self.begin)
            field.setAccessibleName(f"Commission: {tip}")
        self.start = QPushButton("Start")
        self.start.setObjectName("primary")
        self.start.clicked.connect(self.begin)
        self.wrong = WrappingLabel("banner")
        self.wrong.setProperty("tone", "bad")
        self.wrong.hide()
        self.left = WrappingLabel("dim")
        about = WrappingLabel("dim")
        about.setText(ABOUT)
        self.body.addWidget(about)
        self.body.addWidget(self.wrong)
        self.body.addLayout(self._grid())
        self.body.addWidget(self.left)

    @property
    def wish(self) -> CommissioningRequest:
        """The request as typed."""
        return CommissioningRequest(
            file=_home(self.file.text()),
            bus=_home(self.bus.currentText()),
            bitrate=self.bitrate.text().strip(),
            eds=tuple(map(_home, _words(self.eds.text()))),
            serial=tuple(_words(self.serial.text())),
            who=self.who.text().strip(),
            computer=self.computer.text().strip(),
        )

    def begin(self) -> None:
        """Wish for it, or say what is missing."""
        wish = self.wish
        self.say(wish.problem)
        if not wish.problem:
            self.wished.emit(wish)

    def say(self, problem: str) -> None:
        """Show the problem of the input."""
        self.wrong.setText(problem)
        self.wrong.setVisible(bool(problem))

    def refresh(self) -> None:
        """Say whether an earlier dialogue is gone on with."""
        kept = self.wish.left
        text = "" if kept is None else f"{kept.name} is there: what was found before is taken up again."
        if self.left.text() != text or self.left.isHidden() == bool(text):
            self.left.setText(text)
            self.left.setVisible(bool(text))
            self.start.setText("Go on" if text else "Start")

    # --- how it is put together

    def _grid(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        rows: tuple[tuple[str, QWidget, QPushButton | None], ...] = (
            ("Robot's file", self.file, self._browse("Robot's file: …", self._choose_file)),
            ("CAN bus", self.bus, self._browse("A file that has the bus: …", self._choose_bus)),
            ("Bit rate", self.bitrate, None),
            ("EDS folders", self.eds, self._browse("EDS folder: …", self._choose_eds)),
            ("Serial ports", self.serial, self._browse("All serial ports", self._take_ports)),
            ("Your name", self.who, None),
            ("Computer", self.computer, None),
        )
        for place, (name, field, button) in enumerate(rows):
            title = PlainLabel(name)
            title.setObjectName("dim")
            field.setAccessibleName(f"Commission: {name}")
            grid.addWidget(title, place, 0)
            grid.addWidget(field, place, 1, 1, 1 if button is not None else 2)
            if button is not None:
                grid.addWidget(button, place, 2)
        return grid

    def _browse(self, name: str, do: Callable[[], None]) -> QPushButton:
        button = QPushButton("All" if name.startswith("All") else "…")
        button.setAccessibleName(name)
        set_tip(button, name)
        button.clicked.connect(do)
        return button

    def _choose_file(self) -> None:
        ask_folder(
            self, "Folder of the robot's file", lambda path: self.file.setText(str(path / _name(self.file)))
        )

    def _choose_bus(self) -> None:
        ask_open(self, "A file that has the bus", ("toml",), lambda path: self.bus.setEditText(str(path)))

    def _choose_eds(self) -> None:
        ask_folder(self, "Folder of EDS files", lambda path: self.eds.setText(_more(self.eds, path)))

    def _take_ports(self) -> None:
        self.serial.setText(shlex.join(serial_ports()))


def _words(text: str) -> list[str]:
    """Return it as a shell parts them; what it cannot part is parted at its spaces."""
    try:
        return shlex.split(text)
    except ValueError:
        return text.split()


def _home(text: str) -> str:
    """~ is for who types, not for the command."""
    return str(Path(text.strip()).expanduser()) if text.strip().startswith("~") else text.strip()


def _name(field: QLineEdit) -> str:
    return Path(field.text().strip()).name or "exo-01.toml"


def _more(field: QLineEdit, path: Path) -> str:
    return shlex.join([*_words(field.text()), str(path)])
