"""Rows by their key: what is the same stays where it is, and only what has changed is told."""

from typing import Any

import pytest
from PySide6.QtCore import QItemSelectionModel, Qt
from PySide6.QtWidgets import QApplication

from server_gui.views.widgets.rows import SORT_ROLE, Filtered, Index, RowsModel, RowsTable
from tests.gui.fakes import destroy

Pair = tuple[str, int]


class Pairs(RowsModel[Pair]):
    def __init__(self) -> None:
        super().__init__(("Name", "Number"), lambda pair: pair[0])
        self.told: list[tuple[int, int]] = []
        self.dataChanged.connect(lambda first, last, *_: self.told.append((first.row(), last.row())))

    def data(self, index: Index, role: int = 0) -> Any:
        wanted = role in (Qt.ItemDataRole.DisplayRole, SORT_ROLE)
        return self.rows[index.row()][index.column()] if wanted else None


@pytest.fixture
def pairs(qt: QApplication) -> Pairs:
    return Pairs()


def test_only_the_rows_between_the_first_and_the_last_change_are_told(pairs: Pairs) -> None:
    pairs.take([("a", 1), ("b", 2), ("c", 3), ("d", 4)])
    assert pairs.told == []
    pairs.take([("d", 4), ("c", 9), ("b", 8), ("a", 1)])
    assert pairs.told == [(1, 2)]
    assert pairs.rows == [("a", 1), ("b", 8), ("c", 9), ("d", 4)], "a row stays where it is"


def test_what_is_chosen_stays_chosen_when_others_come_and_go(pairs: Pairs) -> None:
    pairs.take([("a", 1), ("b", 2), ("c", 3)])
    table = RowsTable(Filtered(pairs), "Pairs", 1)
    place = next(row for row in range(3) if table.model().index(row, 0).data() == "b")
    flags = QItemSelectionModel.SelectionFlag.ClearAndSelect | QItemSelectionModel.SelectionFlag.Rows
    table.selectionModel().select(table.model().index(place, 0), flags)
    pairs.take([("b", 7), ("c", 3), ("z", 9)])
    assert [index.data() for index in table.selectionModel().selectedRows()] == ["b"]
    assert [table.model().index(row, 0).data() for row in range(3)] == ["z", "b", "c"], "highest first"
    destroy(table)
