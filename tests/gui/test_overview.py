"""The overview shows what is so, in the units of choice, and how old it is when it is so no more."""

import dataclasses
import itertools
import math
import re
import time

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace
from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QFontMetrics, QFontMetricsF, QImage
from PySide6.QtWidgets import QApplication

from gateway.client import ConnectionState
from gateway.units import Units
from gateway.wire.component import LayoutInfo, QualityInfo
from gateway.wire.stop import Stopped
from server_gui.core.alarms.beyond import FoundBeyond
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.leg_phase import leg_phase, phase_at
from server_gui.core.desk.soles import cells_of, sole
from server_gui.core.follow import robot
from server_gui.core.follow.events import LinkChanged
from server_gui.core.follow.robot import STALE_NS
from server_gui.core.processing.gait_events import EventKind, Leg
from server_gui.core.tuning.stop import Proof
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.marks import Mark
from server_gui.views.overview.joint_cells import ANGLE, ERROR, STATE, STOP, TORQUE, row_of
from server_gui.views.overview.joint_table import JointModel, JointTable
from server_gui.views.overview.page import Overview
from server_gui.views.predictions import PredictionRow, lines
from server_gui.views.theme import Theme
from server_gui.views.widgets.figure import ANKLE, SHANK, THIGH, Pose, beside_legs, chain, placed_names
from server_gui.views.widgets.pressure_map import COLUMNS, ROWS, PressureMap, weights
from tests.gui.fakes import Bench, destroy
from tests.support.desk import JOINTS, described, looked, telemetry, walking


def cells(model: JointModel, joint: int) -> list[str]:
    model.refresh()
    return [str(model.data(model.index(joint, column))) for column in range(model.columnCount())]


def colours(image: QImage) -> set[int]:
    return {image.pixel(x, y) for x in range(0, image.width(), 3) for y in range(0, image.height(), 3)}


def test_a_walk_is_seen_as_a_walk(overview: Overview, bench: Bench) -> None:
    bench.station.take([walking(600)])
    overview.refresh()
    derived = bench.station.processing.derived()
    assert derived.gait.walking
    for leg in Leg:
        phase = leg_phase(derived, leg, derived.stamp_ns)
        assert phase is not None
        assert 0.0 <= phase.percent <= 100.0
    assert len(colours(overview.grab().toImage())) > 200


def test_a_leg_far_beyond_its_stride_is_nowhere(bench: Bench) -> None:
    bench.station.take([walking(600)])
    derived = bench.station.processing.derived()
    strike_ns = max(one.stamp_ns for one in derived.events if one.kind is EventKind.HEEL_STRIKE)
    stride_s = derived.gait.legs[Leg.LEFT].stride_s
    assert stride_s is not None
    assert leg_phase(derived, Leg.LEFT, strike_ns + round(2.1e9 * stride_s)) is None


@pytest.mark.parametrize(
    ("percent", "name"),
    [
        (0.0, "loading response"),
        (12.0, "mid-stance"),
        (61.9, "pre-swing"),
        (62.0, "initial swing"),
        (100.0, "terminal swing"),
    ],
)
def test_phases_end_where_the_literature_says(percent: float, name: str) -> None:
    assert phase_at(percent) == name


def test_the_joint_table_shows_degrees_and_the_drive_state_in_words(theme: Theme, bench: Bench) -> None:
    now_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {"left_knee.position": [0.5], "left_knee.state": [4.0]}
    bench.station.take([looked(), telemetry([now_ns], columns, now_ns)])
    left_knee = cells(JointModel(bench.desk, theme), 1)
    assert left_knee[:3] == ["left knee", "● operation enabled", "+28.6 / –"]
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", now_ns)])
    assert cells(JointModel(bench.desk, theme), 1)[1] == "● was operation enabled"


def test_another_unit_is_shown_at_once(theme: Theme, bench: Bench) -> None:
    bench.station.take([telemetry([1], {"left_knee.position": [0.5]})])
    bench.desk.shown.change(Units(by_si={"rad": "rad"}))
    model = JointModel(bench.desk, theme)
    assert cells(model, 1)[2] == "+0.500 / –"
    assert model.headerData(2, Qt.Orientation.Horizontal) == "Angle / target rad"


