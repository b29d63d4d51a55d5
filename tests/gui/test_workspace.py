"""The signals' workspace by mouse and keys: curves, layouts, expressions, the trigger, beside, notes."""

import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QContextMenuEvent, QDragEnterEvent, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QMenu, QTreeWidget, QWidget

from gateway.units import Units
from server_gui.core.desk.flags import FlagKind
from server_gui.core.workspace.layouts import Layouts
from server_gui.core.workspace.trigger import Condition, Mode, On, TriggerState
from server_gui.views.confirmation import Question
from server_gui.views.theme import Theme
from server_gui.views.widgets.dragging import CURVES, dragged, dropped
from server_gui.views.workspace.expression_bar import EXAMPLE
from server_gui.views.workspace.page import Signals
from server_gui.views.workspace.unit_plot import EmptyPlot, UnitPlot
from server_gui.views.workspace.xy_plot import XYPlot
from tests.gui.fakes import Bench, destroy
from tests.gui.rules import nameless, out_of_reach
from tests.support.desk import described, telemetry

START_NS = 1_000_000_000_000
KNEE, HIP, TORQUE = "left_knee.position", "left_hip.position", "left_knee.torque"
EVERYTHING = Qt.DropAction.CopyAction


@pytest.fixture
def signals(theme: Theme, bench: Bench, tmp_path: Path) -> Iterator[Signals]:
    """Five seconds: the knee follows a sine of 1 Hz, its torque is 1, the hip a tenth of it."""
    feed(bench, 0, 500)
    made = Signals(bench.desk, theme, layouts=Layouts(tmp_path / "layouts"))
    made.resize(900, 700)
    made._begun = True  # no plots of what a robot has at first: to make them is most of a test
    made.show()
    made.refresh()
    made.choose([KNEE, TORQUE])
    QApplication.processEvents()
    yield made
    destroy(made)


def feed(
    bench: Bench, first: int, rows: int, station: int = 0, start_ns: int = START_NS, by: float = 1.0
) -> None:
    numbers = range(first, first + rows)
    knee: list[float | None] = [by * math.sin(math.tau * number / 100) for number in numbers]
    columns: dict[str, list[float | None]] = {
        KNEE: knee,
        HIP: [None if value is None else value / 10 for value in knee],
        TORQUE: [by] * rows,
        "left_knee.state": [4.0] * rows,
    }
    stamps_ns = [start_ns + number * 10_000_000 for number in numbers]
    bench.desk.stations[station].take([telemetry(stamps_ns, columns)])


def drop(on: QWidget, texts: list[str], at: QPoint | None = None) -> bool:
    """Drop these there as a mouse does; whether they were taken."""
    data, place = dragged(texts), QPointF(at or on.rect().center())
    none, left = Qt.KeyboardModifier.NoModifier, Qt.MouseButton.LeftButton
    entering = QDragEnterEvent(place.toPoint(), EVERYTHING, data, left, none)
    QApplication.sendEvent(on, entering)
    dropping = QDropEvent(place, EVERYTHING, data, left, none)
    QApplication.sendEvent(on, dropping)
    return entering.isAccepted()


def said(signals: Signals) -> str:
    signals.read_now()
    signals.refresh()
    return f"{signals.said.text()}{signals.refused.text()}"


def state(signals: Signals) -> TriggerState:
    return signals.scene.trigger.state


def curves(signals: Signals) -> list[list[str]]:
    return [plot.curves for plot in signals.scene.workspace.plots]


def labels(menu: QMenu) -> list[str]:
    return [action.text() for action in menu.actions() if action.text()]


# Curves into plots


