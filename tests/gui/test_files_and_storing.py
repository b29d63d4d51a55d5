"""Parameters beside a file, pinned ones, defaults, and storing: none of it writes by itself."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog

from gateway.wire.parameter import Stored, Written
from server_gui.views.frame.docks import STACK
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.parameters.panel import ParametersPanel
from server_gui.views.parameters.store_page import SETTLE_MS
from server_gui.views.parameters.tree import DEFAULT, FILE, NAME, NEW, TITLES
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy
from tests.gui.running import wait
from tests.support.desk import HELD, described, looked, walking

HIGH = 420  # beside an alarm and a trial on a screen of 700

FILE_TEXT = """
[robot]
name = "exo-07"
[parameters]
"gait.step_length" = 0.43
"gait.trunk_angle" = 0.05
"left_knee.max_torque" = 95.0
"left_hip.no_such" = 1
"""


@pytest.fixture
def panel(theme: Theme, bench: Bench) -> Iterator[ParametersPanel]:
    """Wide enough for every column."""
    bench.station.take([looked()])
    made = ParametersPanel(bench.desk, theme)
    made.resize(620, 900)
    made.show()
    made.refresh()
    yield made
    destroy(made)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "monday.toml"
    made.write_text(FILE_TEXT, encoding="utf-8")
    return made


def shown(panel: ParametersPanel) -> list[str]:
    """The parameters that are in sight."""
    panel.refresh()
    model = panel.tree.filter
    groups = [model.index(row, NAME) for row in range(model.rowCount())]
    return [
        str(model.index(row, NAME, group).data()) for group in groups for row in range(model.rowCount(group))
    ]


def row(panel: ParametersPanel, name: str) -> list[str]:
    panel.refresh()
    panel.tree.select_name(name)
    index = panel.tree.currentIndex()
    return [str(index.siblingAtColumn(column).data() or "") for column in range(len(TITLES))]


# A file


def test_a_file_is_compared_and_nothing_is_staged_or_sent(
    panel: ParametersPanel, bench: Bench, file: Path
) -> None:
    panel.open_file(file)
    assert panel.file.isVisible()
    assert panel.file.words.text() == (
        "monday.toml: 2 of 3 differ · 1 cannot be changed on this robot\n"
        "▲ it was saved from exo-07, this is exo-01"
    )
    assert row(panel, "gait.step_length")[FILE] == "430"
    assert bench.station.edits.staged == {}
    assert bench.first.asked == []


def test_the_filter_shows_what_differs_from_the_file_as_the_robot_changes(
    panel: ParametersPanel, bench: Bench, file: Path
) -> None:
    panel.open_file(file)
    panel.filters.buttons["≠ file"].click()
    assert shown(panel) == ["step length", "max torque"]
    bench.station.take([looked({**HELD, "gait.step_length": 0.43})])
    assert shown(panel) == ["max torque"]
    assert panel.filters.buttons["≠ file"].text() == "≠ file 1"


def test_loading_a_file_stages_its_differences_for_review(
    panel: ParametersPanel, bench: Bench, file: Path
) -> None:
    panel.open_file(file)
    panel.file.stage_button.click()
    assert row(panel, "gait.step_length")[NEW] == "430"
    panel.begin_review()
    assert [(change.name, change.new, change.problem) for change in panel.review.changes] == [
        ("gait.step_length", 0.43, None),
        ("left_knee.max_torque", 95.0, "above the largest allowed, 80 N·m"),
    ]
    QTest.qWait(SETTLE_MS + 100)
    assert not panel.review.write_it.isEnabled(), "what the robot would refuse can be written"
    assert bench.first.asked == []


def test_a_file_that_cannot_be_used_says_why_and_the_last_one_stays(
    panel: ParametersPanel, bench: Bench, file: Path, tmp_path: Path
) -> None:
    panel.open_file(file)
    (tmp_path / "a.toml").write_text("step = ", encoding="utf-8")
    panel.open_file(tmp_path / "a.toml")
    panel.refresh()
    assert "is no TOML" in panel.banner.text()
    assert bench.station.file is not None
    assert bench.station.file.path == file


def test_what_is_saved_compares_as_the_same(panel: ParametersPanel, bench: Bench, tmp_path: Path) -> None:
    panel.save_file(tmp_path / "now.toml")
    panel.refresh()
    assert "3 parameters saved" in panel.banner.text()
    panel.open_file(tmp_path / "now.toml")
    assert panel.file.words.text() == "now.toml: 0 of 3 differ"
    assert not panel.file.stage_button.isEnabled()


def test_a_file_stays_with_its_robot(panel: ParametersPanel, bench: Bench, file: Path) -> None:
    panel.open_file(file)
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02"), looked()])
    bench.desk.select(other)
    panel.refresh()
    assert not panel.file.isVisible()
    assert panel.filters.buttons["≠ file"].text() == "≠ file 0"


def test_the_dialogs_stand_in_nobodys_way(panel: ParametersPanel) -> None:
    for button in (panel._compare, panel._save):
        button.click()
        dialog = panel.findChild(QDialog)
        assert dialog is not None
        assert not dialog.isModal()
        dialog.close()
        QApplication.processEvents()


# Pins and defaults


def test_pinned_parameters_are_kept_for_their_robot(
    window: MainWindow, bench: Bench, theme: Theme, qt: QApplication
) -> None:
    bench.station.take([looked()])
    bench.draw(window)
    window.parameters.tree.select_name("gait.step_length")
    window.parameters.tree.setFocus()
    QTest.keyClick(window.parameters.tree, Qt.Key.Key_P, Qt.KeyboardModifier.ControlModifier)
    window.parameters.tree.select_name("left_knee.max_torque")
    window.parameters.detail.pin.click()
    window.parameters.filters.buttons["★"].click()
    assert shown(window.parameters) == ["★ step length", "★ max torque"]
    window.parameters.detail.pin.click()
    assert shown(window.parameters) == ["★ step length"]
    window.close()
    other = Bench(type(bench.desk)())
    other.add("exo-01").take([described(), looked()])
    other.add("exo-02").take([described("exo-02"), looked()])
    again = MainWindow(other.desk, theme, window.kept)
    assert [sorted(other.desk.pins.of(name)) for name in ("exo-01", "exo-02")] == [["gait.step_length"], []]
    destroy(again)


def test_the_default_of_the_eds_is_shown_and_filtered_by(panel: ParametersPanel) -> None:
    assert row(panel, "gait.step_length")[DEFAULT] == "420"
    assert row(panel, "left_knee.max_torque")[DEFAULT] == "–"
    panel.filters.buttons["≠ default"].click()
    assert shown(panel) == ["step length", "trunk angle"]


def test_every_button_has_room_where_panels_stand_one_behind_the_other(
    panel: ParametersPanel, bench: Bench
) -> None:
    panel.be_short(True)
    panel.tree.select_name("gait.step_length")
    for value in (0.43, 9.0):
        panel.stage("gait.step_length", value)
        panel.refresh()
        panel.begin_review()
        panel.review.write_it.setText("Overwrite 12 now")
        QApplication.processEvents()  # layouts within another are laid out anew by events
        assert panel.minimumSizeHint().width() <= STACK
        panel.pages.setCurrentIndex(0)
    assert "above the largest allowed" in panel.detail._facts.text()
    panel.stage("gait.step_length", 0.43)
    panel.resize(STACK, 600)
    panel.refresh()
    QApplication.processEvents()
    for part in (panel.detail._facts, panel.detail.range):
        assert part.visibleRegion().boundingRect() == part.rect(), "part of it is cut off"
    facts = panel.detail._facts.text()
    for said in ("default 420", "stored: unknown", "may be changed", "one write moves it by", "object 0x"):
        assert said in facts
    assert panel.heightForWidth(STACK) <= HIGH


def test_a_narrow_table_keeps_what_matters_and_the_card_has_the_rest(panel: ParametersPanel) -> None:
    assert not panel.tree.isColumnHidden(DEFAULT)
    panel.resize(400, 900)
    QApplication.processEvents()
    assert panel.tree.isColumnHidden(DEFAULT)
    panel.tree.select_name("gait.step_length")
    assert "default 420 · stored: unknown" in panel.detail._facts.text()


# Storing


def begin(panel: ParametersPanel) -> None:
    panel.tree.select_name("left_knee.max_torque")
    panel.store_button.click()
    wait(lambda: not panel.storing._settled.isActive(), "was settled")
    panel.refresh()


def test_storing_is_a_step_of_its_own_that_says_what_it_is(panel: ParametersPanel, bench: Bench) -> None:
    panel.tree.select_name("left_knee.max_torque")
    panel.store_button.click()
    assert panel.storing.isVisible()
    assert not panel.storing.store_it.isEnabled(), "a click meant for what stood there before counts"
    begin(panel)
    assert panel.storing.store_it.text() == "Store left knee"
    panel.storing.store_it.click()
    assert bench.first.asked == [("store", ("left_knee",))]
    panel.refresh()
    assert panel.banner.text() == "left_knee is storing to its flash …"
    bench.first.answer(Stored("left_knee", "stored, and it still holds the same values"))
    panel.refresh()
    assert panel.banner.text() == "left_knee: stored, and it still holds the same values"


def test_what_is_staged_is_said_not_to_be_stored(panel: ParametersPanel) -> None:
    panel.stage_text("left_knee.max_torque", "60")
    begin(panel)
    assert "left_knee.max_torque: staged and not written, so not stored" in panel.storing.said.text()


def test_what_speaks_against_storing_is_said_and_it_cannot_be_asked_for(
    panel: ParametersPanel, bench: Bench
) -> None:
    bench.station.take([walking(2)])
    begin(panel)
    assert "left_knee under power" in panel.storing.said.text()
    assert not panel.storing.store_it.isEnabled()
    bench.station.robot.values["left_knee.state"] = 7.0
    written = Written(7, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=20.0)
    bench.station.writing.done(written)
    panel.refresh()
    assert "gait.step_length is on trial" in panel.storing.said.text()
    assert not panel.storing.store_it.isEnabled()
