"""Keys: the sheet tells what there is, titles sort, a trial is in sight, words go where one sees them."""

import time

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QWidget

from gateway.wire.resource import ProcessUse
from server_gui.core.processing.process_names import arguments_of
from server_gui.core.tuning.writing import Trial
from server_gui.views.frame.keys_sheet import KEYS
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.parameters.panel import ParametersPanel
from server_gui.views.parameters.tree import NEW, SAID
from server_gui.views.resources.processes import COMMAND, CPU, NAME, ProcessTable
from server_gui.views.theme import Theme
from server_gui.views.widgets.sort_header import SortHeader
from server_gui.views.widgets.stop_button import StopButton
from tests.gui.fakes import Bench, destroy, make_every_page, stop_is_whole
from tests.support.desk import HELD, described, looked, walking

TOLD_AS_ONE = {f"Ctrl+{place}" for place in range(2, 10)}  # with Ctrl+1
NOT_THE_WINDOWS = {"F12", "Shift+F12", "Ctrl+Space", "Alt+O", "F2"}  # of STOP, and Qt's own


def test_the_sheet_tells_every_key_of_the_window_and_comes_and_goes_with_one(window: MainWindow) -> None:
    window.tabs.setFocus()
    QTest.keyClick(window.tabs, Qt.Key.Key_Question)
    assert window.keys.isVisible()
    assert stop_is_whole(window)
    assert not window.header.stop.visibleRegion().isEmpty()
    QTest.keyClick(window.keys.close_button, Qt.Key.Key_Escape)
    assert not window.keys.isVisible()
    text = QKeySequence.SequenceFormat.PortableText
    make_every_page(window)
    held = {shortcut.key().toString(text) for shortcut in window.findChildren(QShortcut)}
    held |= {button.shortcut().toString(text) for button in window.findChildren(QAbstractButton)}
    held |= {action.shortcut().toString(text) for action in window.parameters.tree.actions()}
    menu = window.header.menu.menu()
    held |= {action.shortcut().toString(text) for action in menu.actions()}
    told = {key for group in ("Everywhere", "Parameters", "Signals") for key in KEYS[group]}
    held = {key for key in held if key and not key.startswith("Alt+")} - TOLD_AS_ONE - {"Del", "Escape"}
    assert held - told == set()
    assert told - held - NOT_THE_WINDOWS == {"Esc"} - held


@pytest.mark.parametrize(("width", "height", "scale"), [(1024, 700, 1.0), (1366, 768, 1.5)])
def test_no_sheet_covers_an_alarm_or_a_stop(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    theme.set(scale=scale)
    window.resize(width, height)
    bench.look_again([looked(state="fault", problem="overcurrent, 0x2310")])
    bench.draw(window)
    kept = [window.header, window.alarms, *window.findChildren(StopButton)]
    before = [part.visibleRegion().boundingRect() for part in kept]
    for sheet in (window.keys, window.alarms.list):
        sheet.turn()
        bench.draw(window)
        assert sheet.isVisible()
        assert [part.visibleRegion().boundingRect() for part in kept] == before
        sheet.turn()


def test_ctrl_f_shows_the_panel_that_it_types_into(window: MainWindow, bench: Bench) -> None:
    window._panels.put_away()
    QTest.keyClick(window, Qt.Key.Key_F, Qt.KeyboardModifier.ControlModifier)
    QApplication.processEvents()
    assert not window.parameters.filters.words.visibleRegion().isEmpty()
    assert window.parameters.filters.words.hasFocus() or not window.isActiveWindow()


def test_a_trial_is_in_sight_whatever_panel_is_hidden_and_another_robot_s_with_its_name(
    window: MainWindow, bench: Bench
) -> None:
    station = bench.station
    bench.look_again([walking(10), looked()])
    bench.draw(window)
    assert not window.trial.isVisible()
    until_ns = time.monotonic_ns() + 30_000_000_000
    station.writing.trial = Trial(7, {"gait.step_length": 0.43}, {"gait.step_length": 0.4}, until_ns)
    bench.draw(window)
    assert window.parameters.trial.isVisible()
    assert not window.trial.isVisible(), "it is told twice"
    assert not window.tabs.overview.now.keep.isVisible(), "it is asked twice"
    window._panels.put_away()
    bench.draw(window)
    assert window.tabs.overview.now.keep.isVisible()
    assert not window.trial.isVisible()
    window.tabs.setCurrentIndex(1)  # the overview shows it itself
    bench.draw(window)
    assert window.trial.isVisible()
    assert "430" in window.trial.words.text()
    station.writing.trial = None
    other = bench.add("exo-02", 7421)  # which is not looked at
    other.take([described("exo-02")])
    until_ns = time.monotonic_ns() + 30_000_000_000
    other.writing.trial = Trial(7, {"gait.step_length": 0.43}, {"gait.step_length": 0.4}, until_ns)
    bench.draw(window)
    assert window.trial.isVisible()
    assert window.trial.words.text().startswith("exo-02: on trial: step length (gait) 400 → 430 mm")
    window.trial.take_back.emit()
    assert bench.commands[1].named("revert") == [(7,)]
    assert not bench.first.named("revert")
    other.writing.trial = None


def test_the_first_click_on_cpu_gives_the_most_and_keys_do_the_same(theme: Theme) -> None:
    table = ProcessTable(theme)
    table.resize(600, 300)
    table.processes.take([ProcessUse(pid, f"p{pid}", float(pid), pid << 20) for pid in (1, 2, 3)])
    table.show()
    header = table.horizontalHeader()
    assert isinstance(header, SortHeader)
    table.sortByColumn(NAME, Qt.SortOrder.AscendingOrder)
    at = header.sectionViewportPosition(CPU) + 8
    QTest.mouseClick(header.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(at, 8))
    assert _names(table) == ["p3", "p2", "p1"]
    header.setFocus()
    for _ in range(5):
        QTest.keyClick(header, Qt.Key.Key_Left)
    QTest.keyClick(header, Qt.Key.Key_Return)
    assert _names(table) == ["p1", "p2", "p3"]
    assert header.accessibleName() == "Titles: sort by Name, lowest first"
    QTest.keyClick(header, Qt.Key.Key_Return)
    assert _names(table) == ["p3", "p2", "p1"]
    destroy(table)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("/usr/bin/python3 -I /opt/venv/bin/gwrms gateway run robot.toml", "gwrms gateway run robot.toml"),
        ("/usr/sbin/sshd -D", "sshd -D"),
        ("python3", "python3"),
    ],
)
def test_processes_of_one_name_are_told_apart_by_their_command(line: str, told: str) -> None:
    assert arguments_of(ProcessUse(7, "gwrms", 0.0, 0, line)) == told
    assert COMMAND != NAME


