"""The robot's file as it would be written and as it was: its text, what the check says, and how to go on."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QApplication, QHBoxLayout, QPlainTextEdit, QPushButton, QSizePolicy

from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.messages import WrittenMessage
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

LINES: Final = 14  # high
CONNECT: Final = "Start a gateway with it, and connect"
THERE: Final = "On {computer}: gwrms gateway {file}. Then add {computer}:7420 to this window."


class ResultCard(Card):
    """`connect` asks for a gateway on this computer with the robot's file."""

    connect_to = Signal(str)

    def __init__(self, commissioning: Commissioning, theme: Theme) -> None:
        super().__init__("The robot's file")
        self._commissioning = commissioning
        self._theme = theme
        self.checked, self.next, self.said = WrappingLabel(), WrappingLabel("dim"), WrappingLabel("dim")
        self.text = QPlainTextEdit()
        self.text.setObjectName("framed")
        self.text.setReadOnly(True)
        self.text.setTabChangesFocus(True)
        self.text.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.text.setAccessibleName("Text of the robot's file")
        self.text.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.connect_button, self.copy = QPushButton(CONNECT), QPushButton("Copy the file's text")
        self.connect_button.setObjectName("primary")
        set_tip(self.connect_button, "A gateway on this computer, which ends with this window")
        self.connect_button.clicked.connect(self._connect)
        self.copy.clicked.connect(lambda: QApplication.clipboard().setText(self.text.toPlainText()))
        row = QHBoxLayout()
        row.addWidget(self.connect_button)
        row.addStretch(1)
        row.addWidget(self.copy)
        for widget in (self.checked, self.next, self.said):
            self.body.addWidget(widget)
        self.body.addLayout(row)
        self.body.addWidget(self.text, 1)
        theme.changed.connect(self._restyle)
        self._restyle()
        self.refresh()

    def refresh(self) -> None:
        """Show the file, where there is one."""
        now = self._commissioning
        written = now.written
        name, text = ("", "") if now.proposed is None else now.proposed
        if written is not None:
            name, text = written.file, written.text
        self.setVisible(bool(text))
        self.set_title(
            "The robot's file" if written is not None else "The robot's file, as it would be written"
        )
        self.set_note(name)
        if self.text.toPlainText() != text:
            self.text.setPlainText(text)
        set_text(self.checked, "" if written is None else checked(written))
        self.checked.setVisible(written is not None)
        usable = written is not None and written.usable
        there = "" if now.wish is None else now.wish.computer
        self.connect_button.setVisible(usable and not there)
        set_text(self.next, self._next(written, there))
        self.next.setVisible(bool(self.next.text()))

    def say(self, text: str, *, again: bool) -> None:
        """Say how the gateway's start goes; `again`: it can be asked for once more."""
        set_text(self.said, text)
        self.said.setVisible(bool(text))
        self.connect_button.setEnabled(again)

    # --- inside

    def _next(self, written: WrittenMessage | None, there: str) -> str:
        if written is None or not written.usable:
            return ""
        if there:
            host = there.rpartition("@")[2]
            return THERE.format(computer=host, file=written.file)
        return f"As a service, or in a terminal: gwrms gateway {written.file}"

    def _connect(self) -> None:
        if self._commissioning.written is not None:
            self.connect_to.emit(self._commissioning.written.file)

    def _restyle(self) -> None:
        self.text.setFont(self._theme.number_font())
        self.text.setMinimumHeight(self.text.fontMetrics().lineSpacing() * LINES)


def checked(written: WrittenMessage) -> str:
    """Return the findings of `gwrms check`, a line each."""
    lines = [f"▲ {severity}: {words}" for severity, words in written.findings]
    if written.unfinished:
        lines.append(f"▲ not in it, because not finished: {', '.join(written.unfinished)}")
    if written.not_journaled:
        lines.append(f"▲ {written.not_journaled}")
    return "\n".join(lines) or "● The check (gwrms check) has found no problem."
