"""Parameters: what is written is exactly the difference shown, and nobody is overwritten unseen."""

import re
import time

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit

from gateway.client import ConnectionState, RemoteError
from gateway.units import Units
from gateway.wire.control import Lease
from gateway.wire.parameter import Confirmed, Reverted, Written
from server_gui.core.follow.events import LinkChanged
from server_gui.core.tuning.writing import WriteState
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.parameters.panel import NEWS_S, ParametersPanel, _banner
from server_gui.views.parameters.review import NUMBERS, SETTLE_MS
from server_gui.views.parameters.tree import NAME, NEW, ROBOT, SAID, TITLES
from tests.gui.fakes import Bench
from tests.gui.running import wait
from tests.support.desk import HELD, JOINTS, described, looked, telemetry, walking


def row(panel: ParametersPanel, name: str) -> list[str]:
    """What stands in a parameter's row."""
    panel.refresh()
    panel.tree.select_name(name)
    index = panel.tree.currentIndex()
    return [str(index.siblingAtColumn(column).data() or "") for column in range(len(TITLES))]


def settle(panel: ParametersPanel) -> None:
    """Wait until the review lets itself be written."""
    wait(panel.review.write_it.isEnabled, "let itself be written")


def test_values_are_shown_in_degrees_and_millimetres(panel: ParametersPanel) -> None:
    assert row(panel, "gait.step_length")[ROBOT] == "400"
    assert row(panel, "gait.trunk_angle")[ROBOT] == "2.865"


def test_a_staged_value_is_shown_and_not_sent(panel: ParametersPanel, bench: Bench) -> None:
    panel.stage_text("gait.step_length", "430")
    assert row(panel, "gait.step_length")[NEW] == "430"
    assert "nothing has been sent" in panel.banner.text()
    assert bench.first.named("write") == []


def test_what_is_written_is_exactly_the_difference(panel: ParametersPanel, bench: Bench) -> None:
    panel.stage_text("gait.step_length", "430")
    panel.stage_text("left_knee.max_torque", "60")
    panel.stage_text("gait.trunk_angle", "3")
    panel.stage("gait.trunk_angle", HELD["gait.trunk_angle"])  # as it is: no edit any more
    panel.begin_review()
    assert [change.name for change in panel.review.changes] == ["gait.step_length", "left_knee.max_torque"]
    settle(panel)
    panel.review.write_it.click()
    assert bench.first.named("write") == [({"gait.step_length": 0.43, "left_knee.max_torque": 60.0}, None)]


def test_no_digit_is_lost_from_the_field_to_the_robot_and_back(panel: ParametersPanel, bench: Bench) -> None:
    exact = 0.12345678901234567
    bench.station.take([looked({**HELD, "gait.trunk_angle": exact})])
    panel.refresh()
    panel.tree.select_name("gait.trunk_angle")
    text = panel.detail.field.text()
    panel.stage_text("gait.trunk_angle", text)
    assert bench.station.edits.staged == {}, "what was shown and typed again is another value"
    panel.stage_text("gait.trunk_angle", "7.0735528")
    staged = bench.station.edits.staged["gait.trunk_angle"].value
    bench.station.take([looked({**HELD, "gait.trunk_angle": staged})])
    panel.detail.refresh(anew=True)
    assert panel.detail.field.text() == "7.0735528"


def test_a_value_that_changed_elsewhere_is_flagged_before_it_is_overwritten(
    panel: ParametersPanel, bench: Bench
) -> None:
    panel.stage_text("gait.step_length", "430")
    panel.begin_review()
    settle(panel)
    bench.station.take([looked({**HELD, "gait.step_length": 0.45})])
    panel.review.write_it.click()  # before anything was drawn anew
    assert bench.first.named("write") == []
    panel.refresh()
    assert row(panel, "gait.step_length")[SAID] == "⚠ changed"
    assert panel.review.write_it.text() == "Overwrite 1 now"
    assert not panel.review.write_it.isEnabled(), "a click meant for what stood there before counts"
    settle(panel)
    panel.review.write_it.click()
    assert bench.first.named("write") == [({"gait.step_length": 0.43}, None)]


