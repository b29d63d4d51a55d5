"""Two recordings side by side: what changed from one to the other, and what of the walk moved with it."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
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

from gateway.amounts import counted
from gateway.plain_text import plain
from gateway.units import Units
from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.configuration_changes import Changes, Difference, not_known
from server_gui.core.evidence.comparison import Evidence, Measured, Word
from server_gui.core.evidence.wording import interval, number, share
from server_gui.core.tuning.edits import brief, unit_of
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import PlainLabel, set_tip

CHANGED: Final = ("", "What changed", "Before", "After")
MOVED: Final = ("Metric", "Word", "Before", "After", "Difference", "95 % interval")
DIFFERENT: Final = (Word.WORSE, Word.BETTER, Word.CHANGED)
TONES: Final = {Word.WORSE: "bad", Word.BETTER: "good"}
NOT_THE_CAUSE: Final = (
    "Differences are without a slow drift and at equal speed, so they are not just after − before. "
    "This moved at the same time, perhaps for another reason: two recordings differ in more than anybody has "
    "noted. A trial of one change on one day shows what it does."
)


class ComparisonPage(QWidget):
    """`left` when somebody goes back to the list."""

    left = Signal()

    def __init__(self, archive: Archive, theme: Theme) -> None:
        super().__init__()
        self._archive = archive
        self._theme = theme
        self._shown: object = None
        back = QPushButton("Back")
        back.setShortcut("Esc")
        back.clicked.connect(self.left)
        self.title = PlainLabel()
        self.title.setObjectName("title")
        self.title.setWordWrap(True)
        row = QHBoxLayout()
        row.addWidget(back)
        row.addWidget(self.title, 1)
        self.changed, self.moved = _table(CHANGED, "What changed", 1), _table(MOVED, "What moved with it", 0)
        self.unknown, self.verdict = _words(), _words()
        first, second = Card("What changed"), Card("What moved with it")
        first.body.addWidget(self.changed, 1)
        first.body.addWidget(self.unknown)
        second.body.addWidget(self.verdict)
        second.body.addWidget(self.moved, 1)
        for card in (first, second):
            card.body.addStretch(0)  # what is said stands at the top while there is no row
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addLayout(row)
        everything.addWidget(first, 1)
        everything.addWidget(second, 1)

    def refresh(self) -> None:
        """Show what is known by now."""
        compared = self._archive.compared
        shown = compared.revision, self._archive.shown_units
        if compared.pair is None or shown == self._shown:
            return
        self._shown = shown
        before, after = compared.pair
        set_text(self.title, f"From {before.session} of {before.robot} to {after.session} of {after.robot}")
        self._show_changes(compared.changes, compared.problem)
        self._show_moved(compared.moved, compared.problem)

    def _show_changes(self, found: Changes | None, problem: str) -> None:
        rows = () if found is None else found.differences
        cells = [(str(one.kind), one.what, *in_units(one, self._archive.shown_units)) for one in rows]
        _fill(self.changed, cells)
        self.changed.setVisible(bool(cells))
        if found is None:
            set_text(self.unknown, f"Not known: {problem}" if problem else "looking …")
            return
        alike = f"{counted(found.same, 'thing', 'things')} recorded in both, and the same."
        said = ["" if cells else "Nothing recorded in both has changed.", alike, *not_known(found)]
        set_text(self.unknown, "\n".join(filter(None, said)))

    def _show_moved(self, found: Evidence | None, problem: str) -> None:
        measured = [] if found is None else [one for one in found.metrics if one.word in DIFFERENT]
        measured.sort(key=lambda one: -abs(one.size or 0.0))
        _fill(self.moved, [_cells(one) for one in measured])
        self.moved.setVisible(bool(measured))
        for row, one in enumerate(measured):
            item = self.moved.item(row, 1)
            if item is not None and one.word in TONES:
                item.setForeground(self._theme.colour(TONES[one.word]))
        if found is None:
            set_text(self.verdict, f"Not known: {problem}" if problem else "reading both walks …")
            return
        cycles = f"{counted(found.cycles_before, 'gait cycle')} before, {found.cycles_after} after"
        notes = "".join(f" · {note}" for note in found.notes)
        others = (
            f"{word}: {counted(count, 'metric')}"
            for word in (Word.SAME, Word.FEW, Word.NO_DATA)
            if (count := sum(one.word is word for one in found.metrics))
        )
        set_text(self.verdict, f"{found.word} · {cycles}{notes} · {' · '.join(others)}\n{NOT_THE_CAUSE}")


def in_units(one: Difference, units: Units) -> tuple[str, str]:
    """Return both values as the window shows them: those of a parameter in its unit there."""
    if one.numbers is None or one.unit is None:
        return one.before, one.after
    unit = unit_of(one.what, one.unit, units)
    before, after = (brief(unit, value) for value in one.numbers)
    if before == after:  # alike in these digits
        before, after = (unit.editable(value) for value in one.numbers)
    return f"{before} {unit.symbol}".rstrip(), f"{after} {unit.symbol}".rstrip()


def _cells(one: Measured) -> tuple[str, ...]:
    values = (f"{number(value)} {one.unit}".rstrip() for value in (one.before, one.after))
    return (one.title, str(one.word), *values, share(one), interval(one))


def _words() -> PlainLabel:
    label = PlainLabel()
    label.setWordWrap(True)
    label.setObjectName("dim")
    return label


def _table(titles: Sequence[str], name: str, wide: int) -> QTableWidget:
    table = QTableWidget(0, len(titles))
    table.setHorizontalHeaderLabels(list(titles))
    table.setAccessibleName(name)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
    table.verticalHeader().hide()
    table.setShowGrid(False)
    header = table.horizontalHeader()
    header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    for column in range(len(titles)):
        stretches = column == wide
        modes = QHeaderView.ResizeMode
        header.setSectionResizeMode(column, modes.Stretch if stretches else modes.ResizeToContents)
    return table


def _fill(table: QTableWidget, rows: Sequence[Sequence[str]]) -> None:
    table.setRowCount(len(rows))
    for row, cells in enumerate(rows):
        for column, text in enumerate(cells):
            item = QTableWidgetItem(plain(text))
            set_tip(item, text)
            table.setItem(row, column, item)
