"""State of commissioning in words, with STOP beside it: always visible on the page."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QSpacerItem, QVBoxLayout, QWidget

from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.messages import DRIVES_ONLY
from server_gui.core.commissioning.stages import GO_ON, Stage
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_primary, set_text, set_tone
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.stop_button import StopButton
from server_gui.views.widgets.wrapping_label import WrappingLabel

GO_ON_SOON: Final = "What was found is kept: “Go on” takes it up again once the command has ended."
STOP_WIDE: Final = 150  # at text of 100 %
APART: Final = 18  # likewise: from STOP to what leads on
LONG_S: Final = 3.0  # work that takes longer says for how long
STOP_TIP: Final = (
    "Ends what the command does, and asks every drive that it has found for a quick stop (F12 or Ctrl+Space "
    "do so too). It is software over a bus, NOT a safety-rated emergency stop: keep the hardware one within "
    "reach."
)


class Bar(QWidget):
    """`stopped` asks for a STOP of the drives that are commissioned, `interrupted` for the command's end.

    The button `start` is in the place of that which interrupts, as long as nothing runs.
    """

    stopped = Signal()
    interrupted = Signal()

    def __init__(self, commissioning: Commissioning, theme: Theme, start: QPushButton) -> None:
        super().__init__()
        self._commissioning = commissioning
        self._theme = theme
        self.setObjectName("dock")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._start = start
        self._icon = MarkIcon(theme, 14)
        self.stage, self.words = WrappingLabel("title"), WrappingLabel()
        self.interrupt = QPushButton("Interrupt")
        set_tip(self.interrupt, "End the command; the findings are kept, and used when you continue")
        self.interrupt.clicked.connect(self.interrupted)
        self.stop = StopButton()
        self.stop.setAccessibleName("STOP the drives that are commissioned")
        set_tip(self.stop, STOP_TIP)
        self.stop.setAccessibleDescription(STOP_TIP)
        self.stop.stopped.connect(self.stopped)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(10, 6, 8, 6)
        row = QHBoxLayout()
        row.addWidget(self._icon)
        row.addWidget(self.stage, 1)
        row.addWidget(start)
        row.addWidget(self.interrupt)
        self._apart = QSpacerItem(0, 0)
        row.addItem(self._apart)
        row.addWidget(self.stop)
        everything.addLayout(row)
        self.drives_only = WrappingLabel()
        self.drives_only.setText(f"▲ {DRIVES_ONLY}: whatever commands them keeps running.")
        self.drives_only.hide()
        everything.addWidget(self.drives_only)
        everything.addWidget(self.words)
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self) -> None:
        """Show how it is now."""
        now = self._commissioning
        look = now.look_of
        self._icon.show_mark(look.mark)
        set_text(self.stage, look.mark.word)
        set_text(self.words, self._said())
        self._start.setVisible(not now.runs)
        self.interrupt.setVisible(now.runs)
        self._lead_on(is_first=now.stage is Stage.NOT_STARTED)
        self.drives_only.setVisible(now.drives_only)
        set_tone(self.drives_only, "warn")
        self.stop.setEnabled(now.can_stop)
        self.stop.name(now.name or None)
        self.stop.setAccessibleName("STOP the drives that are commissioned")

    def _lead_on(self, *, is_first: bool) -> None:
        """Let nothing lead on as loudly as STOP stops, but at first."""
        set_primary(self._start, is_first)

    def _restyle(self) -> None:
        self.stop.setFont(self._theme.text_font(1.2, bold=True))
        self.stop.setMinimumWidth(self._theme.px(STOP_WIDE))
        self._apart.changeSize(self._theme.px(APART), 0)
        self.words.setMinimumHeight(2 * self.words.fontMetrics().lineSpacing())  # what comes moves no button

    def _said(self) -> str:
        now = self._commissioning
        if now.stage in (Stage.HAND, Stage.ASKING) and now.progress:
            return "\n".join(filter(None, (now.progress, now.problem)))
        words = now.look_of.words if now.can_start else now.look_of.words.replace(GO_ON, GO_ON_SOON)
        if now.is_silent:
            words = f"No output for {now.working_s:.0f} s, longer than any step takes: press STOP."
        elif now.runs and not now.look_of.answers and now.working_s > LONG_S:
            words += f" ({now.working_s:.0f} s)"
        return "\n".join(filter(None, (words, now.problem)))