def test_a_review_has_the_keyboard_and_so_has_what_comes_after_it(window: MainWindow, bench: Bench) -> None:
    panel = window.parameters
    bench.station.take([looked()])
    panel.stage_text("gait.step_length", "430")
    bench.draw(window)
    window.activateWindow()
    panel.tree.setFocus()
    panel.review_button.click()
    bench.draw(window)
    assert QApplication.focusWidget() is panel.review.table
    QTest.keyClick(panel.review.table, Qt.Key.Key_Escape)
    bench.draw(window)
    focus = QApplication.focusWidget()
    assert focus is not None
    assert panel.isAncestorOf(focus)


def test_a_value_is_typed_where_it_and_what_is_allowed_have_room(panel: ParametersPanel) -> None:
    panel.resize(300, 900)
    QApplication.processEvents()
    panel.tree.edit_name("left_knee.max_torque")
    field = panel.tree.findChild(QLineEdit)
    assert field is not None
    wide = field.fontMetrics().horizontalAdvance
    for text in (field.text(), field.placeholderText()):
        assert text
        assert field.width() >= wide(text)
    assert field.placeholderText() == "8 … 80"
    assert panel.tree.viewport().rect().contains(field.geometry())


def test_what_the_robot_would_refuse_cannot_be_written(panel: ParametersPanel) -> None:
    panel.stage("gait.step_length", 0.7)  # as a file's
    panel.begin_review()
    QTest.qWait(SETTLE_MS + 100)
    assert not panel.review.write_it.isEnabled()
    assert "above the largest allowed, 600 mm" in panel.review.said.text()
    panel.refresh()
    assert "above the largest" not in panel.banner.text(), "it is said twice"
    assert not panel.review.leave_out.isVisible(), "nothing would be left"


def test_a_review_says_how_far_each_change_goes_and_writes_the_rest_of_what_is_refused(
    panel: ParametersPanel, bench: Bench
) -> None:
    panel.stage_text("gait.step_length", "430")
    panel.stage("left_knee.max_torque", 200.0)  # as a file's
    panel.begin_review()
    panel.resize(700, 900)
    QApplication.processEvents()
    table = panel.review.table
    model = table.model()
    told = [model.index(0, column).data() for column in range(model.columnCount())]
    assert told == ["gait.step_length", "400", "→", "430", "mm", "+30 (+7.5 %)", "200 … 600", ""]
    assert not any(table.isColumnHidden(column) for column in range(table.columnCount()))
    for width in (700, 420, 300):
        panel.resize(width, 900)
        QApplication.processEvents()
        assert table.isVisible() is (width == 700)
        assert panel.review.blocks.isVisible() is (width != 700)
    for column in NUMBERS:
        assert table.columnWidth(column) >= table.sizeHintForColumn(column), column
    label, said = panel.review.blocks.label, panel.review.blocks.accessibleDescription()
    assert label.width() <= panel.review.blocks.viewport().width(), "something is cut at the side"
    for words in ("gait.step_length", "400 → 430 mm", "change +30 (+7.5 %)", "allowed 200 … 600 mm"):
        assert words in said
    assert "left_knee.max_torque" in said
    assert "✕ refused" in said
    assert not panel.review.write_it.isEnabled()
    panel.review.leave_out.click()
    panel.refresh()
    settle(panel)
    assert [change.name for change in panel.review.changes] == ["gait.step_length"]
    assert not panel.review.leave_out.isVisible()
    assert panel.review.write_it.isEnabled()


@pytest.mark.parametrize("text", ["", "abc", "nan", "inf", "1e999"])
def test_what_is_no_number_is_refused_in_words(panel: ParametersPanel, bench: Bench, text: str) -> None:
    panel.stage_text("gait.step_length", text)
    panel.refresh()
    assert bench.station.edits.staged == {}
    assert "is not a number" in panel.banner.text()


def test_a_refusal_stands_on_its_row_and_the_edit_stays(panel: ParametersPanel, bench: Bench) -> None:
    panel.stage_text("gait.step_length", "430")
    bench.station.write(bench.station.difference(Units()))
    refusal = RemoteError(
        -32012, "rolled back", {"kind": "rolled_back", "outcome": {"gait.step_length": "it holds 429"}}
    )
    bench.first.fail(refusal)
    panel.refresh()
    assert bench.station.writing.rows == {"gait.step_length": "it holds 429"}
    assert row(panel, "gait.step_length")[NEW] == "430"
    assert "not written: rolled back" in panel.banner.text()