def test_a_missing_value_is_a_dash_and_never_the_old_one(theme: Theme, bench: Bench) -> None:
    model = JointModel(bench.desk, theme)
    bench.station.take([telemetry([1], {"left_knee.position": [0.5]})])
    assert cells(model, 1)[2] == "+28.6 / –"
    bench.station.take([telemetry([2], {"left_knee.position": [None]})])
    assert cells(model, 1)[2] == "– / –"


def test_a_lost_joint_is_named_lost_with_its_age(theme: Theme, bench: Bench) -> None:
    bench.station.take([walking(5), looked(state="lost", problem="no heartbeat")])
    assert re.fullmatch(r"✕ lost \d+\.\d s", cells(JointModel(bench.desk, theme), 1)[1])


def test_what_is_older_than_half_a_second_is_grey_and_says_so(
    overview: Overview, theme: Theme, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot, "STALE_NS", STALE_NS)
    bench.station.take([walking(300, age_s=3.0)])
    overview.refresh()
    assert all(re.match(r"STALE, \d+\.\d s", note) for note in overview.notes)
    model = JointModel(bench.desk, theme)
    model.refresh()
    shown = model.data(model.index(1, 2), Qt.ItemDataRole.ForegroundRole)
    assert shown == theme.colour("old")


def test_before_the_first_data_it_says_that_there_are_none(overview: Overview) -> None:
    overview.refresh()
    assert set(overview.notes) == {"no data yet"}


def test_an_insole_that_no_layout_describes_is_drawn_in_its_order(overview: Overview, bench: Bench) -> None:
    bench.station.take([described(cells=20), walking(20, -3600.0, cells=20)])
    overview.refresh()
    assert "20 cells in their order" in overview.notes[2]
    assert len(colours(overview.grab().toImage())) > 50


def test_an_insole_that_the_robot_describes_is_drawn_as_it_says(overview: Overview, bench: Bench) -> None:
    cells = [(0.05 + 0.01 * number, 0.02 if number % 2 else -0.02, 1e-3) for number in range(20)]
    bench.station.take([described(layout=LayoutInfo("own-20", cells)), walking(20, -3600.0, cells=20)])
    overview.refresh()
    assert overview.notes[2] == "20 cells, own-20"
    assert sole(bench.station.robot, "left").cells == tuple((x, y) for x, y, _ in cells)


def test_a_layout_of_other_cells_than_the_robot_sends_is_not_believed(bench: Bench) -> None:
    bench.station.take([described(layout=LayoutInfo("own-2", [(0.1, 0.0, 1e-3)] * 2)), walking(20)])
    found = sole(bench.station.robot, "left")
    assert found.cells == cells_of(16, right=False)
    assert "the robot does not say where they are" in found.source


def test_a_foot_that_is_larger_than_the_drawing_is_drawn_whole(theme: Theme) -> None:
    foot = PressureMap(theme, "left")
    foot.set_cells(((0.03, 0.0), (0.31, -0.03)))
    foot.show_pressures([0.0, 100_000.0], (0.31, -0.03), live=True)
    assert np.frombuffer(foot._image.bits(), np.uint8).max() > 50
    (x, y) = foot._trail[-1] or (0.0, 0.0)
    assert (x, y) == pytest.approx((0.250, -0.03 * 0.250 / 0.31))


def test_a_straight_leg_stands_below_its_hip_and_a_bent_knee_brings_the_ankle_back() -> None:
    _, ankle, heel, toe = chain(Pose(0.0, 0.0, 0.0), 0.0)
    assert (ankle.x(), ankle.y()) == pytest.approx((0.0, THIGH + SHANK))
    assert heel.y() == toe.y() == pytest.approx(THIGH + SHANK + ANKLE)
    assert heel.x() < ankle.x() < toe.x()
    _, bent, _, _ = chain(Pose(0.0, math.pi / 2, 0.0), 0.0)
    assert (bent.x(), bent.y()) == pytest.approx((-SHANK, THIGH))


