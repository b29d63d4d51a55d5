"""Pairs this desk with a robot: its address and the code that it shows. Nothing waits for it."""

import threading
from collections.abc import Callable
from functools import partial
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QCloseEvent, QFontDatabase
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gateway.client import Address
from gateway.client import pairing as desk
from gateway.wire.pairing import is_link
from server_gui.views.widgets.plain import PlainLabel

WIDTH: Final = 460
TITLE: Final = "Pair with a robot"
COMMAND: Final = "sudo gwrms keys pair"
HOW: Final = (
    "It shows its address and a code, for five minutes. Enter both here, or paste the link. Someone at the "
    "robot then chooses what this desk may do."
)
WAITS: Final = "Waiting for confirmation on the robot: the name and role of this desk …"


class Attempt(QObject):
    """One pairing in a thread of its own; `ended` brings what came of it into the window's."""

    ended = Signal(object)

    def __init__(self, parent: QObject, where: Address, code: str, name: str | None) -> None:
        super().__init__(parent)
        self._given_up = threading.Event()
        work = partial(self._pair, where, code, name)
        self._thread = threading.Thread(target=work, name="pairing", daemon=True)
        self._thread.start()

    def give_up(self) -> None:
        """Cancel the pairing, within some seconds and without a pin."""
        self._given_up.set()

    def join(self, within_s: float | None = None) -> bool:
        """Return whether its thread has ended."""
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def _pair(self, where: Address, code: str, name: str | None) -> None:
        """In the thread."""
        try:
            paired = desk.pair(where, code, name, self._given_up.is_set)
            if not self._given_up.is_set():
                desk.pin(paired.robot, paired.address)
            found: desk.Paired | Exception = paired
        except Exception as error:  # noqa: BLE001 - whatever it is, whoever waits for it is told
            found = error
        if not self._given_up.is_set():  # else nobody is there any more who would be told
            self.ended.emit(found)


class PairingDialog(QDialog):
    """`paired` brings the address of a robot that this desk knows from now on."""

    paired = Signal(str)

    def __init__(self, parent: QWidget | None = None, where: str = "") -> None:
        super().__init__(parent)
        self.setWindowTitle(TITLE)
        self.setModal(False)
        self.attempt: Attempt | None = None
        self.address, self.code, self.name = QLineEdit(where), QLineEdit(), QLineEdit()
        self.address.setPlaceholderText("HOST:PORT or gwrms://…")
        self.code.setPlaceholderText("as the robot shows it")
        self.name.setPlaceholderText(desk.own_name())
        self.said = PlainLabel()
        self.said.setObjectName("banner")
        self.said.setWordWrap(True)
        self.said.hide()
        self.cancel, self.act = QPushButton("Cancel"), QPushButton("Pair")
        self.act.setObjectName("primary")
        self.act.setDefault(True)
        self.cancel.setAutoDefault(False)
        self.cancel.clicked.connect(self.reject)
        self.act.clicked.connect(self._begin)
        self.finished.connect(self.give_up)
        for field in (self.address, self.code):
            field.textChanged.connect(self._allow)
        self._lay_out()
        self._allow()
        (self.code if where else self.address).setFocus()

    def closeEvent(self, event: QCloseEvent) -> None:
        self.give_up()
        super().closeEvent(event)

    def _lay_out(self) -> None:
        heading, how = PlainLabel(TITLE), PlainLabel(HOW)
        heading.setObjectName("title")
        how.setWordWrap(True)
        how.setMinimumWidth(WIDTH)
        form = QFormLayout()
        labels = ("Address", self.address), ("Code", self.code), ("Name of this desk", self.name)
        for title, edit in labels:
            edit.setAccessibleName(title)
            form.addRow(title, edit)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self.cancel)
        buttons.addWidget(self.act)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 14, 16, 12)
        column.setSpacing(12)
        column.addWidget(heading)
        column.addWidget(PlainLabel("On the robot, run:"))
        column.addLayout(self._command())
        column.addWidget(how)
        column.addLayout(form)
        column.addWidget(self.said)
        column.addLayout(buttons)

    def _command(self) -> QHBoxLayout:
        """Return what is to be run, to be read and copied."""
        command, copy = QLineEdit(COMMAND), QPushButton("Copy")
        command.setReadOnly(True)
        command.setAccessibleName("Command to run on the robot")
        command.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        font = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)
        font.setPixelSize(self.fontInfo().pixelSize())
        command.setFont(font)
        copy.setAccessibleName("Copy the command")
        copy.setAutoDefault(False)
        copy.clicked.connect(lambda: QApplication.clipboard().setText(COMMAND))
        row = QHBoxLayout()
        row.addWidget(command, 1)
        row.addWidget(copy)
        return row

    def _allow(self) -> None:
        """Offer to pair once there is something to pair with: a link has the code in it."""
        where = self.address.text().strip()
        can = bool(where) and (bool(self.code.text().strip()) or is_link(where))
        self.act.setEnabled(can and self.attempt is None)

    def _begin(self) -> None:
        try:
            where, code = desk.typed(self.address.text(), self.code.text())
        except ValueError as error:
            self._say(str(error), "bad")
            return
        self._enable(False)
        self._say(WAITS, "plain")
        self.attempt = Attempt(self, where, code, self.name.text().strip() or None)
        self.attempt.ended.connect(self._ended, Qt.ConnectionType.QueuedConnection)

    def _ended(self, found: desk.Paired | Exception) -> None:
        self._end_attempt()
        self._enable(True)
        self._allow()
        if isinstance(found, Exception):
            self._say(str(found), "bad")
            return
        self._say(f"Paired with {found.robot}: it calls this desk {found.name}, as {found.role}.", "good")
        self.cancel.setText("Close")
        self.act.setEnabled(False)
        self.paired.emit(str(found.address))

    def give_up(self) -> None:
        """Pair no more; what was confirmed already stays."""
        if self.attempt is not None:
            self.attempt.give_up()

    def end(self, within_s: float) -> None:
        """Join what is under way; where that takes longer, it ends with the process."""
        self.give_up()
        if self.attempt is not None:
            self.attempt.join(within_s)

    def _end_attempt(self) -> None:
        if self.attempt is not None:
            self.attempt.join()  # it has said all, and ends now
            self.attempt = None

    def _enable(self, on: bool) -> None:
        for part in (self.address, self.code, self.name, self.act):
            part.setEnabled(on)

    def _say(self, text: str, tone: str) -> None:
        self.said.setText(text)
        self.said.setProperty("tone", tone)
        self.said.style().polish(self.said)
        self.said.setVisible(bool(text))


def show_pairing(parent: QWidget, where: str, paired: Callable[[str], None]) -> PairingDialog:
    """Ask for a robot to pair with; the one that is open already, where there is one."""
    for known in parent.findChildren(PairingDialog):
        if known.isVisible():
            known.raise_()
            return known
    dialog = PairingDialog(parent, where)
    dialog.paired.connect(paired)
    dialog.show()
    return dialog
