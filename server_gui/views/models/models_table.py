"""Every model, newest first: what it predicts, whom it serves, by whose word, how well judged, how old."""

from typing import Any, Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QAbstractItemView

from gateway.amounts import counted
from gateway.plain_text import plain
from ml.registry.card import age_days
from server_gui.core.models.catalogue import Entry
from server_gui.core.models.comparison import headline, week_short
from server_gui.core.models.names import SOURCES
from server_gui.views.theme import Theme
from server_gui.views.widgets import columns
from server_gui.views.widgets.plain import tip
from server_gui.views.widgets.rows import SORT_ROLE, Filtered, Index, RowsModel, RowsTable

TITLES: Final = ("Model", "Serves", "Signed", "Judged", "Age, days", "Right last week", "Learned from")
NAME, SERVES, SIGNED, JUDGED, AGE, WEEK, FROM = range(len(TITLES))
NUMBERS: Final = frozenset({JUDGED, AGE})
NAMES: Final = {NAME: 190, SERVES: 84, SIGNED: 70, WEEK: 90, FROM: 90}  # wide at least, at text of 100 %
FEWEST, MOST = 2, 8  # rows that it has room for; more are scrolled
SPARE: Final = (FROM, AGE, SIGNED)  # left out in this order where there is less room; tips have all


class ModelsModel(RowsModel[Entry]):
    """A row a model."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(TITLES, lambda entry: entry.card.id)
        self._theme = theme

    def data(self, index: Index, role: int = 0) -> Any:
        entry, column = self.rows[index.row()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return plain(_cells(entry)[column])
            case _ if role == SORT_ROLE:
                return -entry.card.made.timestamp() if column == AGE else _cells(entry)[column]
            case Qt.ItemDataRole.ToolTipRole:
                words = "; ".join(entry.signed) if column == SIGNED else ""
                return tip(f"{words or _cells(entry)[column]}\n{entry.card.id}, {entry.card.recipe}")
            case Qt.ItemDataRole.TextAlignmentRole if column in NUMBERS:
                return Qt.AlignmentFlag.AlignCenter  # words stand beside them
            case Qt.ItemDataRole.FontRole if column in NUMBERS:
                return self._theme.number_font()
        return None


class ModelsTable(RowsTable):
    """Names are cut in their middle; numbers have the room that they need."""

    def __init__(self, model: ModelsModel, theme: Theme) -> None:
        self._theme = theme
        self._rows, self._filtered = model, Filtered(model)
        super().__init__(self._filtered, "Models", AGE, Qt.SortOrder.AscendingOrder)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        columns.prepare(self)
        for changed in (model.dataChanged, model.rowsInserted, model.rowsRemoved):
            changed.connect(self._fit)
        theme.changed.connect(self._restyle)
        self._restyle()

    @property
    def chosen(self) -> Entry | None:
        """The model that is chosen."""
        rows = [self._filtered.mapToSource(place).row() for place in self.selectionModel().selectedRows()]
        return self._rows.rows[rows[0]] if rows and rows[0] < len(self._rows.rows) else None

    def choose(self, model: str) -> None:
        """Choose a model by its id, where it is listed."""
        for row, entry in enumerate(self._rows.rows):
            if entry.card.id == model:
                self.selectRow(self._filtered.mapFromSource(self._rows.index(row, 0)).row())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        rows = min(max(self._rows.rowCount(), FEWEST), MOST)
        height = rows * self.verticalHeader().defaultSectionSize() + 2 * self.frameWidth()
        self.setFixedHeight(height + self.horizontalHeader().sizeHint().height())
        columns.fit(self, {column: self._theme.px(least) for column, least in NAMES.items()}, SPARE)

    def _restyle(self) -> None:
        self.verticalHeader().setDefaultSectionSize(self._theme.px(24))
        self._fit()


def _cells(entry: Entry) -> tuple[str, ...]:
    card = entry.card
    sessions = f"{counted(len(card.learned), 'session')}, " if card.learned else ""
    return (
        entry.name,
        entry.whom,
        entry.signature,
        headline(card),
        f"{age_days(card):.0f}",
        week_short(entry),
        f"{sessions}{SOURCES[card.source]}",
    )
