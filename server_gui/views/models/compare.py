"""One model beside another: figures, classes, wearers, calibration, and how right it was last week."""

from typing import Final

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QBoxLayout,
    QComboBox,
    QHBoxLayout,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from gateway.amounts import NONE
from gateway.plain_text import plain
from server_gui.core.models.catalogue import Catalogue, Entry
from server_gui.core.models.comparison import (
    OTHERS,
    Row,
    last_week,
    notes,
    percent,
    rows,
    signed,
    unknown_to,
    usual_other,
)
from server_gui.views.models.calibration import CalibrationPlot, Curve
from server_gui.views.theme import Theme
from server_gui.views.widgets import columns
from server_gui.views.widgets.card import Card, set_text, set_tone
from server_gui.views.widgets.plain import PlainLabel, unbroken

TITLES: Final = ("", "This model", "Other", "Points", "Verdict", "Decisions")
NAME, ONE, OTHER, DIFFERENCE, VERDICT, DECISIONS = range(len(TITLES))
MARKS: Final = {
    "better": ("▲ better", "good"),
    "worse": ("▼ worse", "bad"),
    "alike": ("= alike", "dim"),
    OTHERS: ("not comparable", "dim"),
    "": ("", "dim"),
}
NARROW: Final = 940  # at text of 100 %: no room for the plot beside the figures
CHOOSE: Final = "Choose a model above to see how well it was judged."
ROWS: Final = 20  # as many are whole at once: what is scrolled is the page, not a table within it
NARROW_ROW: Final = 480  # likewise, for the choice beside the words