@pytest.mark.parametrize(("state", "leads"), [(4.0, "Try it for"), (None, "Try it for"), (1.0, "Write 1")])
def test_a_trial_is_what_is_meant_unless_every_drive_is_known_to_be_off(
    panel: ParametersPanel, bench: Bench, state: float | None, leads: str
) -> None:
    now_ns = time.monotonic_ns()
    states = {f"{joint}.state": [state] for joint in JOINTS}
    bench.station.take([telemetry([now_ns], states, now_ns)])
    panel.stage_text("gait.step_length", "430")
    panel.begin_review()
    review = panel.review
    assert [one.text() for one in (review.try_it, review.write_it) if one.objectName() == "primary"] == [
        leads
    ]


def test_a_review_says_how_long_a_verdict_takes_only_while_somebody_walks(
    panel: ParametersPanel, bench: Bench
) -> None:
    panel.stage_text("gait.step_length", "430")
    panel.begin_review()
    panel.refresh()
    assert panel.review.takes.isHidden()
    bench.station.take([walking(1200)])  # a stride a second
    wait(lambda: bool(bench.station.processing.derived().gait.cadence_spm), "had a cadence")
    panel.refresh()
    assert panel.review.takes.text() == "a verdict takes about 9 s: 8 cycles of each leg"


def test_a_trial_counts_down_and_is_seen_to_go_back(panel: ParametersPanel, bench: Bench) -> None:
    panel.stage_text("gait.step_length", "430")
    panel.begin_review()
    settle(panel)
    panel.review.seconds.setValue(20)
    panel.review.try_it.click()
    assert bench.first.named("write") == [({"gait.step_length": 0.43}, 20.0)]
    bench.first.answer(Written(7, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=20.0))
    bench.station.take([looked({**HELD, "gait.step_length": 0.43})])
    panel.refresh()
    assert panel.trial.isVisible()
    assert "400 → 430 mm; taken back in" in panel.trial.words.text()
    assert row(panel, "gait.step_length")[SAID] == "◔ trial"
    trial = bench.station.writing.trial
    assert trial is not None
    over_ns = trial.until_ns + 3_000_000_000
    bench.station.reverted.look_if_over(over_ns)
    assert bench.station.writing.trial is trial, "nobody has looked since its end"
    bench.station.take([looked(at_ns=over_ns)])
    bench.station.reverted.look_if_over(over_ns)
    panel.refresh()
    assert not panel.trial.isVisible()
    assert "the robot has taken it back" in panel.banner.text()
    told = next(one for one in bench.desk.news.items if "taken it back" in one.text)
    assert time.time() - told.utc_s == pytest.approx(3.0, abs=1.0), "then it was, and not when that was known"


def test_a_trial_is_kept_or_taken_back_by_its_number(panel: ParametersPanel, bench: Bench) -> None:
    for ask, answer in (
        (panel.trial.keep, Confirmed(7, {"gait.step_length": 0.43})),
        (panel.trial.take_back, Reverted(7, {"gait.step_length": "taken back"})),
    ):
        bench.station.writing.done(
            Written(7, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=20.0)
        )
        ask.emit()
        bench.first.answer(answer)
        assert bench.station.writing.trial is None
    assert [name for name, _ in bench.first.asked] == ["confirm", "revert"]


def test_undo_stages_the_inverse_for_review(panel: ParametersPanel, bench: Bench) -> None:
    panel.stage_text("gait.step_length", "430")
    bench.station.write(bench.station.difference(Units()))
    bench.first.answer(Written(1, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}))
    bench.station.take([looked({**HELD, "gait.step_length": 0.43})])
    panel.refresh()
    panel.undo.click()
    assert [(change.name, change.old, change.new) for change in panel.review.changes] == [
        ("gait.step_length", 0.43, 0.4)
    ]
    assert len(bench.first.named("write")) == 1, "undo wrote by itself"


def test_edits_stay_with_their_robot(panel: ParametersPanel, bench: Bench) -> None:
    panel.stage_text("gait.step_length", "430")
    panel.begin_review()
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02"), looked()])
    bench.desk.select(other)
    assert row(panel, "gait.step_length")[NEW] == ""
    assert not panel.review.isVisible()
    assert bench.station.edits.staged.keys() == {"gait.step_length"}