def test_clearing_the_filter_leaves_groups_and_the_choice_as_they_were(panel: ParametersPanel) -> None:
    tree, words = panel.tree, panel.filters.words
    tree.select_name("left_knee.max_torque")
    tree.setExpanded(tree.filter.index(0, 0), False)
    words.setText("nothing is called so")
    panel.refresh()
    words.clear()
    panel.refresh()
    assert tree.current_name == "left_knee.max_torque"
    assert not tree.isExpanded(tree.filter.index(0, 0))
    assert tree.isExpanded(tree.filter.index(1, 0))
    words.setText("gait")
    panel.refresh()
    assert tree.isExpanded(tree.filter.index(0, 0)), "what was found is not seen"
    assert panel.detail.accessibleName()
    assert panel.detail._name == "left_knee.max_torque", "another one was chosen by nobody"


def test_what_the_robot_would_refuse_is_marked_while_it_is_staged(panel: ParametersPanel) -> None:
    panel.stage("left_knee.max_torque", 200.0)  # as of a file; what is typed so is not staged
    panel.refresh()
    row = panel.tree._rows["left_knee.max_torque"]
    assert (row[NEW].text(), row[SAID].text()) == ("200", "✕ limit")
    assert "above the largest allowed, 80" in panel.banner.text()
    assert "above the largest allowed, 80" in row[NEW].toolTip()
    panel.stage_text("left_knee.max_torque", "70")
    panel.refresh()
    assert row[SAID].text() == "●"
    assert HELD["left_knee.max_torque"] == 80.0


def _names(table: ProcessTable) -> list[str]:
    return [str(table.model().index(row, NAME).data()) for row in range(table.model().rowCount())]


@pytest.mark.parametrize("key", [Qt.Key.Key_Tab, Qt.Key.Key_Backtab])
def test_tab_goes_round_on_every_page_and_comes_past_stop_and_what_is_on_the_left(
    window: MainWindow, bench: Bench, key: Qt.Key
) -> None:
    """A bar that is not shown took the keyboard, for good: STOP ALL and parameters were out of reach."""
    bench.add("exo-02", 7421).take([described("exo-02"), walking(100), looked()])
    window.resize(1366, 768)
    window.activateWindow()
    for place in range(window.tabs.count()):
        window.tabs.setCurrentIndex(place)
        bench.draw(window)
        window.header.stop.setFocus(Qt.FocusReason.TabFocusReason)
        met: list[QWidget | None] = []
        while not met or (met[-1] is not window.header.stop and len(met) < 200):
            QTest.keyClick(window.windowHandle(), key)
            met.append(QApplication.focusWidget())
        assert met[-1] is window.header.stop, window.tabs.tabText(place)
        assert window.robots.all_stop in met


def test_the_key_of_the_review_works_whatever_its_button_says(window: MainWindow, bench: Bench) -> None:
    """It went with the button's text, which changes with what is staged."""
    bench.look_again([described(), walking(100), looked()])
    held = bench.station.robot.parameters["gait.step_length"]
    for value in (0.42, 0.43):
        bench.station.edits.stage("gait.step_length", value, held)
        bench.draw(window)
    window.activateWindow()
    window.parameters.tree.setFocus()
    QTest.keyClick(window.parameters.tree, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert window.parameters.review.isVisible()
