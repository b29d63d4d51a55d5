"""What became of STOP ALL, of all robots together: one line below the pages, from it until all are reset."""

from typing import Final

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout

from server_gui.core.desk.desk import Desk
from server_gui.views.alarms.full_list import style
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text, set_tone
from server_gui.views.widgets.free_place import KEPT
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

LINES: Final = 3  # of text: what needs more is said more briefly, and whole in the tip
WRAPPED: Final = Qt.TextFlag.TextWordWrap.value
MOST: Final = 100_000  # pixels


class StopAllBar(QFrame):
    """Hidden without a STOP ALL; numbers and names of it are never cut."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._wordings: tuple[str, ...] = ("",)
        self.setObjectName("alarm")
        self.setProperty(KEPT, True)
        self.setAccessibleName("What became of STOP ALL")
        self._icon, self.words = MarkIcon(theme, 13), WrappingLabel()
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 3, 12, 3)
        row.setSpacing(8)
        row.addWidget(self._icon)
        row.addWidget(self.words, 1)
        self.hide()
        theme.changed.connect(self._restyle)
        self._restyle()

    @property
    def text(self) -> str:
        """The result as it is shown; empty without one."""
        return "" if self.isHidden() else self.words.text()

    def refresh(self) -> None:
        """Show how it stands now."""
        result = self._desk.stopped_all
        self.setVisible(result is not None)
        if result is None:
            return
        self._wordings = result.wordings
        self._icon.show_mark(result.mark)
        set_tone(self, result.mark.colour)
        set_tip(self, result.wordings[0])
        self.setAccessibleDescription(result.wordings[0])
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def minimumSizeHint(self) -> QSize:
        """Return its height: it makes no window wider."""
        return QSize(1, super().minimumSizeHint().height())

    def _fit(self) -> None:
        metrics, width = self.words.fontMetrics(), max(self.words.width(), 1)

        def high(text: str) -> int:
            return metrics.boundingRect(0, 0, width, MOST, WRAPPED, text).height()

        most = LINES * metrics.lineSpacing()
        set_text(
            self.words, next((text for text in self._wordings if high(text) <= most), self._wordings[-1])
        )

    def _restyle(self) -> None:
        self.words.setFont(self._theme.text_font(bold=True))
        self.setStyleSheet(style(self._theme))