class Compare(Card):
    """Comparison of the chosen model."""

    def __init__(self, theme: Theme) -> None:
        super().__init__("Compare")
        self._theme = theme
        self._shown: object = None
        self._judged = ""
        self._entry: Entry | None = None
        self._found = Catalogue()
        self.said = _words()
        self.week, self.notes, self.warning = _words(), _words(), _words()
        for part in (self.notes, self.warning):
            part.setObjectName("dim")
        set_tone(self.warning, "warn")
        self.other = QComboBox()
        self.other.setAccessibleName("Compare with")
        self.other.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.other.setMinimumContentsLength(24)
        self.other.currentIndexChanged.connect(self._fill)
        self.table = self._table()
        self.plot = CalibrationPlot(theme)
        self._legend = _words()
        self._legend.setTextFormat(Qt.TextFormat.PlainText)
        self._build()
        theme.changed.connect(self._fill)
        self.show_entry(None, Catalogue())

    def show_entry(self, entry: Entry | None, found: Catalogue, judged: str = "") -> None:
        """Show this model, as training has `judged` it; beside what serves in its place.

        Until somebody chooses another.
        """
        if (entry, found, judged) == self._shown:
            return
        self._judged = judged
        same = self._entry is not None and entry is not None and self._entry.card.id == entry.card.id
        chosen = str(self.other.currentData() or "") if same else ""
        self._shown, self._entry, self._found = (entry, found, judged), entry, found
        self._offer(entry, found, chosen)
        self._fill()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        direction = QBoxLayout.Direction
        is_narrow = self.width() < self._theme.px(NARROW)
        self._both.setDirection(direction.TopToBottom if is_narrow else direction.LeftToRight)
        is_narrow = self.width() < self._theme.px(NARROW_ROW)
        self._row.setDirection(direction.TopToBottom if is_narrow else direction.LeftToRight)
        QTimer.singleShot(0, self, self._fit)  # once the table has its new width

    # --- inside

    def _offer(self, entry: Entry | None, found: Catalogue, chosen: str) -> None:
        """Offer the other models of its task; what was chosen stays, else the usual one is."""
        self.other.blockSignals(True)
        self.other.clear()
        if entry is not None:
            for each in found.entries:
                if each.card.task == entry.card.task and each.card.id != entry.card.id:
                    serves = " (serves)" if each.card.id == entry.serving else ""
                    self.other.addItem(plain(f"{each.name}{serves}"), each.card.id)
            usual = usual_other(entry, found)
            wanted = chosen or ("" if usual is None else usual.card.id)
            self.other.setCurrentIndex(max(0, self.other.findData(wanted)))
        self.other.blockSignals(False)

    def _build(self) -> None:
        self._with = PlainLabel("beside")
        self._with.setObjectName("dim")
        choice = QHBoxLayout()
        choice.addWidget(self._with)
        choice.addWidget(self.other, 1)
        self._row = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._row.addWidget(self.said, 1)
        self._row.addLayout(choice)
        right = QVBoxLayout()
        right.addWidget(self._legend)
        right.addWidget(self.plot, 1)
        self._right = QWidget()
        right.setContentsMargins(0, 0, 0, 0)
        self._right.setLayout(right)
        self._both = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._both.addWidget(self.table, 3)
        self._both.addWidget(self._right, 2)
        self.body.addLayout(self._row)
        self.body.addWidget(self.week)
        self.body.addWidget(self.warning)
        self.body.addWidget(self.notes)
        self.body.addLayout(self._both, 1)

    def _table(self) -> QTreeWidget:
        table = QTreeWidget()
        table.setHeaderLabels(TITLES)
        table.setAccessibleName("How both were judged")
        table.setRootIsDecorated(False)
        table.setUniformRowHeights(True)
        columns.prepare(table)
        return table

    def _fill(self) -> None:
        entry = self._entry
        for part in (self._with, self.other, self.week, self.table, self._right):
            part.setVisible(entry is not None)
        self.table.clear()
        if entry is None:
            set_text(self.said, CHOOSE)
            self.notes.hide()
            self.warning.hide()
            return
        other = self._found.find(str(self.other.currentData() or ""))
        for part in (self._with, self.other):
            part.setVisible(other is not None)
        set_text(self.said, f"{entry.name}; serves {entry.whom}{_signed(entry)}")
        set_text(self.week, f"Last week: {last_week(entry)}{self._its_week(other)}")
        lost = "" if other is None else unknown_to(entry.card, [other.card], "the other")
        set_text(self.warning, f"▲ {lost}")
        self.warning.setVisible(bool(lost))
        told = "\n".join(filter(None, (self._judged, " ".join(notes(entry, other)))))
        set_text(self.notes, unbroken(told))
        self.notes.setVisible(bool(told))
        self._fill_rows(rows(entry.card, None if other is None else other.card))
        self.table.setMinimumHeight(self._high())
        self._fill_plot(entry, other)
        self._fit()

    def _fit(self) -> None:
        """Whole numbers; what a model is better or worse at is seen before how often it was judged."""
        alone = (OTHER, DIFFERENCE, VERDICT) if self.other.isHidden() else ()
        columns.fit(self.table, {NAME: self._theme.px(90)}, (DECISIONS, DIFFERENCE), alone)

    def _high(self) -> int:
        """Return how high the table is with its rows, or as many of them as are whole at once."""
        tops = [self.table.topLevelItem(place) for place in range(self.table.topLevelItemCount())]
        count = sum(1 + top.childCount() for top in tops if top is not None)
        row = self.table.sizeHintForRow(0) if count else 0
        return self.table.header().sizeHint().height() + min(count, ROWS) * row + 2 * self.table.frameWidth()

    def _its_week(self, other: Entry | None) -> str:
        return "" if other is None else f"\nThe other, last week: {last_week(other)}"

    def _fill_rows(self, found: list[Row]) -> None:
        tops: dict[str, QTreeWidgetItem] = {}
        for row in found:
            top = tops.get(row.group)
            if top is None:
                top = tops[row.group] = QTreeWidgetItem(self.table, [row.group])
                top.setFont(NAME, self._theme.text_font(bold=True))
                top.setExpanded(True)
            self._add_row(top, row)

    def _add_row(self, top: QTreeWidgetItem, row: Row) -> None:
        words, colour = MARKS[row.verdict]
        count = NONE if row.decisions is None else f"{row.decisions:,}"
        cells = [row.name, percent(row.one), percent(row.other), signed(row.difference), words, count]
        item = QTreeWidgetItem(top, [plain(cell) for cell in cells])
        item.setForeground(VERDICT, self._theme.colour(colour))
        item.setTextAlignment(VERDICT, Qt.AlignmentFlag.AlignCenter)  # numbers stand beside it
        for column in (ONE, OTHER, DIFFERENCE, DECISIONS):
            item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            item.setFont(column, self._theme.number_font())

    def _fill_plot(self, entry: Entry, other: Entry | None) -> None:
        curves = [Curve("this model", entry.card.metrics.calibration, "accent")]
        if other is not None:
            curves.append(Curve("the other", other.card.metrics.calibration, "right", is_dashed=True))
        self.plot.show_curves(curves)
        set_text(
            self._legend, "Calibration: ● this model" + ("" if other is None else "   ○ the other (dashed)")
        )


def _signed(entry: Entry) -> str:
    return "" if entry.signature == NONE else f" ({entry.signature})"


def _words() -> PlainLabel:
    label = PlainLabel()
    label.setWordWrap(True)
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label