def test_who_leans_forward_with_a_flexed_hip_keeps_the_thigh_upright() -> None:
    knee, *_ = chain(Pose(0.3, 0.0, 0.0), 0.3)
    assert knee.x() == pytest.approx(0.0)


def test_flexing_the_ankle_lifts_the_toes() -> None:
    _, _, heel, toe = chain(Pose(0.0, 0.0, 0.3), 0.0)
    assert toe.y() < heel.y()


@pytest.mark.parametrize("size", [(130, 96), (190, 170), (400, 300)])
def test_names_of_several_joints_in_trouble_never_lie_over_each_other(
    theme: Theme, size: tuple[int, int]
) -> None:
    joints = [(side, joint) for side in ("left", "right") for joint in ("hip", "knee", "ankle")]
    room, metrics = QSizeF(*size), QFontMetricsF(theme.text_font(bold=True))
    places = [QPointF(size[0] / 2 + 10 * at, size[1] * (0.5 + 0.07 * at)) for at in range(3)] * 2
    where = dict(zip(joints, places, strict=True))
    for count in range(1, len(joints) + 1):
        for some in itertools.combinations(joints, count):
            found = placed_names({one: where[one] for one in some}, metrics, 5.0, room)
            boxes = [box for _, box, _ in found]
            assert not any(one.intersects(other) for one, other in itertools.combinations(boxes, 2)), some
            assert all(QRectF(QPointF(), room).contains(box) for box in boxes), some
            assert sum(len(points) for _, _, points in found) == count
            for side, joint in some:
                assert any(name in (f"{side} {joint}", f"both {joint}s") for name, _, _ in found), some


