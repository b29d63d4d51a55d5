"""Measurements in the signals: two cursors and their difference, statistics of each visible curve."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QTableWidget, QTableWidgetItem

from gateway.units import Unit, with_minus
from server_gui.core.desk.measuring import Measured
from server_gui.views.theme import Theme
from server_gui.views.widgets import columns
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

TITLES: Final = ("Channel", "A", "B", "B − A", "Min", "Max", "Mean", "SD", "Unit")
OF_SPAN: Final = (4, 5, 6, 7)  # columns over the visible span: below the others where there is less room
OF_CURSORS: Final = (1, 2, 3)
NAME: Final = 220  # wide at least, at text of 100 %: a channel; a narrower table is scrolled
ROWS, FEW_ROWS = 6, 4  # that are in sight at most, of one table and of two
FAR: Final = 10  # samples, with Shift
LARGEST: Final = 1e12  # smaller ones have all their whole digits
KEYS: Final = {Qt.Key.Key_A: 0, Qt.Key.Key_B: 1}
STEPS: Final = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}

Row = tuple[str, Unit, Measured]


class Measuring(Card):
    """`chosen` brings a cursor, `stepped` samples for the chosen one: by the keys A and B, and the arrows."""

    chosen = Signal(int)
    stepped = Signal(int)

    def __init__(self, theme: Theme) -> None:
        super().__init__("Cursors")
        self._theme = theme
        self.setAccessibleName("Cursors: A or B chooses one, the arrows move it, with Shift further")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.table = _table("What is measured")
        self.below = _table("What is measured over the visible span")
        self.below.hide()
        self.times = WrappingLabel("title")
        self.body.addWidget(self.times)
        self.body.addWidget(self.table)
        self.body.addWidget(self.below)
        self.hide()

    def show_readings(self, a_s: float, b_s: float, active: int, rows: Sequence[Row]) -> None:
        """Show the cursors' times (s, until the newest row), and every curve."""
        apart_s = b_s - a_s
        rate = "" if apart_s == 0.0 else f" · 1/Δt {1 / abs(apart_s):.4g} Hz"
        marks = ["▸ " if place == active else "" for place in (0, 1)]
        said = f"{marks[0]}A {a_s:.3f} s   {marks[1]}B {b_s:.3f} s   Δt {apart_s:+.3f} s{rate}"
        set_text(self.times, with_minus(said))
        if self.table.rowCount() != len(rows):
            for table in (self.table, self.below):
                table.setRowCount(len(rows))
        for place, (name, unit, found) in enumerate(rows):
            ends, span = (found.a, found.b), (found.low, found.high, found.mean, found.sd)
            at_ends, more = ([_text(unit, value) for value in values] for values in (ends, span))
            texts = (name, *at_ends, _text(unit, apart(unit, found.a, found.b)), *more, unit.symbol)
            for column, text in enumerate(texts):
                self._set(place, column, text)
        self._share()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.set_note("A or B chooses, ← → moves by a sample, with Shift by ten", "")

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.set_note("drag a cursor, or click here and use the keys", "")

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = Qt.Key(event.key())
        if key in KEYS:
            self.chosen.emit(KEYS[key])
        elif key in STEPS:
            far = event.modifiers() & Qt.KeyboardModifier.ShiftModifier
            self.stepped.emit(STEPS[key] * (FAR if far else 1))
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share()

    def _share(self) -> None:
        """Numbers are whole: with less room those of the span have a table of their own, below."""
        is_split = self._wanted() > self.table.viewport().width()
        self.below.setVisible(is_split)
        name = {0: self._theme.px(NAME)}
        columns.fit(self.table, name, unwanted=OF_SPAN if is_split else ())
        columns.fit(self.below, name, unwanted=OF_CURSORS)
        rows = min(self.table.rowCount(), FEW_ROWS if is_split else ROWS)
        for table in (self.table, self.below):
            self._fit(table, rows)

    def _wanted(self) -> int:
        """Return how wide one table is with every name and number whole."""
        titles = columns.title_widths(self.table)
        return sum(max(self.table.sizeHintForColumn(one), title) for one, title in enumerate(titles))

    def _fit(self, table: QTableWidget, rows: int) -> None:
        height = self._theme.px(20)
        table.verticalHeader().setDefaultSectionSize(height)
        header = table.horizontalHeader().sizeHint().height()
        is_wide = columns.header_of(table).length() > table.viewport().width()
        bar = table.horizontalScrollBar().sizeHint().height() if is_wide else 0
        if table.height() != header + rows * height + 2 + bar:
            table.setFixedHeight(header + rows * height + 2 + bar)

    def _set(self, row: int, column: int, text: str) -> None:
        for table in (self.table, self.below):
            item = table.item(row, column)
            if item is None:
                item = QTableWidgetItem()
                table.setItem(row, column, item)
                if 0 < column < len(TITLES) - 1:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                    item.setFont(self._theme.number_font())
            if item.text() != text:
                item.setText(text)
                if column == 0:
                    set_tip(item, text)


def _table(name: str) -> QTableWidget:
    table = QTableWidget(0, len(TITLES))
    table.setHorizontalHeaderLabels(TITLES)
    table.setAccessibleName(name)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
    table.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    table.setShowGrid(False)
    table.verticalHeader().hide()
    columns.prepare(table)
    return table


def _text(unit: Unit, value: float | None) -> str:
    return "–" if value is None else with_minus(_number(value * unit.scale))


def _number(shown: float) -> str:
    text = f"{shown:.5g}"
    return f"{shown:.0f}" if "e+" in text and abs(shown) < LARGEST else text


def apart(unit: Unit, one: float | None, other: float | None) -> float | None:
    """Return how much more the other is, as both are shown; None where one is not known.

    What is too little to be seen in both is told as it is.
    """
    if one is None or other is None:
        return None
    before, after = (float(_number(value * unit.scale)) for value in (one, other))
    return (after - before) / unit.scale or other - one
