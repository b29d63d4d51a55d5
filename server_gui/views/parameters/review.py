"""The review: exactly what would be written, old → new, and nothing else; then write it, or try it first."""

from typing import Final

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.tuning.edits import ReviewedEdit
from server_gui.views.parameters.change_blocks import ChangeBlocks, mark_of
from server_gui.views.parameters.tree import range_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_primary, set_text
from server_gui.views.widgets.columns import title_widths
from server_gui.views.widgets.no_wheel_spin import NoWheelSpin
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.shrinking_label import ShrinkingLabel

TITLES: Final = ("Parameter", "Robot now", "", "New", "Unit", "Change", "Allowed", "")
NAME, OLD, ARROW, NEW, UNIT, BY, ALLOWED, MARK = range(len(TITLES))
NUMBERS: Final = (OLD, NEW, BY, ALLOWED)
BESIDE: Final = 16  # pixels of the table's frame and its bar
TRIAL_S: Final = 30
TITLE: Final = "Review{whose}: only this is written"
WRITE_TIP: Final = "One transaction{whose}: all or none, read back. It does not store to flash"
ALL_OR_NONE: Final = "All or none, read back from the device. Nothing is stored to flash."
SETTLE_MS: Final = 400  # a click that was meant for what stood there before does not count


class Review(QWidget):
    """`write` brings the changes that are shown, and the seconds of the trial or None; `back` leaves.

    `dropped` brings the names of changes that are not wanted any more.
    """

    write = Signal(tuple, object)
    dropped = Signal(tuple)
    back = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.changes: tuple[ReviewedEdit, ...] = ()
        self.acts = ""
        self._allowed = False
        self._settled = QTimer(self, singleShot=True)
        self._settled.timeout.connect(lambda: self._enable(self._allowed))
        self.title = PlainLabel()
        self.title.setObjectName("title")
        self.title.setWordWrap(True)
        self.table = QTableWidget(0, len(TITLES))
        self.table.setHorizontalHeaderLabels(TITLES)
        self.table.setAccessibleName("Changes to be written")
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.table.verticalHeader().hide()
        self.table.setShowGrid(False)
        header = self.table.horizontalHeader()
        header.setMinimumSectionSize(theme.px(16))
        for column in range(len(TITLES)):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        self.blocks = ChangeBlocks(theme)
        self.blocks.hide()
        self.said = PlainLabel()
        self.said.setObjectName("banner")
        self.said.setWordWrap(True)
        self.seconds = NoWheelSpin()
        self.seconds.setRange(5, 300)
        self.seconds.setValue(TRIAL_S)
        self.seconds.setSuffix(" s")
        self.seconds.setAccessibleName("Length of the trial")
        self.seconds.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.try_it = QPushButton("Try it for")
        self.try_it.setToolTip("Takes effect at once; the robot reverts it by itself unless you keep it")
        self.try_it.clicked.connect(lambda: self.write.emit(self.changes, float(self.seconds.value())))
        self.write_it = QPushButton("Write")
        self.write_it.setObjectName("primary")
        self.write_it.clicked.connect(lambda: self.write.emit(self.changes, None))
        self.leave_out = QPushButton("Leave out what is refused")
        self.leave_out.setToolTip("The other changes can be written then")
        self.leave_out.clicked.connect(lambda: self.dropped.emit(self._refused))
        self.leave_out.hide()
        back = QPushButton("Back")
        back.setShortcut("Esc")
        back.clicked.connect(self.back)
        above = QHBoxLayout()
        above.addWidget(back)
        above.addWidget(self.title, 1)
        row = QHBoxLayout()
        row.addStretch(1)
        for widget in (self.try_it, self.seconds, self.write_it):
            row.addWidget(widget)
        self.takes = ShrinkingLabel("dim")
        self.takes.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.takes.hide()
        everything = QVBoxLayout(self)
        everything.setContentsMargins(0, 0, 0, 0)
        everything.addLayout(above)
        everything.addWidget(self.table, 1)
        everything.addWidget(self.blocks, 1)
        everything.addWidget(self.said)
        everything.addWidget(self.leave_out)
        everything.addWidget(self.takes)
        everything.addLayout(row)

    def show_changes(self, changes: tuple[ReviewedEdit, ...], acts: str = "", whose: str = "") -> None:
        """Show the changes to be written, on what that `acts` at once, and `whose` they are."""
        set_text(self.title, TITLE.format(whose=f" – {whose}" if whose else ""))
        set_tip(self.write_it, WRITE_TIP.format(whose=f" to {whose}" if whose else ""))
        self.changes, self.acts = changes, acts
        self.table.setRowCount(len(changes))
        for row, change in enumerate(changes):
            self._fill(row, change)
        self.blocks.show_changes(changes)
        self._fit()
        problems = [f"{change.name}: {change.problem}" for change in changes if change.problem]
        elsewhere = [change.name for change in changes if change.elsewhere]
        said = [*problems]
        self.leave_out.setVisible(0 < len(problems) < len(changes))
        if elsewhere:
            said.append(
                f"Changed elsewhere since you began: {', '.join(elsewhere)}. Writing overwrites that."
            )
        self.said.setText("\n".join([*(said or [ALL_OR_NONE]), *filter(None, [acts])]))
        self.said.setProperty("tone", "bad" if said else "warn" if acts else "good")
        self.said.style().polish(self.said)
        self._enable(False)
        self._allowed = bool(changes) and not problems
        self._settled.start(SETTLE_MS)
        count = len(elsewhere) or len(changes)
        self.write_it.setText(f"{'Overwrite' if elsewhere else 'Write'} {count}{' now' if acts else ''}")
        self._lead(self.try_it if acts else self.write_it)

    def say_how_long(self, *takes: str) -> None:
        """Say how long a trial must be for a verdict, the fullest wording first; nothing where none knows."""
        self.takes.setVisible(bool(takes))
        self.takes.say(*(takes or ("",)))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    @property
    def _refused(self) -> tuple[str, ...]:
        return tuple(change.name for change in self.changes if change.problem)

    def take_keyboard(self) -> None:
        """Have the keyboard where the changes are read."""
        (self.blocks if self.table.isHidden() else self.table).setFocus(Qt.FocusReason.OtherFocusReason)

    def _fit(self) -> None:
        """Show the changes below each other where not all of a table has room."""
        titles = title_widths(self.table)
        wide = [max(self.table.sizeHintForColumn(column), title) for column, title in enumerate(titles)]
        is_narrow = sum(wide) + BESIDE > self.width()
        had_keyboard = self.table.hasFocus() or self.blocks.hasFocus()
        if self.blocks.isHidden() is is_narrow:
            self.table.setHidden(is_narrow)
            self.blocks.setHidden(not is_narrow)
            if had_keyboard:
                self.take_keyboard()

    def _lead(self, leading: QPushButton) -> None:
        """Make this button the one that is meant: where somebody may stand in it, the trial."""
        for button in (self.try_it, self.write_it):
            set_primary(button, button is leading)

    def _enable(self, on: bool) -> None:
        self.try_it.setEnabled(on)
        self.write_it.setEnabled(on)

    def _fill(self, row: int, change: ReviewedEdit) -> None:
        old = "–" if change.old is None else change.unit.editable(change.old)
        mark = mark_of(change)
        new, allowed = change.unit.editable(change.new), range_text(*change.allowed, change.unit)
        texts = (change.name, old, "→", new, change.unit.symbol, change.by, allowed, mark)
        for column, text in enumerate(texts):
            item = QTableWidgetItem(text)
            if column in NUMBERS:
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            if column == NEW:
                item.setFont(self._theme.text_font(bold=True))
            if column == MARK:
                item.setForeground(self._theme.colour("bad"))
            set_tip(item, change.problem or change.name)
            self.table.setItem(row, column, item)
