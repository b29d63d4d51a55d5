"""The tools above the signals: span, pause and zoom, events, exports; what arranges; what is said."""

from collections.abc import Callable, Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeySequence, QResizeEvent, QShortcut
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.plain import set_tip

SPANS_S: Final = (2, 5, 10, 30, 60, 100)


class Tools(QWidget):
    """Stand in as many lines as they need; keys hold in all of `page`.

    `looked` asks to see so many times of the time, moved by a share of it; `turned` for the event before (−1)
    or after (1); `noted` for a note.
    """

    looked = Signal(float, float)
    turned = Signal(int)
    noted = Signal()

    def __init__(self, page: QWidget, menus: Sequence[QPushButton]) -> None:
        super().__init__(page)
        self.setMinimumWidth(1)  # whatever lines they stand in now
        self.span = QComboBox()
        self.span.addItems([f"{seconds} s" for seconds in SPANS_S])
        self.span.setCurrentIndex(SPANS_S.index(10))
        self.span.setAccessibleName("The visible time span")
        self.pause = _switch("Pause view", "Freeze the view; data and recording continue")
        self.follow = QPushButton("Fit")
        self.follow.setToolTip("Undo zoom: the range follows the data again")
        self.box = _switch(
            "Box zoom", "Drag a box around the part to see; otherwise a drag moves, and the wheel zooms"
        )
        self.cursors = _switch(
            "Cursors",
            "Two cursors with their difference, and statistics of every curve over the visible span",
        )
        self.as_csv, self.as_png = QPushButton("CSV …"), QPushButton("PNG …")
        self.as_csv.setAccessibleName("Save what is on screen as CSV")
        self.as_png.setAccessibleName("Save what is on screen as a picture")
        self.before, self.next = QPushButton("◀"), QPushButton("▶")
        for button, way, which in ((self.before, -1, "before"), (self.next, 1, "after")):
            button.setAccessibleName(f"To the event {which}")
            set_tip(button, f"To the event {which}: a stop, fault, write, trial or mark")
            button.clicked.connect(lambda _=False, way=way: self.turned.emit(way))
        self.expression = _switch("Expression", "A computed curve, such as left minus right")
        self.trigger = _switch(
            "Trigger", "Freeze the view when a curve meets a condition, as an oscilloscope does"
        )
        self.note = QPushButton("Note …")
        self.note.setToolTip("A note on the time axis, kept in the recording: at the active cursor, or now")
        self.note.clicked.connect(self.noted)
        self.said = ElidedLabel("dim")
        view = (self.span, self.pause, self.follow, self.box, self.cursors)
        events = (self.before, self.next, self.as_csv, self.as_png)
        self._groups: tuple[Sequence[QWidget], ...] = (
            (*view, *events),
            (*menus, self.expression, self.trigger, self.note),
        )
        self._lines: list[list[QWidget]] = []
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        self._rows = [QHBoxLayout() for _ in range(sum(map(len, self._groups)))]  # most of them empty
        for row in self._rows:
            row.addStretch(1)
            rows.addLayout(row)
        self._fit()
        self._keys(page)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Place the message where most room is left."""
        lines = [line for group in self._groups for line in self._broken(group)]
        if lines == self._lines:
            return
        for row, line in zip(self._rows, self._lines, strict=False):
            for widget in (*line, self.said):
                row.removeWidget(widget)
        self._lines = lines
        for row, line in zip(self._rows, lines, strict=False):
            for place, widget in enumerate(line):
                row.insertWidget(place, widget)
        widths = [sum(widget.sizeHint().width() for widget in line) for line in lines]
        shortest = widths.index(min(widths))
        self._rows[shortest].insertWidget(len(lines[shortest]), self.said, 100)

    def _broken(self, group: Sequence[QWidget]) -> list[list[QWidget]]:
        """Return these in lines that are not wider than this."""
        lines: list[list[QWidget]] = [[]]
        left = width = self.width()
        for widget in group:
            needs = widget.sizeHint().width()
            if needs > left and lines[-1]:
                lines.append([])
                left = width
            lines[-1].append(widget)
            left -= needs + self._rows[0].spacing()
        return lines

    def _keys(self, page: QWidget) -> None:
        """Keys of this page; the sheet of keys tells them."""
        buttons = {
            "Ctrl+Shift+P": self.pause,
            "Ctrl+0": self.follow,
            "Ctrl+D": self.cursors,
            "Ctrl+E": self.as_csv,
            "Ctrl+Up": self.before,
            "Ctrl+Down": self.next,
            "Ctrl+Shift+E": self.expression,
            "Ctrl+Shift+T": self.trigger,
            "Ctrl+Shift+N": self.note,
        }
        for key, button in buttons.items():
            button.setShortcut(key)
            button.setToolTip(" ".join(filter(None, (button.toolTip(), f"({key})"))))
        moves: dict[str, Callable[[], None]] = {
            "Ctrl++": lambda: self.looked.emit(0.5, 0.0),
            "Ctrl+-": lambda: self.looked.emit(2.0, 0.0),
            "Ctrl+Left": lambda: self.looked.emit(1.0, -0.25),
            "Ctrl+Right": lambda: self.looked.emit(1.0, 0.25),
        }
        for key, move in moves.items():
            shortcut = QShortcut(QKeySequence(key), page, move)
            shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)


def _switch(text: str, tip: str) -> QPushButton:
    button = QPushButton(text)
    button.setCheckable(True)
    set_tip(button, tip)
    return button
