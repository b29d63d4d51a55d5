"""Control of the robot: take or release it, and its remaining time."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QWidget

from gateway.wire.control import CONTROL_ACQUIRE
from server_gui.core.alarms.marks import age_text
from server_gui.core.desk.desk import Desk
from server_gui.views.marks import Mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import PlainLabel, set_tip

TAKING: Final = "One window or script at a time may write. Stopping needs no control"


class ControlBar(QWidget):
    """`take` and `release` are what people decide."""

    take = Signal()
    release = Signal()

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._icon = MarkIcon(theme)
        self.words = PlainLabel()
        self.words.setObjectName("dim")
        self.words.setWordWrap(True)
        self._take, self._release = QPushButton("Take control"), QPushButton("Release")
        set_tip(self._take, TAKING)
        self._release.setToolTip("Let others write; a running trial is reverted")
        self._take.clicked.connect(self.take)
        self._release.clicked.connect(self.release)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self._icon)
        row.addWidget(self.words, 1)
        row.addWidget(self._take)
        row.addWidget(self._release)

    def refresh(self) -> None:
        """Show who has it now."""
        station = self._desk.selected
        self.setEnabled(station is not None and station.is_linked)
        if station is None:
            self._release.hide()
            self._icon.show_mark(Mark("ring", "dim", "not in control"))
            set_text(self.words, "No robot")
            return
        left_s, why_not = station.control.left_s(), station.refused(CONTROL_ACQUIRE)
        self._take.setEnabled(not why_not)
        set_tip(self._take, why_not or TAKING)
        self._release.setVisible(left_s is not None)
        set_text_of = "Renew" if left_s is not None else "Take control"
        if self._take.text() != set_text_of:
            self._take.setText(set_text_of)
        if left_s is not None:
            self._icon.show_mark(Mark("disc", "good", "in control"))
            set_text(self.words, f"You have control for {int(left_s) // 60}:{int(left_s) % 60:02}")
        else:
            self._icon.show_mark(Mark("ring", "dim", "not in control"))
            if not station.is_linked:
                age_s = station.robot.age_s()
                old = "no value is known" if age_s is None else f"these values are {age_text(age_s)} old"
                set_text(self.words, f"No link: {old}")
                return
            asking = "asking …" if station.control.asking else "Looking only: writing takes control"
            set_text(self.words, why_not or station.control.problem or asking)
