"""Sentences where there is little room: words are left out, never a part of a number."""

import pytest
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QApplication, QStyleOptionViewItem, QTableWidget, QTableWidgetItem

from ml.store.sessions import Session
from server_gui.views.recordings.sessions import NOTES, ROW, WRAPPED, SessionModel, SessionsTable
from server_gui.views.theme import Theme
from server_gui.views.widgets.elided import SentenceDelegate, whole_words
from server_gui.views.widgets.rows import Filtered
from tests.gui.fakes import destroy

SAID = "its position jumped by 31.9° within 50 ms, which is not its speed"


@pytest.mark.parametrize("room", range(0, 500, 7))
def test_half_a_number_is_never_shown(qt: QApplication, room: int) -> None:
    metrics = QFontMetrics(QApplication.font())
    shown = whole_words(SAID, metrics, room)
    assert shown == SAID or (shown.endswith(" …") and SAID.startswith(f"{shown.removesuffix(' …')} "))
    assert metrics.horizontalAdvance(shown) <= max(room, metrics.horizontalAdvance("its …"))


def test_of_a_sentence_with_a_long_path_as_much_is_shown_as_has_room(qt: QApplication) -> None:
    metrics = QFontMetrics(QApplication.font())
    path = "/tmp/a-folder-with-a-long-name/spool/of-this-computer"
    for said in (f"recording: {path} cannot be read", f"{path}: it cannot be read"):
        room = metrics.horizontalAdvance(said[:40])
        shown = whole_words(said, metrics, room)
        assert said.startswith(shown.removesuffix("…").rstrip())
        assert metrics.horizontalAdvance(shown) <= room
        assert len(shown) > 30, "more than its first word"


def test_a_sentence_in_a_table_ends_with_a_whole_word_and_other_columns_are_as_ever(qt: QApplication) -> None:
    table, delegate = QTableWidget(1, 2), SentenceDelegate(1)
    for column in (0, 1):
        table.setItem(0, column, QTableWidgetItem(SAID))
    option = QStyleOptionViewItem()
    option.widget, option.rect = table, table.rect()
    option.rect.setWidth(table.fontMetrics().horizontalAdvance(SAID[:25]))
    texts = []
    for column in (0, 1):
        delegate.initStyleOption(option, table.model().index(0, column))
        texts.append(option.text)
    assert texts[0] == SAID
    assert texts[1] in ("its position jumped by …", "its position jumped …")
    destroy(table)


def test_notes_of_a_recording_stand_in_as_many_lines_as_they_need(theme: Theme) -> None:
    notes = "new insoles, left one with the spare cable; a stone in the shoe until 10:31"
    model = SessionModel(theme)
    model.take([Session("walker", "s1", notes=notes), Session("walker", "s2")])
    table = SessionsTable(Filtered(model), theme)
    for width in (420, 900):
        table.resize(width, 200)
        table.show()
        QApplication.processEvents()
        assert not table.isColumnHidden(NOTES)
        rows = [row for row in range(2) if table.model().index(row, NOTES).data()]
        room = table.columnWidth(NOTES) - 6
        box = table.fontMetrics().boundingRect(0, 0, room, 1000, WRAPPED, notes)
        assert table.rowHeight(rows[0]) >= box.height()
        assert table.rowHeight(1 - rows[0]) == theme.px(ROW)
    destroy(table)