def test_pressure_lies_where_its_cell_is_and_mirrors_on_the_other_foot() -> None:
    left, right = cells_of(16, right=False), cells_of(16, right=True)
    assert left is not None
    assert right is not None
    pressures = np.zeros(16, np.float32)
    pressures[13] = 100_000.0  # the great toe: before everything, on the inner side
    for layout, inner in ((left, slice(COLUMNS // 2, None)), (right, slice(0, COLUMNS // 2))):
        field = (weights(layout) @ pressures).reshape(ROWS, COLUMNS)
        assert field[: ROWS // 3].max() == field.max() > 50_000.0
        assert field[:, inner].max() == field.max()
        assert field[ROWS // 2 :].max() < 1_000.0


def test_equal_pressure_everywhere_is_shown_as_that_pressure() -> None:
    layout = cells_of(16, right=False)
    assert layout is not None
    field = weights(layout) @ np.full(16, 100_000.0, np.float32)
    assert field.max() == pytest.approx(100_000.0, rel=1e-3)


def test_the_trail_is_bounded_and_a_foot_in_the_air_has_none(theme: Theme) -> None:
    foot = PressureMap(theme, "left")
    foot.set_cells(cells_of(16, right=False))
    for _ in range(500):
        foot.show_pressures([1000.0] * 16, (0.1, 0.0), live=True)
    assert len(foot._trail) < 50
    foot.show_pressures([0.0] * 16, None, live=True)
    assert len(colours(foot.grab().toImage())) > 3


def test_a_sole_that_tells_nothing_says_why_and_leaves_the_other_no_share(
    overview: Overview, bench: Bench
) -> None:
    bench.station.take([walking(20, -3600.0)])
    overview.read_now()
    overview.refresh()
    texts = {side: overview._loads[side].text() for side in ("left", "right")}
    assert all(text.endswith(" N") for text in texts.values())
    assert overview._shares["left"].text().endswith(" % of the load")
    lost = looked()
    lost.quality.quality["left_insole"] = {"state": "lost", "age_ms": 4200.0, "problem": "it went away"}
    columns: dict[str, list[float | None]] = {"left_insole.force": [None], "right_insole.force": [600.0]}
    newest_ns = bench.station.rings.newest_ns or 0
    bench.station.take([lost, telemetry([newest_ns + 1], columns)])
    overview.read_now()
    overview.refresh()
    assert overview._loads["left"].text() == "LEFT  insole lost"
    assert overview._maps["left"].accessibleDescription() == "insole lost"
    assert overview._loads["right"].text() == "RIGHT  600 N"
    assert overview._shares["right"].text() == "– of the load"


def test_figures_of_the_load_never_wait_where_the_pressures_show_the_other_foot(
    overview: Overview, bench: Bench
) -> None:
    bench.station.take([walking(20, -3600.0)])
    overview.read_now()
    newest_ns = bench.station.rings.newest_ns or 0
    for step, (left, right) in enumerate([(900.0, 0.0), (0.0, 900.0)], 1):
        columns: dict[str, list[float | None]] = {"left_insole.force": [left], "right_insole.force": [right]}
        bench.station.take([telemetry([newest_ns + step], columns)])
        overview.refresh()
        assert overview._loads["left"].text() == f"LEFT  {left:.0f} N"
        assert overview._shares["right"].text() == f"{right / 9:.0f} % of the load"


def test_a_joint_in_trouble_is_in_words_with_its_code_and_no_zero_is_negative(
    theme: Theme, bench: Bench
) -> None:
    why = "the drive is in fault: 0x2310 continuous overcurrent at the output (register: generic)"
    columns: dict[str, list[float | None]] = {
        "left_knee.state": [7.0],
        "left_knee.error_code": [float(0x2310)],
        "left_knee.torque": [-0.0],
        "left_knee.position": [-0.0001],
    }
    received_ns = time.monotonic_ns()
    bench.station.take([telemetry([received_ns], columns, received_ns), looked(state="fault", problem=why)])
    shown = cells(JointModel(bench.desk, theme), 1)
    assert shown[ERROR] == "0x2310 continuous overcurrent at the output"
    assert shown[TORQUE] == "0.00 / 80"
    assert shown[2] == "0.0 / –", "it goes to no target"
    for state, aim in ((6.0, "off"), (5.0, "–"), (4.0, "0.0")):  # it brakes in quick stop
        columns |= {"left_knee.state": [state], "left_knee.target_position": [0.0001]}
        bench.station.take([telemetry([received_ns], columns, received_ns), looked()])
        assert cells(JointModel(bench.desk, theme), 1)[2].split(" / ")[1].lstrip("+") == aim
    assert cells(JointModel(bench.desk, theme), 0)[ERROR] == "–"


def test_an_error_code_that_only_the_robot_names_is_told_as_one_that_is_sent(
    theme: Theme, bench: Bench
) -> None:
    why = "the drive is in fault: 0x2310 continuous overcurrent at the output (register: generic)"
    bench.station.take([walking(10), looked(state="fault", problem=why)])
    assert cells(JointModel(bench.desk, theme), 1)[ERROR] == "0x2310 continuous overcurrent at the output"


def test_proof_of_a_stop_stands_at_each_joint(theme: Theme, bench: Bench) -> None:
    received_ns = time.monotonic_ns()
    bench.station.take([telemetry([received_ns], {"left_knee.state": [5.0]}, received_ns)])
    model = JointModel(bench.desk, theme)
    assert cells(model, 1)[STOP] == "–"
    bench.station.stopping.sent()
    bench.station.stopping.proofs = {"left_knee": Proof(38.4, "quick stop active")}
    assert cells(model, 1)[STOP] == "38 ms"
    assert cells(model, 0)[STOP] == "no proof"


def test_proof_of_a_stop_that_was_reset_is_no_good_news_any_more(theme: Theme, bench: Bench) -> None:
    stopping = bench.station.stopping
    stopping.answered(stopping.sent(), Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    stopping.proofs = dict.fromkeys(JOINTS, Proof(38.4, "quick stop active"))
    bench.station.take([telemetry([now := time.monotonic_ns()], {"left_knee.state": [6.0]}, now)])
    assert row_of(bench.station, "left_knee", bench.desk)[STOP].colour == "good"
    stopping.was_reset(held=False)
    past = row_of(bench.station, "left_knee", bench.desk)[STOP]
    assert (past.text, past.colour) == ("38 ms", "dim")
    assert past.tip.endswith("which was reset since")


def test_enabled_is_no_good_state_after_a_stop_that_is_sent_or_not_confirmed(
    overview: Overview, theme: Theme, bench: Bench
) -> None:
    bench.station.take([walking(100), looked()])
    number = bench.station.stopping.sent()
    for failed, colour in ((False, "warn"), (True, "bad")):
        if failed:
            bench.station.stopping.failed(number, "no link")
        overview.read_now()
        overview.refresh()
        model = JointModel(bench.desk, theme)
        model.refresh()
        assert overview.now.drives._icon._mark.colour == colour
        assert {row[STATE].colour for row in model._cells} == {colour}


def test_a_leg_that_the_robot_does_not_have_is_nowhere(theme: Theme, bench: Bench) -> None:
    """It assists the left one alone, and has both insoles: no zero and no dash for the other's joints."""
    full, rows = described(), walking(600, -3600.0)
    mine = [one for one in full.description.components if not is_of_right_leg(one.name)]
    columns = {name: list(each) for name, each in rows.batch.columns.items() if not is_of_right_leg(name)}
    bench.station.take([dataclasses.replace(full, description=replace(full.description, components=mine))])
    bench.station.take([telemetry(list(rows.batch.stamps_ns), columns, rows.batch.received_ns)])
    overview = Overview(bench.desk, theme)
    overview.resize(660, 560)
    overview.show()
    overview.refresh()
    overview.grab()
    assert [plot.channels for plot in overview._plots[:2]] == [("left_knee.position",), ("left_knee.torque",)]
    assert "right" not in overview._plots[0].plot.accessibleDescription()
    assert set(overview._figure._legs) == {"left"}
    assert "right" not in overview._figure.accessibleDescription()
    assert set(overview._model._joints) == {"left_hip", "left_knee", "left_ankle"}
    assert overview._maps["right"].isVisible()
    destroy(overview)


def is_of_right_leg(name: str) -> bool:
    """Not of its insole."""
    return name.startswith("right_") and "insole" not in name


@pytest.mark.parametrize("happened", ["nothing", "link lost", "old"])
def test_nothing_on_the_overview_is_green_where_nothing_is_known(
    overview: Overview, theme: Theme, bench: Bench, monkeypatch: pytest.MonkeyPatch, happened: str
) -> None:
    monkeypatch.setattr(robot, "STALE_NS", STALE_NS)
    if happened != "nothing":
        bench.station.take([walking(300, 3.0 if happened == "old" else -3600.0), looked()])
    if happened == "link lost":
        bench.station.take([LinkChanged(ConnectionState.WAITING, "no route", time.monotonic_ns())])
    overview.read_now()
    overview.refresh()
    marks = [fact._icon._mark for fact in (overview.now.drives, overview.now.activity)]
    marks += [icon._mark for icon, label in overview.status_lines._rows if not label.isHidden()]
    assert "good" not in {mark.colour for mark in marks}
    assert overview._ring._word == "Not known"
    model = JointModel(bench.desk, theme)
    model.refresh()
    assert "good" not in {cell.colour for row in model._cells for cell in row}
    assert "text" not in {row[column].colour for row in model._cells for column in range(2, 7)}


def test_what_the_latest_stop_did_is_the_last_column_to_go(bench: Bench, theme: Theme) -> None:
    bench.station.take([walking(50), looked()])
    bench.station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    model = JointModel(bench.desk, theme)
    table = JointTable(model, theme)
    model.refresh()
    assert model.is_stop_news
    table.show()
    hidden: list[int] = []
    for width in range(900, 250, -25):
        table.resize(width, 200)
        hidden += [
            column for column in range(STOP + 1) if table.isColumnHidden(column) and column not in hidden
        ]
    order = [*hidden, STOP]
    assert order.index(TORQUE) < order.index(ANGLE) < order.index(STOP)
    destroy(table)


def test_a_column_of_errors_that_says_nothing_goes_before_angles(bench: Bench, theme: Theme) -> None:
    bench.station.take([walking(50), looked()])
    model = JointModel(bench.desk, theme)
    table = JointTable(model, theme)
    model.refresh()
    table.show()
    for width in range(900, 200, -20):
        table.resize(width, 200)
        if table.isColumnHidden(ANGLE) or table.isColumnHidden(TORQUE):
            assert table.isColumnHidden(ERROR), width
    assert table.isColumnHidden(ERROR)
    destroy(table)


def test_letters_of_the_sides_stand_on_no_leg(theme: Theme) -> None:
    metrics = QFontMetrics(theme.text_font(bold=True))
    leg = [QPointF(50, 20), QPointF(52, 50), QPointF(46, 80), QPointF(70, 82)]
    taken: list[QRectF] = []
    for text in "LR":
        beside_legs(text, QPointF(44, 80), metrics, [leg], 2.0, taken)
    first, second = taken
    assert not first.intersects(second)
    for box in taken:
        assert not any(box.contains(point) for point in leg)


@pytest.mark.parametrize(("height", "is_first"), [(700, True), (1200, False)])
def test_the_order_of_the_overview_stays_as_alarms_and_lines_come_and_go(
    window: MainWindow, bench: Bench, height: int, is_first: bool
) -> None:
    """It flipped as a line came: what somebody read was elsewhere, just when something was wrong."""
    window.resize(1366, height)
    bench.station.take([walking(100), looked()])
    bench.draw(window)
    page = window.tabs.overview
    assert page._is_low is is_first
    orders = set()
    for spare in (-400, 30, 400):
        page.status_lines.setFixedHeight(max(20, 200 - spare))
        bench.draw(window)
        orders.add(page._joints.y() < page._status.y())
    assert orders == {is_first}


def test_the_ring_stays_as_large_as_lines_below_it_come_and_go(overview: Overview) -> None:
    row = PredictionRow(Mark("ring", "dim", "steady"), "Balance: Steady")
    seen = set()
    for count in (0, 1, 3):
        overview.status_lines.show_lines([row] * count)
        QApplication.processEvents()
        seen.add((overview._ring.height(), overview._plots[0].y()))
    assert len(seen) == 1


def test_a_drive_in_fault_is_named_from_its_first_row_on(overview: Overview, bench: Bench) -> None:
    """Figure and lines of the wearer named it up to a second later: once the robot said so of it."""
    now_ns = time.monotonic_ns()
    station = bench.station
    states: dict[str, list[float | None]] = {f"{joint}.state": [5.0] for joint in JOINTS}
    states["right_hip.state"] = [7.0]
    station.take([walking(10), looked(), telemetry([now_ns], states, now_ns)])
    assert station.robot.not_ok() == []
    overview.read_now()
    overview.refresh()
    assert "right hip not ok" in overview._figure.accessibleDescription()
    assert any(row.text == "right hip: fault" for row in lines(station))


def test_the_first_line_leads_with_the_worst_of_the_robot_as_its_card_does(
    overview: Overview, bench: Bench
) -> None:
    """It was green beside a card that said that an insole was lost."""
    now = looked()
    lost: QualityInfo = {"state": "lost", "age_ms": 4000.0, "problem": "the port is gone"}
    quality = msgspec.structs.replace(now.quality, quality={**now.quality.quality, "left_insole": lost})
    bench.station.take([walking(100), dataclasses.replace(now, quality=quality)])
    overview.read_now()
    overview.refresh()
    icon = overview.now.drives._icon._mark
    assert (icon.shape, icon.colour) == (bench.station.mark.shape, bench.station.mark.colour)
    assert overview.now.drives.main.text() == "Left insole lost"
    assert overview.now.drives.detail.text().endswith("6 of 6 enabled")


def test_a_joint_beyond_its_ends_says_so_in_its_row(
    theme: Theme, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = (FoundBeyond(Kind.BEYOND, "left_knee", "position", "it is at 130°"),)
    monkeypatch.setattr(bench.station._alarms.beyond, "look", lambda _robot, **_: found)
    bench.station.take([walking(100), looked()])
    row = row_of(bench.station, "left_knee", bench.desk)
    assert (row[ERROR].text, row[ERROR].colour, row[ANGLE].colour) == ("beyond its ends", "bad", "bad")
    assert row_of(bench.station, "right_knee", bench.desk)[ERROR].text == "–"