def test_the_wheel_changes_nothing_that_has_not_the_focus(panel: ParametersPanel, bench: Bench) -> None:
    panel.tree.select_name("gait.step_length")
    before = panel.detail.slider.value()
    middle = QPointF(panel.detail.slider.rect().center())
    turn = QWheelEvent(
        middle,
        panel.detail.slider.mapToGlobal(middle),
        QPoint(0, 0),
        QPoint(0, 120),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(panel.detail.slider, turn)
    assert panel.detail.slider.value() == before
    assert bench.station.edits.staged == {}


def test_the_slider_goes_as_far_as_one_write_may_and_gives_round_numbers(
    panel: ParametersPanel, bench: Bench
) -> None:
    panel.tree.select_name("gait.step_length")
    panel.detail.slider.setValue(panel.detail.slider.maximum())
    assert bench.station.edits.staged["gait.step_length"].value == 0.5
    panel.detail.slider.setValue(77)
    assert bench.station.edits.staged["gait.step_length"].value == 0.377


def test_typing_into_the_table_edits_the_exact_value(panel: ParametersPanel, bench: Bench) -> None:
    panel.tree.select_name("gait.trunk_angle")
    panel.tree.edit(panel.tree.currentIndex())
    field = panel.tree.findChild(QLineEdit)
    assert field is not None
    assert field.text() == "2.8647889756541162"
    field.setText("3")
    QTest.keyClick(field, Qt.Key.Key_Return)
    QApplication.processEvents()
    assert bench.station.edits.staged["gait.trunk_angle"].value == pytest.approx(0.0523598775)


def test_the_filter_finds_by_words_and_by_object(panel: ParametersPanel) -> None:
    panel.filters.words.setText("0x6072 torque")
    panel.refresh()
    shown = panel.tree.filter
    groups = [shown.index(place, NAME) for place in range(shown.rowCount())]
    assert [group.data() for group in groups] == ["left knee"]


def test_control_shows_who_has_it_and_how_long(panel: ParametersPanel, bench: Bench) -> None:
    panel.control.take.emit()
    bench.first.answer(Lease("lease", 300.0))
    panel.refresh()
    assert panel.control.words.text().startswith(("You have control for 4:5", "You have control for 5:0"))
    bench.station.lost_control()
    panel.control.take.emit()
    bench.first.fail(RemoteError(-32003, "ada at 10.0.0.3 has control", {"kind": "lease_held"}))
    panel.refresh()
    assert panel.control.words.text() == "ada at 10.0.0.3 has control"


def test_without_a_link_values_are_dim_and_their_age_is_said(panel: ParametersPanel, bench: Bench) -> None:
    def colour() -> object:
        panel.refresh()
        panel.tree.select_name("gait.step_length")
        held = panel.tree.currentIndex().siblingAtColumn(ROBOT)
        return held.data(Qt.ItemDataRole.ForegroundRole).color()

    bench.station.take([walking(20)])
    live = colour()
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no gateway", time.monotonic_ns())])
    assert colour() != live
    assert re.fullmatch(r"No link: these values are \d+(\.\d)? m?s old", panel.control.words.text())
    bench.station.take([LinkChanged(ConnectionState.CONNECTED, "", time.monotonic_ns())])
    assert colour() == live
    assert panel.control.words.text() == "Looking only: writing takes control"


def test_what_is_outside_is_refused_before_it_is_staged(panel: ParametersPanel, bench: Bench) -> None:
    panel.stage_text("gait.step_length", "900")
    panel.refresh()
    assert bench.station.edits.staged == {}
    assert panel.banner.text() == (
        "gait.step_length: 900 mm is not staged: it is above the largest allowed, 600 mm"
    )
    panel.stage_text("gait.step_length", "520")
    panel.refresh()
    assert "one write may go, 100 mm" in panel.banner.text()


def test_the_range_stands_beside_the_editor(panel: ParametersPanel) -> None:
    row(panel, "gait.step_length")
    panel.stage_text("gait.step_length", "430")
    panel.refresh()
    assert panel.detail.range.figures == ("200", "600 mm")
    assert panel.detail.range.isVisible()


def test_several_joints_are_edited_at_once(panel: ParametersPanel, bench: Bench) -> None:
    torques = {f"{joint}.max_torque": 80.0 for joint in JOINTS}
    bench.station.take([described(parameters=torques), looked(torques)])
    row(panel, "left_knee.max_torque")
    panel.stage_text("left_knee.max_torque", "60")
    panel.detail.several.aboutToShow.emit()
    titles = [action.text() for action in panel.detail.several.actions()]
    assert titles == ["60 N·m for right knee, too", "60 N·m for all joints"]
    assert "right_knee.max_torque: 80" in panel.detail.several.actions()[0].toolTip()
    panel.detail.several.actions()[1].trigger()
    assert bench.station.edits.staged.keys() == torques.keys()
    panel.begin_review()
    settle(panel)
    panel.review.write_it.click()
    assert bench.first.named("write") == [(dict.fromkeys(torques, 60.0), None)]


def test_where_one_joint_cannot_nothing_is_staged_and_it_is_named(
    panel: ParametersPanel, bench: Bench
) -> None:
    torques = {f"{joint}.max_torque": 80.0 for joint in JOINTS[:-1]}
    bench.station.take([described(parameters=torques), looked(torques)])
    row(panel, "left_knee.max_torque")
    panel.detail.several.aboutToShow.emit()
    panel.stage("left_knee.max_torque", 60.0)
    panel.detail.several.aboutToShow.emit()
    panel.detail.several.actions()[1].trigger()
    panel.refresh()
    assert list(bench.station.edits.staged) == ["left_knee.max_torque"]
    assert "right_ankle: it has no max_torque" in panel.banner.text()


def test_what_came_of_a_write_is_green_while_it_is_news(
    panel: ParametersPanel, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The end of a trial stood there in green for the rest of the day."""
    writing = bench.station.writing
    writing.say(WriteState.DONE, "taken back")
    assert _banner(bench.station, 0, "") == ("taken back", "good")
    monkeypatch.setattr(writing, "said_s", writing.said_s - NEWS_S)
    said, tone = _banner(bench.station, 0, "")
    assert re.fullmatch(r"\d\d:\d\d:\d\d  taken back", said)
    assert tone == "plain"


def add_named(bench: Bench, name: str) -> None:
    """Another robot that is called so here, whatever it calls itself."""
    station = bench.add(name, 7421)
    station.take([described()])
    station.is_named = True


def test_a_review_says_whose_parameters_it_writes_where_there_are_two_robots(
    panel: ParametersPanel, bench: Bench
) -> None:
    panel.stage_text("gait.step_length", "430")
    panel.begin_review()
    assert panel.review.title.text() == "Review: only this is written"
    add_named(bench, "exo-02")
    panel.begin_review()
    assert panel.review.title.text() == "Review – exo-01: only this is written"
    assert "to exo-01" in panel.review.write_it.toolTip()


@pytest.mark.parametrize("width", [1680, 1000])
def test_the_panel_names_its_robot_where_there_are_two(window: MainWindow, bench: Bench, width: int) -> None:
    window.resize(width, 900)
    dock = window.docks[1]
    assert dock.windowTitle() == "Parameters"
    add_named(bench, "exo-02")
    bench.draw(window)
    assert dock.windowTitle() == "Parameters – exo-01"
    assert dock.toggleViewAction().text() == "Parameters"
    bench.desk.select(bench.desk.stations[1])
    bench.draw(window)
    assert dock.windowTitle() == "Parameters – exo-02"


def test_a_long_name_is_cut_in_its_middle_in_the_title_of_the_panel(window: MainWindow, bench: Bench) -> None:
    add_named(bench, "exo-02-" + 60 * "w" + "-left-lab")
    bench.desk.select(bench.desk.stations[1])
    bench.draw(window)
    title = window.docks[1].windowTitle()
    assert re.fullmatch("Parameters – exo-02.*-lab", title)


def test_storing_is_not_offered_without_a_link(panel: ParametersPanel, bench: Bench) -> None:
    panel.refresh()
    assert panel.store_button.isEnabled()
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no gateway", time.monotonic_ns())])
    panel.refresh()
    assert not panel.store_button.isEnabled()
    assert "no link" in panel.store_button.toolTip()
