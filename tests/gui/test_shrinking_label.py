"""No number is cut: a label says less instead, and tables leave out whole columns."""

import pytest
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QApplication

from gateway.wire.parameter import ParameterValue
from server_gui.views.overview.joint_cells import CURRENT, ERROR, STATE, TEMPERATURE, TORQUE, VELOCITY
from server_gui.views.overview.joint_table import JointModel, JointTable, in_few_words
from server_gui.views.overview.joint_words import JointWords
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from tests.gui import rules
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
        said = in_few_words if column == STATE and width < 640 else str
        assert table.columnWidth(column) >= model.widest(column, metrics, said)
    assert rules.halved_numbers(table, [table]) == []
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


@pytest.mark.parametrize("scale", [1.0, 1.5])
@pytest.mark.parametrize("width", [300, 420, 640, 1100])
def test_the_words_of_a_fault_are_all_there(theme: Theme, bench: Bench, width: int, scale: float) -> None:
    theme.set(scale=scale)
    bench.station.take([walking(10), looked()])
    newest_ns = bench.station.rings.newest_ns or 0
    model, below = JointModel(bench.desk, theme), JointWords(theme)
    table = JointTable(model, theme)
    for part in (table, below):
        part.resize(round(width * scale), 300)
        part.show()
    high = below.height()
    codes: dict[str, list[float | None]] = {}
    for joint in ("left_knee", "right_knee"):
        codes[f"{joint}.error_code"] = [float(0x2310)]
        bench.station.take([telemetry([newest_ns + len(codes)], codes)])
        model.refresh()
        below.say(table.unsaid, table.bars)
        QApplication.processEvents()
        metrics = QFontMetrics(theme.text_font())
        if table.unsaid:
            assert "0x2310 continuous overcurrent at the output" in below.text()
            assert "more" not in below.text()
            assert rules.cut_words(below, [below]) == []
        else:
            assert table.columnWidth(ERROR) >= metrics.horizontalAdvance(model.errors[0][1])
        if width >= 420:
            assert table.columnWidth(ERROR) >= metrics.horizontalAdvance("0x2310")
            assert joint.replace("_", " ") in below.text() or not table.unsaid
        assert below.height() == high, "what is around has moved"
    destroy(table)
    destroy(below)


def test_of_many_errors_the_first_is_whole_and_the_others_are_counted(theme: Theme) -> None:
    below = JointWords(theme)
    below.resize(500, 20)
    below.show()
    errors = [(f"joint {place}", f"0x{place:04X} something has happened to this drive") for place in range(6)]
    below.say(errors, frozenset({TORQUE}))
    assert below.text().startswith("joint 0: 0x0000 something has happened to this drive · ")
    assert below.text().endswith(" · 5 more")
    assert rules.cut_words(below, [below]) == []
    below.say([], frozenset({TORQUE}))
    assert below.text() == "Bars: torque as share of its limit"
    below.say([], frozenset())
    assert below.text() == ""
    destroy(below)


@pytest.mark.parametrize("code", [0x0, 0x2310, 0x4210])
@pytest.mark.parametrize("scale", [1.0, 1.5])
@pytest.mark.parametrize("width", range(260, 700, 40))
def test_what_is_shown_of_the_joint_table_is_whole_at_every_width(
    theme: Theme, bench: Bench, width: int, scale: float, code: int
) -> None:
    theme.set(scale=scale)
    bench.station.take([walking(10), looked()])
    newest_ns = bench.station.rings.newest_ns or 0
    bench.station.take([telemetry([newest_ns + 1], {"left_knee.error_code": [float(code)]})])
    model = JointModel(bench.desk, theme)
    model.refresh()
    table = JointTable(model, theme)
    table.resize(round(width * scale), 300)
    table.show()
    assert rules.halved_numbers(table, [table]) == []
    assert not table.isColumnHidden(STATE)
    assert not code or table.unsaid or not table.isColumnHidden(ERROR)
    destroy(table)


def test_a_torque_whose_limit_is_not_known_has_no_bar_to_explain(theme: Theme, bench: Bench) -> None:
    bench.station.take([walking(10)])
    model = JointModel(bench.desk, theme)
    model.refresh()
    table = JointTable(model, theme)
    table.resize(1100, 300)
    table.show()
    assert not table.isColumnHidden(TORQUE)
    assert TORQUE not in table.bars
    limit = ParameterValue(80.0, "N·m", None, None, None)
    bench.station.robot.parameters["left_knee.max_torque"] = limit
    model.refresh()
    assert TORQUE in table.bars
    destroy(table)
