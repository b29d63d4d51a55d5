"""A table of rows that have a key: a row is changed in its place, and what is chosen stays chosen."""

from collections.abc import Callable, Container, Hashable, Iterable
from typing import Any, Final, Generic, TypeVar

from PySide6.QtCore import (
    QAbstractItemModel,
    QAbstractTableModel,
    QModelIndex,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
)
from PySide6.QtWidgets import QAbstractItemView, QTableView

from server_gui.views.widgets.sort_header import SortHeader

Index = QModelIndex | QPersistentModelIndex
SORT_ROLE: Final = Qt.ItemDataRole.UserRole + 1
Row = TypeVar("Row")


class RowsModel(QAbstractTableModel, Generic[Row]):
    """`rows` as they were taken the last time; a new one is put at the end. A subclass gives their `data`.

    By the columns of `highest_first` people ask for the most, so that the first click gives that.
    """

    def __init__(
        self,
        titles: tuple[str, ...],
        key: Callable[[Row], Hashable],
        highest_first: Container[int] = (),
    ) -> None:
        super().__init__()
        self._titles = titles
        self._highest_first = highest_first
        self._key = key
        self.rows: list[Row] = []

    def take(self, rows: Iterable[Row]) -> None:
        """Show these from now on."""
        found = {self._key(row): row for row in rows}
        self._remove(found)
        self._change([found.pop(self._key(row)) for row in self.rows])
        if found:
            self.beginInsertRows(QModelIndex(), len(self.rows), len(self.rows) + len(found) - 1)
            self.rows.extend(found.values())
            self.endInsertRows()

    def _remove(self, found: dict[Hashable, Row]) -> None:
        for place in reversed(range(len(self.rows))):
            if self._key(self.rows[place]) not in found:
                self.beginRemoveRows(QModelIndex(), place, place)
                del self.rows[place]
                self.endRemoveRows()

    def _change(self, rows: list[Row]) -> None:
        changed = [place for place, row in enumerate(rows) if row != self.rows[place]]
        self.rows = rows
        if changed:
            self.dataChanged.emit(self.index(changed[0], 0), self.index(changed[-1], len(self._titles) - 1))

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return len(self._titles)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return self._titles[section]
        if role == Qt.ItemDataRole.InitialSortOrderRole:
            down = section in self._highest_first
            return (Qt.SortOrder.DescendingOrder if down else Qt.SortOrder.AscendingOrder).value
        return None


class Filtered(QSortFilterProxyModel):
    """Rows sorted by their `SORT_ROLE`, and filtered by a text in `column` (-1: in any)."""

    def __init__(self, model: QAbstractItemModel, column: int = -1) -> None:
        super().__init__()
        self.setSourceModel(model)
        self.setSortRole(SORT_ROLE)
        self.setFilterKeyColumn(column)
        self.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)


class RowsTable(QTableView):
    """Highest first by `column`, or lowest, until somebody clicks another title."""

    def __init__(
        self,
        model: QSortFilterProxyModel,
        name: str,
        column: int,
        order: Qt.SortOrder = Qt.SortOrder.DescendingOrder,
    ) -> None:
        super().__init__()
        self.setHorizontalHeader(SortHeader(self))
        self.setModel(model)
        self.setSortingEnabled(True)
        self.sortByColumn(column, order)
        self.setAccessibleName(name)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.setWordWrap(False)
        self.verticalHeader().hide()
