"""State of commissioning in words, with STOP beside it: always visible on the page."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.stages import GO_ON
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.stop_button import StopButton
from server_gui.views.widgets.wrapping_label import WrappingLabel

GO_ON_SOON: Final = "What was found is kept: “Go on” takes it up again once the command has ended."
STOP_WIDE: Final = 150  # at text of 100 %
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
        theme.changed.connect(self._restyle)
        self._restyle()
        everything = QVBoxLayout(self)
        everything.setContentsMargins(10, 6, 8, 6)
        row = QHBoxLayout()
        row.addWidget(self._icon)
        row.addWidget(self.stage, 1)
        row.addWidget(start)
        row.addWidget(self.interrupt)
        row.addWidget(self.stop)
        everything.addLayout(row)
        everything.addWidget(self.words)

    def refresh(self) -> None:
        """Show how it is now."""
        now = self._commissioning
        look = now.look_of
        self._icon.show_mark(look.mark)
        set_text(self.stage, look.mark.word)
        set_text(self.words, self._said())
        self._start.setVisible(not now.runs)
        self.interrupt.setVisible(now.runs)
        self.stop.setEnabled(now.can_stop)
        self.stop.name(now.name or None)
        self.stop.setAccessibleName("STOP the drives that are commissioned")

    def _restyle(self) -> None:
        self.stop.setFont(self._theme.text_font(1.2, bold=True))
        self.stop.setMinimumWidth(self._theme.px(STOP_WIDE))
        self.words.setMinimumHeight(2 * self.words.fontMetrics().lineSpacing())  # what comes moves no button

    def _said(self) -> str:
        now = self._commissioning
        words = now.look_of.words if now.can_start else now.look_of.words.replace(GO_ON, GO_ON_SOON)
        if now.is_silent:
            words = f"No output for {now.working_s:.0f} s, longer than any step takes: press STOP."
        elif now.runs and not now.look_of.answers and now.working_s > LONG_S:
            words += f" ({now.working_s:.0f} s)"
        return "\n".join(filter(None, (words, now.problem)))