def test_a_channel_is_dragged_below_the_lowest_plot_into_one_or_between_them(
    signals: Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    below, seen = signals.area.below, []

    def dragging(_tree: QTreeWidget, _actions: object) -> None:
        seen.append(below.isVisible())
        QApplication.processEvents()
        drop(signals.area, [HIP], below.geometry().center())

    monkeypatch.setattr(QTreeWidget, "startDrag", dragging)
    signals.channels.startDrag(EVERYTHING)
    assert seen == [True]
    assert curves(signals) == [[KNEE], [TORQUE], [HIP]]
    assert not below.isVisible()
    signals.choose([KNEE, TORQUE])
    signals.refresh()
    assert curves(signals) == [[KNEE], [TORQUE]]
    assert drop(signals.cards[0], [HIP])
    assert curves(signals) == [[KNEE, HIP], [TORQUE]]
    assert set(signals.chosen) == {KNEE, HIP, TORQUE}, "what is drawn is not ticked"
    assert drop(signals.area, [HIP], QPoint(5, signals.area.height() - 1))
    assert curves(signals) == [[KNEE, HIP], [TORQUE], [HIP]]


def test_another_unit_is_refused_where_it_is_dropped_and_nothing_changes(signals: Signals) -> None:
    drop(signals.cards[1], [HIP])
    assert curves(signals) == [[KNEE], [TORQUE]]
    assert "left_hip.position is in °, plot 2 in N·m" in said(signals)
    assert signals.refused.isVisible()
    signals.resize(500, 700)
    QApplication.processEvents()
    assert signals.refused.height() >= signals.refused.heightForWidth(signals.refused.width()), "it is cut"
    drop(signals.cards[0], [HIP])
    assert not signals.refused.isVisible()


def test_the_tree_hands_over_what_is_dragged_and_nothing_else_is_taken(signals: Signals) -> None:
    item = next(item for item in signals.channels.items if "position" in item.text(0))
    assert signals.channels.mimeTypes() == [CURVES]
    assert dropped(signals.channels.mimeData([item])) == [HIP]
    hostile = dragged([])
    for data in (b"", b"{", b'{"a": 1}', b"[1, null]", b"\xff"):
        hostile.setData(CURVES, data)
        assert dropped(hostile) == []
    assert not drop(signals.cards[0], [])


def test_all_of_it_goes_by_the_keyboard(signals: Signals) -> None:
    tree = signals.channels
    tree.setCurrentItem(next(item for item in tree.items if "position" in item.text(0)))
    opened: list[QMenu] = []
    tree.asked.disconnect()
    tree.asked.connect(lambda text, at: opened.append(signals.area.offer(text, at)))
    by_key = QContextMenuEvent(QContextMenuEvent.Reason.Keyboard, QPoint(0, 0), QPoint(0, 0))
    QApplication.sendEvent(tree, by_key)
    menu = opened[0]
    assert labels(menu)[:3] == ["Add to plot 1 (°)", "Add to plot 2 (N·m)", "New plot"]
    QTest.keyClick(menu, Qt.Key.Key_Down)
    QTest.keyClick(menu, Qt.Key.Key_Return)
    assert curves(signals) == [[KNEE, HIP], [TORQUE]]


def test_a_plot_has_a_menu_of_its_curves(signals: Signals) -> None:
    drop(signals.cards[0], [HIP])
    card = signals.cards[0]
    card.menu.aboutToShow.emit()
    assert labels(card.menu) == [KNEE, HIP, "Draw over", "Remove this plot"]
    of_hip = card.menu.actions()[1].menu()
    assert isinstance(of_hip, QMenu)
    of_hip.actions()[0].trigger()
    assert curves(signals) == [[KNEE], [TORQUE]]
    assert HIP not in signals.chosen


def test_everything_has_a_name_and_is_in_reach_at_any_width(signals: Signals) -> None:
    for button in (signals.tools.expression, signals.tools.trigger):
        button.click()
    signals.cursors.click()
    for width in (520, 900):
        signals.resize(width, 900)
        QApplication.processEvents()
        assert nameless(signals) == []
        assert out_of_reach(signals) == []


# Expressions, XY


def test_an_expression_is_judged_while_one_types(signals: Signals) -> None:
    bar = signals.expression
    signals.tools.expression.click()
    assert signals.window().focusWidget() is bar.field, "one types at once, after Ctrl+Shift+E too"
    bar.field.setText(EXAMPLE.replace("right_knee", "left_hip"))
    assert "apart, in °" in bar.words.text()
    bar.field.setText(f"{KNEE} + {TORQUE}")
    assert not bar.add.isEnabled()
    assert bar.place.text().splitlines()[1].index("^") == len(KNEE) + 1
    assert "rad and N·m cannot be added" in bar.words.text()
    bar.field.setText(f"error = {KNEE} - {HIP}")
    assert "error, in °" in bar.words.text()
    QTest.keyClick(bar.field, Qt.Key.Key_Return)
    assert curves(signals) == [[KNEE, f"error = {KNEE} - {HIP}"], [TORQUE]]
    signals.refresh()
    values = signals.scene.values(f"error = {KNEE} - {HIP}", 500)
    assert values[25] == pytest.approx(0.9)


def test_an_xy_plot_is_over_a_curve_and_over_time_again(signals: Signals) -> None:
    signals.scene.workspace.turn(1, KNEE)
    signals.refresh()
    card = signals.cards[1]
    assert isinstance(card, XYPlot)
    assert f"{TORQUE} (N·m) over {KNEE} (°)" in card.accessibleName()
    said(signals)
    xs, ys = card._lines[TORQUE][-1].getData()
    assert max(xs) == pytest.approx(math.degrees(1.0), rel=0.01)
    assert set(ys) == {1.0}
    assert len(signals.plots) == 1
    signals.scene.workspace.turn(1, "")
    signals.refresh()
    assert isinstance(signals.cards[1], UnitPlot)


# Layouts


def test_a_layout_comes_back_as_it_was_and_what_a_robot_lacks_is_named(
    signals: Signals, bench: Bench
) -> None:
    signals.scene.workspace.new_plot(signals.scene.meaning(TORQUE), KNEE)
    signals.refresh()
    signals.trigger.show_condition(Condition(On.ABOVE, KNEE, 0.5))
    signals.trigger.arm.click()
    before = curves(signals)
    signals.layouts.save("Knees")
    assert "layout saved as Knees" in said(signals)
    file = next((signals.layouts._layouts.folder).iterdir())
    file.write_text(file.read_text().replace("left_knee.torque", "left_toe.torque"), encoding="utf-8")
    signals.choose([])
    assert signals.empty.isVisible()
    signals.layouts.open("Knees")
    signals.refresh()
    assert curves(signals) == [
        [text.replace("knee.torque", "toe.torque") for text in plot] for plot in before
    ]
    missing = signals.cards[1]
    assert isinstance(missing, EmptyPlot)
    assert "this robot has no left_toe.torque" in missing.legend.accessibleDescription()
    assert signals.tools.trigger.isChecked()
    assert signals.trigger.condition.level == pytest.approx(0.5, abs=1e-4)
    assert signals.layout_now().plots == signals.scene.workspace.plots, "what is missing is forgotten"


def test_layouts_are_renamed_deleted_and_given_away(signals: Signals, tmp_path: Path) -> None:
    menu = QMenu()
    signals.layouts.save("Knees")
    signals.layouts.rename("Hips & co")
    signals.layouts.fill(menu)
    assert labels(menu)[0] == "Hips && co"
    signals.layouts.give(tmp_path / "given.toml")
    signals.layouts.delete()
    assert signals.layouts.current == ""
    signals.layouts.take(tmp_path / "given.toml")
    assert signals.layouts.current == "Hips & co"
    (tmp_path / "bad.toml").write_text("format = 1\nname = 7\n")
    signals.layouts.take(tmp_path / "bad.toml")
    assert "line 2, key name" in said(signals)
    assert signals.layouts.current == "Hips & co"


# Hover, trigger


def test_the_pointer_reads_all_plots_and_nothing_where_no_sample_is(signals: Signals, bench: Bench) -> None:
    signals._hovered(-1.75)  # sin is 1 there, but for the half row that the newest is beside
    assert f"{KNEE} " in signals.plots[0]._legend.accessibleDescription()
    value = signals.scene.read(KNEE, -1.74)
    assert value == pytest.approx(1.0, abs=0.01)
    assert signals.plots[0].note == "−1.75 s"
    assert signals.plots[1].plot._hover == -1.75
    assert signals.scene.read(KNEE, -9.0) is None, "there was no row yet"
    feed(bench, 700, 1)  # after a gap of 2 s
    assert signals.scene.read(KNEE, -1.0) is None
    signals._hovered(None)
    assert signals.plots[0].note == ""


def test_a_trigger_keeps_what_was_before_and_after_it(signals: Signals, bench: Bench) -> None:
    signals.span.setCurrentText("2 s")
    signals.tools.trigger.click()
    signals.trigger.show_condition(Condition(On.RISE, KNEE, 0.5, mode=Mode.SINGLE, before=0.25))
    signals.trigger.level.setText("a lot")
    signals.trigger.arm.click()
    assert "a number that is none" in said(signals)
    assert state(signals) is TriggerState.OFF
    signals.trigger.level.setText("28.648 °")
    signals.trigger.arm.click()
    signals.refresh()
    assert state(signals) is TriggerState.ARMED
    feed(bench, 500, 50)
    signals.refresh()
    assert state(signals) is TriggerState.TRIGGERED
    assert signals.scene.frozen is None
    feed(bench, 550, 300)
    assert "Kept by the trigger" in said(signals)
    frozen = signals.scene.frozen
    assert frozen is not None
    assert frozen.newest_ns == pytest.approx(START_NS + (509 + 150) * 10_000_000, abs=11_000_000)
    assert signals.plots[0].plot._limits == pytest.approx([math.degrees(0.5)], abs=1e-3)
    flags = [flag for flag in signals.plots[0].plot._flags if flag.kind is FlagKind.TRIGGER]
    assert [flag.at for flag in flags] == [pytest.approx(-1.5, abs=0.02)]
    assert "stopped" in signals.trigger._title.text()
    signals.tools.trigger.click()
    assert signals.scene.frozen is None


def test_what_is_waited_for_stays_the_same_in_other_units_and_layouts(signals: Signals, bench: Bench) -> None:
    bar, layouts = signals.trigger, signals.layouts
    bar.show_condition(Condition(On.RISE, KNEE, 0.5))
    bar.arm.click()
    layouts.save("Knees")
    layouts.open("Knees")
    layouts.save("Knees again")
    kept = layouts._layouts.load("Knees again").trigger
    assert kept is not None, "a layout that was opened and saved again has lost its trigger"
    bench.desk.shown.change(Units({"rad": "rad"}))
    signals.refresh()
    assert bar.level.text() == "0.5 rad"
    bar.show_condition(Condition(On.ABOVE, "left_toe.position", 2.0))  # as a layout of another robot has it
    signals.choose([HIP])
    assert (bar.condition.of, bar.condition.level) == ("left_toe.position", 2.0)
    bar.on.setCurrentText(On.EMCY.value)
    assert bar.condition.of == "left_hip"


def test_an_emcy_is_waited_for_by_a_drives_state_where_it_tells_no_code(
    signals: Signals, bench: Bench
) -> None:
    signals.scene.arm(Condition(On.EMCY, "left_knee", before=1.0))
    signals.refresh()
    bench.station.take([telemetry([START_NS + 6_000_000_000], {"left_knee.state": [4.0]})])
    signals.refresh()
    assert state(signals) is TriggerState.ARMED
    bench.station.take([telemetry([START_NS + 6_010_000_000], {"left_knee.state": [7.0]})])
    signals.refresh()
    assert state(signals) is TriggerState.SHOWN
    assert "tells no errors" in signals.scene.trigger_problem(Condition(On.EMCY, "trunk"))


# Beside, notes


def test_another_robot_is_beside_and_says_how_it_is_aligned(signals: Signals, bench: Bench) -> None:
    bench.add("exo-02", 7421).take([described("exo-02")])
    feed(bench, 0, 500, 1, START_NS, by=2.0)
    menu = QMenu()
    signals.beside.fill(menu)
    assert labels(menu)[:2] == ["Nothing", "exo-02"]
    menu.actions()[1].trigger()
    said(signals)
    assert "exo-02, aligned by their clocks: its newest row is" in signals.beside_said.text()
    assert len(signals.plots[0].plot._curves) == 2
    assert signals.scene.read(TORQUE, 0.0, beside=True) == 2.0
    signals.beside.nudge("-6")
    said(signals)
    assert signals.scene.read(TORQUE, 0.0, beside=True) is None, "an old value is shown as if it were of now"
    signals.beside.nudge("far")
    assert "is not a number of seconds" in said(signals)
    bench.desk.remove(bench.desk.stations[1])
    assert "the robot or recording beside is gone" in said(signals)
    assert signals.scene.beside is None


class Kept:
    """Notes that a test reads."""

    problem = ""

    def __init__(self) -> None:
        self.kept: list[tuple[str, int]] = []

    def add(self, text: str, at_ns: int) -> None:
        self.kept.append((text, at_ns))

    def flags(self) -> tuple[()]:
        return ()


def test_a_note_is_kept_at_the_cursor_where_somebody_records_and_never_goes_to_another_robot(
    signals: Signals, bench: Bench
) -> None:
    signals.tools.note.click()
    assert "no note: nobody records" in said(signals)
    assert not signals.findChildren(Question)
    notes = signals._notes = Kept()
    signals.cursors.click()
    signals.two.move(1, -2.0)
    signals.tools.note.click()
    question = next(one for one in signals.findChildren(Question) if one.windowTitle() == "Note")
    assert "−2 s, where the cursor is" in question.words.text()
    feed(bench, 500, 100)  # time goes on while somebody types
    assert isinstance(question.field, QLineEdit)
    QTest.keyClicks(question.field, "slipped  here")
    QTest.keyClick(question.field, Qt.Key.Key_Return)
    assert notes.kept == [("slipped here", START_NS + 499 * 10_000_000 - 2_000_000_000)]
    bench.add("exo-02", 7421).take([described("exo-02")])
    signals.tools.note.click()
    question = next(one for one in signals.findChildren(Question) if one.isVisible())
    bench.desk.select(bench.desk.stations[1])  # while somebody types
    assert isinstance(question.field, QLineEdit)
    QTest.keyClicks(question.field, "slipped")
    QTest.keyClick(question.field, Qt.Key.Key_Return)
    assert len(notes.kept) == 1
    bench.desk.select(bench.desk.stations[0])
    assert "no note, other rows are shown by now: slipped" in said(signals)
