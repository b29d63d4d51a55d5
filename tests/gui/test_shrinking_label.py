"""No number is cut: a label says less instead, and tables leave out whole columns."""

import pytest
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QApplication

from server_gui.views.overview.joint_table import (
    CURRENT,
    ERROR,
    TEMPERATURE,
    TORQUE,
    VELOCITY,
    JointModel,
    JointTable,
)
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from tests.gui.fakes import Bench, destroy
from tests.support.desk import looked, telemetry, walking

WORDINGS = ("trunk 12.5° forward", "trunk 12.5°", "12.5°")


def test_the_fullest_wording_that_has_room_is_shown_and_the_last_is_whole(theme: Theme) -> None:
    label = ShrinkingLabel()
    label.say(*WORDINGS)
    widths = [label.fontMetrics().horizontalAdvance(text) for text in WORDINGS]
    for width, text in zip(widths, WORDINGS, strict=True):
        label.resize(width + 1, 20)
        assert label.shown == text
        assert label.is_whole
    assert label.minimumSizeHint().width() == widths[-1]
    assert label.sizeHint().width() == widths[0]
    assert label.accessibleName() == WORDINGS[0]


def test_labels_beside_each_other_are_of_one_form(theme: Theme) -> None:
    left, right = ShrinkingLabel(), ShrinkingLabel()
    left.speak_alike(right)
    left.say("LEFT  933 N", "L  933 N")
    right.say("RIGHT  0 N", "R  0 N")
    room = left.fontMetrics().horizontalAdvance("LEFT  933 N")
    left.resize(room + 1, 20)
    right.resize(room + 1, 20)
    assert (left.shown, right.shown) == ("LEFT  933 N", "RIGHT  0 N")
    left.resize(room - 1, 20)
    assert (left.shown, right.shown) == ("L  933 N", "R  0 N")


def test_in_a_narrow_card_the_name_gives_way_to_the_number(theme: Theme) -> None:
    card = Card("Posture of whoever stands in it")
    card.set_note("STALE, 12.3 s old", "12.3 s old")
    card.show()
    for width in (110, 150, 250, 500):
        card.resize(width, 100)
        QApplication.processEvents()
        assert card._note.is_whole, width
    destroy(card)


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("width", [420, 640, 1100])
def test_the_joint_table_cuts_no_number(theme: Theme, bench: Bench, width: int, scale: float) -> None:
    theme.set(scale=scale)
    bench.station.take([walking(10, -3600.0), looked()])
    model = JointModel(bench.desk, theme)
    model.refresh()
    table = JointTable(model, theme)
    table.resize(round(width * scale), 300)
    table.show()
    for column in range(model.columnCount()):
        if table.isColumnHidden(column) or column == ERROR:
            continue
        numbers = 2 <= column <= 6
        metrics = QFontMetrics(theme.number_font() if numbers else theme.text_font())
        assert table.columnWidth(column) >= model.widest(column, metrics)
    assert not table.isColumnHidden(TORQUE)
    assert not table.isColumnHidden(ERROR)
    destroy(table)


@pytest.mark.parametrize(("code", "column"), [(0x4210, TEMPERATURE), (0x2310, CURRENT), (0x8400, VELOCITY)])
@pytest.mark.parametrize("width", [420, 640, 1100])
def test_the_value_that_a_fault_is_about_is_always_shown(
    theme: Theme, bench: Bench, width: int, code: int, column: int
) -> None:
    bench.station.take([walking(10), looked()])
    newest_ns = bench.station.rings.newest_ns or 0
    columns: dict[str, list[float | None]] = {"left_knee.error_code": [float(code)]}
    columns |= {
        f"left_knee.{name}": [99.0] for name in ("position", "velocity", "torque", "current", "temperature")
    }
    bench.station.take([telemetry([newest_ns + 1], columns)])
    model = JointModel(bench.desk, theme)
    model.refresh()
    table = JointTable(model, theme)
    table.resize(width, 300)
    table.show()
    assert not table.isColumnHidden(column)
    assert not table.isColumnHidden(ERROR)
    assert table.columnViewportPosition(column) + table.columnWidth(column) <= table.viewport().width()
    metrics = QFontMetrics(theme.text_font())
    assert table.columnWidth(ERROR) >= metrics.horizontalAdvance("0x4210")
    destroy(table)
