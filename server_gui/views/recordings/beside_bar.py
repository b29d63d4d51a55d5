"""The two recordings that are played together: their names and colours, what both are aligned by, tools."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QComboBox, QHBoxLayout, QPushButton, QWidget

from server_gui.core.archive.recording_names import long_names
from server_gui.core.archive.side_by_side import By, SideBySide
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.plot import css
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.wrapping_legend import WrappingLegend
from server_gui.views.workspace.unit_plot import BESIDE, HERE, RECORDINGS

ALIGN_HINT: Final = "The points of both recordings that are aligned; both play from there together"
CLOSE_HINT: Final = "Show the first recording alone"
CURSORS_HINT: Final = "Both recordings and their difference at two cursors, and over the visible span"
TOOLS_HINT: Final = "The channels, and the tools that arrange and export plots"
SPACE: Final = 4  # between both


class BesideBar(QWidget):
    """Hidden while there is no second one; `closed` when it was put away.

    `arranged` asks for the channels and tools, `measured` for the cursors.
    """

    closed = Signal()
    arranged = Signal(bool)
    measured = Signal(bool)

    def __init__(self, beside: SideBySide, theme: Theme) -> None:
        super().__init__()
        self._beside = beside
        self._theme = theme
        self._refused = ""
        self.cadence = ShrinkingLabel("dim")  # of both
        self.said = WrappingLegend("The two recordings")
        self.by = QComboBox()
        self.by.setAccessibleName("Both recordings are aligned by")
        self.by.addItems([by.value for by in By])
        self.by.activated.connect(self._align)
        set_tip(self.by, ALIGN_HINT)
        self.cursors, self.tools = QPushButton("Cursors"), QPushButton("Channels")
        for button, hint, name, wanted in (
            (self.cursors, CURSORS_HINT, "Cursors in both recordings", self.measured),
            (self.tools, TOOLS_HINT, "Channels and tools of both recordings", self.arranged),
        ):
            button.setCheckable(True)
            button.setAccessibleName(name)
            set_tip(button, hint)
            button.toggled.connect(wanted)
        self.tools.toggled.connect(self.cursors.setHidden)  # the tools have a button for them
        self.close_button = QPushButton("Close")
        self.close_button.setAccessibleName("Close the second recording")
        set_tip(self.close_button, CLOSE_HINT)
        self.close_button.clicked.connect(self._close)
        self._buttons = buttons = QHBoxLayout()
        buttons.addWidget(self.cadence, 1)
        for widget in (PlainLabel("aligned by"), self.by, self.cursors, self.tools, self.close_button):
            buttons.addWidget(widget)
        self._rows = QBoxLayout(QBoxLayout.Direction.TopToBottom, self)
        self._rows.setContentsMargins(0, 0, 0, 0)
        self._rows.setSpacing(SPACE)
        self._rows.addWidget(self.said, 1)
        self._rows.addLayout(buttons)
        self.hide()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share()

    def _share(self) -> None:
        """Put names and buttons into one line where the names are whole there; the rest is shortened."""
        names = self.said.whole_width
        is_wide = self.width() >= names + SPACE + self._buttons.minimumSize().width()
        ways = QBoxLayout.Direction
        self.said.setMinimumWidth(names if is_wide else 0)
        self._rows.setDirection(ways.LeftToRight if is_wide else ways.TopToBottom)

    def refresh(self) -> None:
        """Show how it is now."""
        beside = self._beside
        is_told = beside.session is not None or bool(beside.problem)
        self.setVisible(is_told)
        if not is_told:
            return
        self.said.say(self._parts())
        self._share()
        is_there = beside.second.tape is not None
        for widget in (self.by, self.cursors):
            widget.setEnabled(is_there)
        if self.by.currentText() != beside.by.value and not self.by.view().isVisible():
            self.by.setCurrentText(beside.by.value)

    def _parts(self) -> list[tuple[str, str, str]]:
        """Return what is said: the names in the colours of the curves."""
        beside, (here, other) = self._beside, (css(self._theme, one) for one in RECORDINGS)
        first, second, bad = beside.first.tape, beside.second.tape, css(self._theme, "bad")
        names = ("", "") if first is None else long_names(first, second)
        inks, glyphs = (here, other), (HERE, BESIDE)
        parts = [one for one in zip(inks, glyphs, names, strict=True) if one[2]]
        if beside.problem:
            again = "" if second is None else ", it is tried again"
            parts.append((bad, "▲", f"it cannot be shown beside{again}: {beside.problem}"))
        elif second is None:
            parts.append((other, BESIDE, "reading …"))
        remark = [(css(self._theme, "dim"), "", beside.remark)] if beside.remark else []
        return [*parts, *remark, *([(bad, "▲", self._refused)] if self._refused else [])]

    def _align(self, place: int) -> None:
        self._refused = self._beside.align(list(By)[place])
        self.refresh()

    def _close(self) -> None:
        self._beside.close()
        self._refused = ""
        self.refresh()
        self.closed.emit()
