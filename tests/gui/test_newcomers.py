"""What newcomers who walked through the window ran into."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from gateway.client import NotConnected
from server_gui.core.alarms.texts import Kind
from server_gui.core.tuning.stop import Proof
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.overview.joint_cells import ERROR, NONE, STATE, STOP
from server_gui.views.overview.joint_table import JointModel
from server_gui.views.overview.page import Overview
from server_gui.views.parameters.panel import ParametersPanel
from server_gui.views.parameters.tree import NAME, NEW
from server_gui.views.predictions import lines
from server_gui.views.theme import Theme
from server_gui.views.widgets.figure import Pose, StickFigure
from server_gui.views.widgets.time_axis import LAST, NOW
from tests.gui.fakes import Around, Bench, destroy
from tests.gui.running import wait
from tests.support.desk import JOINTS, looked, walking

ANGLES = {side: ["+16°", "+43°", "-13°"] for side in ("left", "right")}
OLD_S = 70.0
MANY = (
    "overcurrent, 0x2310; its position jumped by 8.7° within 50 ms, which is not its speed; "
    "11 % of its PDOs are missing (for 60 s)"
)
LASTING = " (for 60 s)"


@pytest.mark.parametrize("typed", ["430", "F2"])
def test_a_value_is_typed_wherever_its_row_was_clicked(panel: ParametersPanel, typed: str) -> None:
    tree = panel.tree
    tree.select_name("gait.step_length")
    name = tree.visualRect(tree.currentIndex().siblingAtColumn(NAME)).center()
    QTest.mouseClick(tree.viewport(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, name)
    if typed == "F2":
        QTest.keyClick(tree, Qt.Key.Key_F2)
    else:
        QTest.keyClicks(tree, typed[0])
    assert tree.currentIndex().column() == NEW
    assert tree.state() == tree.State.EditingState


@pytest.mark.parametrize("width", [130, 160, 400])
def test_no_angle_beside_the_figure_is_cut(theme: Theme, width: int) -> None:
    theme.set(scale=1.5)
    figure = StickFigure(theme)
    figure.resize(width, 240)
    poses = dict.fromkeys(ANGLES, Pose(0.3, 0.7, -0.2))
    figure.show_pose(poses, 0.05, frozenset(), ANGLES, live=True)
    image = figure.grab().toImage()
    behind = image.pixelColor(0, image.height() - 1)
    edge = [image.pixelColor(0, y) for y in range(image.height() // 3)]
    assert all(colour == behind for colour in edge), "a letter runs over the edge"
    destroy(figure)


def test_what_is_old_looks_old_and_is_not_called_now(theme: Theme, bench: Bench) -> None:
    overview = Overview(bench.desk, theme)
    overview.resize(1000, 800)
    overview.show()

    def is_live() -> bool:
        bench.look_again([walking(200), looked()])
        overview.read_now()
        overview.refresh()
        return {label.property("tone") for label in overview._loads.values()} == {""}

    wait(is_live, "looked live")
    axis = overview._plots[0].plot.getPlotItem().getAxis("bottom")
    assert axis.tickStrings([0.0], 1.0, 1.0) == [NOW]
    live = overview._plots[0].legend.text()
    bench.look_again([walking(200, age_s=OLD_S), looked()])
    overview.read_now()
    overview.refresh()
    assert not bench.station.is_live
    assert axis.tickStrings([0.0], 1.0, 1.0) == [LAST]
    assert {label.property("tone") for label in overview._loads.values()} == {"old"}
    assert overview._plots[0].legend.text().split("color:")[1][:7] != live.split("color:")[1][:7]
    destroy(overview)


def test_a_robot_that_is_linked_again_is_not_said_to_have_no_link_now(bench: Bench) -> None:
    bench.station.take([walking(100), looked()])
    bench.station.stop("STOP button of the window")
    bench.first.fail(NotConnected(f"nothing was sent; {MANY}"))
    bench.look_again([walking(100), looked()])
    (alarm,) = (one.alarm for one in bench.station.alarms.active if one.alarm.kind is Kind.STILL_MOVING)
    assert alarm.line.endswith("STOP again; the last STOP failed: there was no link")
    assert alarm.brief == "STILL MOVING: STOP again"


def test_a_card_stays_small_however_much_is_wrong(around: Around, bench: Bench) -> None:
    bench.station.take([walking(100), looked(state="fault", problem=MANY)])
    bench.draw(around)
    QApplication.processEvents()
    card = around.robots.cards[0]
    assert card.texts[1].endswith("0x2310 …")
    assert MANY.removesuffix(LASTING) in around.alarms.texts[0]
    assert LASTING not in around.alarms.texts[0], "since when stands there already"


def test_stop_names_the_robot_that_was_chosen_with_the_next_frame(window: MainWindow, bench: Bench) -> None:
    bench.station.take([walking(100), looked()])
    second = bench.add("exo-02", 7421)
    bench.draw(window)
    for station in (second, bench.station, second):
        bench.desk.select(station)
        window.refresh()
        assert window.header.stop.accessibleName() == f"STOP {station.title}"


def test_a_device_in_trouble_has_one_colour_and_word_everywhere(theme: Theme, bench: Bench) -> None:
    bench.station.take([walking(100), looked(state="stale", problem="no new sample for 0.7 s")])
    (alarm,) = (one.alarm for one in bench.station.alarms.active)
    (line,) = (line for line in lines(bench.station) if "left knee" in line.text)
    assert line.mark == alarm.mark
    assert line.text == f"left knee: {alarm.mark.word}"
    model = JointModel(bench.desk, theme)
    model.refresh()
    row = JOINTS.index("left_knee")
    inks = {model.index(row, column).data(Qt.ItemDataRole.ForegroundRole).name() for column in (STATE, ERROR)}
    assert inks == {theme.colour(alarm.mark.colour).name()}, "also in the table of joints"


def test_a_drive_that_is_enabled_again_has_no_proof_of_an_old_stop(theme: Theme, bench: Bench) -> None:
    bench.station.take([walking(200), looked()])
    bench.station.stopping.proofs = {joint: Proof(26.0, "quick stop active") for joint in JOINTS}
    model = JointModel(bench.desk, theme)
    model.refresh()
    words = {str(bench.station.robot.word(f"{joint}.state")) for joint in JOINTS}
    assert words == {"operation enabled"}
    shown = [model.index(row, STOP).data() for row in range(model.rowCount())]
    assert set(shown) == {NONE}
