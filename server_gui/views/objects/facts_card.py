"""The chosen object: all that is known of it, and what may be done with it."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QGridLayout, QPlainTextEdit, QPushButton

from gateway.plain_text import plain
from gateway.wire.dictionary import ObjectInfo
from server_gui.core.objects.rows import channel_lines
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.plain import set_tip

NOTHING: Final = "No object chosen"
HIGH: Final = 128  # px: as high whatever is chosen, so that nothing moves
UNLIKE: Final = "Opens it among the parameters, where it is staged, reviewed, tried and written"
LINES: Final = "The lines for robot.toml that allow writing it; the gateway reads them when it starts"
CHANNEL: Final = "The lines for robot.toml that make it a channel, which is drawn and recorded"


class FactsCard(Card):
    """`edited` when it is to be changed, `pinned` when it is to be at hand, or no more."""

    edited = Signal()
    pinned = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(NOTHING)
        self._theme = theme
        self._info: ObjectInfo | None = None
        self._component = ""
        self._columns = 0
        self.text = QPlainTextEdit()
        self.text.setReadOnly(True)
        self.text.setTabChangesFocus(True)
        self.text.setAccessibleName("Facts of the chosen object")
        self.edit = QPushButton("Edit …")
        self.address = QPushButton("Copy address")
        self.lines = QPushButton("Copy release")
        self.channel = QPushButton("Copy channel")
        self.pin = QPushButton("Pin")
        set_tip(self.lines, LINES)
        set_tip(self.channel, CHANNEL)
        set_tip(self.address, "Ctrl+C")
        set_tip(self.pin, "Keeps it at hand under ★ (Ctrl+P)")
        self.edit.clicked.connect(self.edited)
        self.pin.clicked.connect(self.pinned)
        self.address.clicked.connect(self.copy_address)
        self.lines.clicked.connect(self._copy_lines)
        self.channel.clicked.connect(self._copy_channel)
        self.buttons = (self.edit, self.address, self.lines, self.channel, self.pin)
        self._grid = QGridLayout()
        self._grid.setSpacing(4)
        self.body.addWidget(self.text)
        self.body.addLayout(self._grid)
        self.arrange(len(self.buttons))
        theme.changed.connect(self._restyle)
        self._restyle()

    def arrange(self, columns: int) -> None:
        """Arrange so many buttons in a row, at most."""
        columns = min(columns, len(self.buttons))
        if columns == self._columns:
            return
        self._columns = columns
        for place, button in enumerate(self.buttons):
            self._grid.addWidget(button, place // columns, place % columns)

    def show_object(
        self, info: ObjectInfo | None, component: str, facts: Sequence[tuple[str, str]], refused: str
    ) -> None:
        """Show the facts of an object; `refused` is the reason why it may not be changed here, or empty."""
        is_another = (info, component) != (self._info, self._component)
        self._info, self._component = info, component
        title = NOTHING if info is None else f"{info.object}  {plain(info.name)}"
        self.set_title(title)
        self.setAccessibleName(title)
        said = "\n".join(f"{title}: {plain(text, chr(10))}" for title, text in facts)
        if self.text.toPlainText() != said and (is_another or not self.text.textCursor().hasSelection()):
            at = 0 if is_another else self.text.verticalScrollBar().value()
            self.text.setPlainText(said)
            self.text.verticalScrollBar().setValue(at)
        self.edit.setEnabled(info is not None and not refused)
        set_tip(self.edit, refused or UNLIKE)
        self.lines.setEnabled(info is not None and info.release is not None)
        for button in (self.address, self.channel, self.pin):
            button.setEnabled(info is not None)

    def copy_address(self) -> None:
        """Put the object's address into the clipboard, as commands take it."""
        _copy(None if self._info is None else self._info.object)

    def _copy_lines(self) -> None:
        _copy(None if self._info is None else self._info.release)

    def _copy_channel(self) -> None:
        _copy(None if self._info is None else channel_lines(self._component, self._info))

    def _restyle(self) -> None:
        self.text.setFont(self._theme.number_font())
        self.text.setFixedHeight(self._theme.px(HIGH))


def _copy(text: str | None) -> None:
    if text:
        QGuiApplication.clipboard().setText(text)
