"""Signals are zoomed while they go on, and measured with two cursors, by mouse and by keys."""

import csv
import dataclasses
import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from gateway.units import Unit, Units
from server_gui.core.desk.measuring import Measured, measure, nearest, row_at
from server_gui.views.theme import Theme
from server_gui.views.widgets.plot import Curve, Plot
from server_gui.views.workspace.measuring import TITLES, Measuring
from server_gui.views.workspace.page import Signals
from tests.gui.fakes import Bench, destroy
from tests.support.desk import described, telemetry

RATE_HZ = 100
START_NS = 1_000_000_000_000
KNEE, FORCE = "left_knee.position", "left_insole.force"


@pytest.fixture
def signals(theme: Theme, bench: Bench) -> Iterator[Signals]:
    """Ten seconds: the knee's angle rises by 1 rad/s, the force stays."""
    add(bench, 0, 1000)
    made = Signals(bench.desk, theme)
    made.resize(900, 700)
    made.show()
    made.refresh()
    made.choose([KNEE, FORCE])
    QApplication.processEvents()
    made.refresh()
    yield made
    destroy(made)


def add(bench: Bench, first: int, rows: int) -> None:
    numbers = range(first, first + rows)
    columns: dict[str, list[float | None]] = {
        KNEE: [number / RATE_HZ for number in numbers],
        FORCE: [700.0] * rows,
    }
    bench.station.take([telemetry([START_NS + number * 10_000_000 for number in numbers], columns)])


def cell(view: Measuring, row: int, title: str) -> str:
    item = view.table.item(row, TITLES.index(title))
    return "" if item is None else item.text()


def title(signals: Signals) -> str:
    signals.read_now()
    signals.refresh()
    return " ".join(signals.measuring.times.text().split())


def wheel(plot: Plot, at: QPointF, turns: int) -> None:
    event = QWheelEvent(
        at,
        plot.viewport().mapToGlobal(at),
        QPoint(0, 0),
        QPoint(0, 120 * turns),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(plot.viewport(), event)


def place(plot: Plot, share: float) -> QPoint:
    """A place in the field of a plot: a share of its width, in the middle of its height."""
    field = plot._marks.geometry()
    return QPoint(field.x() + round(share * (field.width() - 1)), field.center().y())


# Reading off


def test_the_nearest_row_is_found() -> None:
    times = np.array([-0.3, -0.2, -0.1, 0.0])
    assert [nearest(times, at) for at in (-9.0, -0.26, -0.24, -0.1, 9.0)] == [0, 0, 1, 2, 3]
    assert nearest(np.zeros(0), 0.0) is None


def test_a_difference_of_two_readings_is_that_of_what_is_shown(theme: Theme) -> None:
    table = Measuring(theme)
    table.show_readings(0.0, 1.0, 0, [("force", Units().unit("force", "N"), Measured(100.0049, 99.9951))])
    assert [cell(table, 0, name) for name in ("A", "B", "B − A")] == ["100", "99.995", "−0.005"]
    destroy(table)


def test_what_is_missing_is_missing_and_the_rest_is_measured() -> None:
    values = np.array([1.0, math.nan, 3.0, 5.0])
    found = measure(values, 0, 2, 0, 4)
    assert (found.a, found.b) == (1.0, 3.0)
    assert (found.low, found.high, found.mean) == (1.0, 5.0, 3.0)
    assert found.sd == pytest.approx(math.sqrt(8 / 3))
    assert measure(values, 0, 1, 0, 4).b is None
    assert measure(values, 1, 1, 1, 2) == Measured(None, None)
    same = measure(np.full(1000, 0.1), 0, 1, 0, 1000)
    assert (same.mean, same.sd) == (0.1, 0.0)


# Zoom


def test_the_wheel_zooms_every_plot_while_data_go_on(signals: Signals, bench: Bench) -> None:
    first, second = (plot.plot for plot in signals.plots)
    wheel(first, QPointF(place(first, 0.5)), 10)
    left, right = first.window_s
    assert -10.0 < left < -5.0 < right < 0.0
    assert second.window_s == pytest.approx((left, right))
    picture = first._lines.strip.pixels.copy()
    add(bench, 1000, 100)
    signals.refresh()
    assert first.window_s == (left, right), "new rows moved what somebody has zoomed to"
    assert not np.array_equal(picture, first._lines.strip.pixels), "new rows are not drawn"


def test_the_newest_row_stays_at_now_in_a_plot_of_another_size_until_it_is_drawn_anew(theme: Theme) -> None:
    """What was drawn before a page was laid out stood at its old end of time."""
    plot = Plot(theme, 10.0)
    plot.set_curves([Curve(KNEE, "accent")])
    plot.grab()  # which lays it out
    plot.draw(object(), np.arange(9.0, 11.0), [np.ones(2)], live=True)
    for wide in (138, 400, 700):
        plot._lines.resize(wide, 60)
        drawn = plot._lines.grab().toImage()
        behind = theme.colour("card").rgb()
        inked = [x for x in range(wide) if any(drawn.pixel(x, y) != behind for y in range(60))]
        assert inked[-1] >= 0.98 * wide - 1, wide
        assert inked[0] == pytest.approx(0.9 * wide, abs=0.02 * wide), wide
    destroy(plot)


def test_the_zoom_shows_its_part_of_the_past(signals: Signals, bench: Bench) -> None:
    plot = signals.plots[0].plot
    plot.show_window(-6.0, -4.0)
    signals.refresh()
    strip = plot._lines.strip
    newest_s = bench.station.rings.times(1.0)[-1]
    assert strip._newest_s == pytest.approx(newest_s - 4.0)
    assert strip._key[1].seconds == pytest.approx(2.0)  # type: ignore[attr-defined]
    low, high = plot.getViewBox().viewRange()[1]
    assert low < math.degrees(4.0)
    assert high > math.degrees(5.98)


def test_a_box_chooses_what_is_seen_fit_takes_it_back_and_the_wheel_over_an_axis_zooms_only_that(
    signals: Signals,
) -> None:
    plot = signals.plots[0].plot
    signals.box.click()
    viewport = plot.viewport()
    begin, end = place(plot, 0.4) - QPoint(0, 20), place(plot, 0.6) + QPoint(0, 20)
    QTest.mousePress(viewport, Qt.MouseButton.LeftButton, pos=begin)
    for share in (0.45, 0.5, 0.55):
        QTest.mouseMove(viewport, place(plot, share))
        QApplication.processEvents()
    QTest.mouseMove(viewport, end)
    signals.refresh()
    assert plot._marks.isVisible(), "nobody sees the box"
    QTest.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=end)
    assert plot.window_s == pytest.approx((-6.0, -4.0), abs=0.1)
    signals.fit.click()
    assert plot.window_s == (-10.0, 0.0)
    assert plot.follows
    plot = signals.plots[0].plot
    axis = plot.mapFromScene(plot.getPlotItem().getAxis("left").sceneBoundingRect()).boundingRect().center()
    wheel(plot, QPointF(axis), 5)
    assert plot.window_s == (-10.0, 0.0)
    assert not plot.follows


def test_an_export_has_what_is_in_sight(signals: Signals, tmp_path: Path) -> None:
    signals.plots[0].plot.show_window(-6.0, -4.0)
    signals.save_csv(tmp_path / "out.csv")
    rows = list(csv.reader((tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()))[1:]
    assert (float(rows[0][0]), float(rows[-1][0])) == (-6.0, -4.0)
    assert (float(rows[0][1]), float(rows[-1][1])) == (3.99, 5.99)


# Cursors


def test_two_cursors_tell_values_their_difference_and_statistics_of_what_is_in_sight(
    signals: Signals,
) -> None:
    signals.cursors.click()
    signals.two.move(0, -6.004)
    signals.two.move(1, -4.0)
    assert title(signals) == "A −6.000 s ▸ B −4.000 s Δt +2.000 s · 1/Δt 0.5 Hz"
    assert cell(signals.measuring, 0, "Channel") == KNEE
    assert [cell(signals.measuring, 0, name) for name in ("A", "B", "B − A", "Unit")] == [
        f"{math.degrees(3.99):.5g}",
        f"{math.degrees(5.99):.5g}",
        f"{math.degrees(2.0):.5g}",
        "°",
    ]
    assert cell(signals.measuring, 1, "B − A") == "0"
    signals.plots[0].plot.show_window(-2.0, -1.0)
    title(signals)
    low, high, mean = (cell(signals.measuring, 0, name) for name in ("Min", "Max", "Mean"))
    assert (low, high, mean) == tuple(f"{math.degrees(angle):.5g}" for angle in (7.99, 8.99, 8.49))
    assert cell(signals.measuring, 1, "SD") == "0"


def test_names_are_whole_in_a_small_window(signals: Signals) -> None:
    signals.resize(480, 500)
    signals.cursors.click()
    title(signals)
    QApplication.processEvents()
    table, name = signals.measuring.table, cell(signals.measuring, 0, "Channel")
    assert table.columnWidth(0) >= table.fontMetrics().horizontalAdvance(name)


@pytest.mark.parametrize("width", [480, 660, 1400])
def test_every_figure_is_there_at_every_width_and_none_is_cut(signals: Signals, width: int) -> None:
    signals.resize(width, 700)
    signals.cursors.click()
    title(signals)
    QApplication.processEvents()
    title(signals)
    view = signals.measuring
    tables = [one for one in (view.table, view.below) if not one.isHidden()]
    shown = {
        TITLES[column]
        for table in tables
        for column in range(len(TITLES))
        if not table.isColumnHidden(column)
    }
    assert shown == {*TITLES}
    for table in tables:
        for column in range(1, len(TITLES)):
            if not table.isColumnHidden(column):
                assert table.columnWidth(column) >= table.sizeHintForColumn(column)
    assert view.below.isHidden() is (width == 1400)


def test_cursors_begin_where_there_are_rows(signals: Signals, bench: Bench) -> None:
    """A was in the part of ten seconds that a young link has not filled yet, and read nothing."""
    other = bench.add("exo-02", 7421)
    now_ns = time.monotonic_ns()
    stamps_ns = [now_ns - 10_000_000 * row for row in range(200, -1, -1)]
    other.take([described("exo-02"), telemetry(stamps_ns, {"left_knee.position": [0.1] * 201}, now_ns)])
    bench.desk.select(other)
    signals.refresh()
    signals.cursors.click()
    assert signals.two.at == pytest.approx([-4 / 3, -2 / 3], abs=0.02)
    signals.refresh()
    assert "–" not in {str(signals.measuring.table.item(0, column).text()) for column in (1, 2, 3)}  # type: ignore[union-attr]


def test_a_cursor_is_dragged_or_moved_by_keys_and_the_plot_stays(signals: Signals) -> None:
    signals.cursors.click()
    signals.two.move(0, -5.0)
    plot = signals.plots[0].plot
    viewport = plot.viewport()
    QTest.mousePress(viewport, Qt.MouseButton.LeftButton, pos=place(plot, 0.5))
    QTest.mouseMove(viewport, place(plot, 0.3))
    QTest.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=place(plot, 0.3))
    assert signals.two.at[0] == pytest.approx(-7.0, abs=0.1)
    assert plot.window_s == (-10.0, 0.0)
    assert plot.follows
    assert signals.measuring.isVisible()
    signals.two.move(1, -2.0)
    signals.two.move(0, -5.0)
    for key, modifier in (
        (Qt.Key.Key_Right, Qt.KeyboardModifier.NoModifier),
        (Qt.Key.Key_B, Qt.KeyboardModifier.NoModifier),
        (Qt.Key.Key_Left, Qt.KeyboardModifier.ShiftModifier),
        (Qt.Key.Key_Left, Qt.KeyboardModifier.NoModifier),
    ):
        QTest.keyClick(signals.measuring, key, modifier)
    assert title(signals).startswith("A −4.990 s ▸ B −2.110 s Δt +2.880 s")


def test_a_paused_view_is_measured_as_it_stands(signals: Signals, bench: Bench) -> None:
    signals.cursors.click()
    signals.two.move(0, -1.0)
    signals.pause.click()
    title(signals)
    before = cell(signals.measuring, 0, "A")
    add(bench, 1000, 200)
    title(signals)
    assert cell(signals.measuring, 0, "A") == before
    signals.pause.click()
    title(signals)
    assert cell(signals.measuring, 0, "A") == f"{math.degrees(10.99):.5g}"


def test_without_data_nothing_is_measured(theme: Theme, bench: Bench) -> None:
    made = Signals(bench.desk, theme)
    made.show()
    made.refresh()
    made.cursors.click()
    QTest.keyClick(made.measuring, Qt.Key.Key_Left)
    made.refresh()
    table = made.measuring.table
    told = {str(table.item(row, column).text()) for row in range(table.rowCount()) for column in range(1, 8)}  # type: ignore[union-attr]
    assert told <= {"–"}
    destroy(made)


@pytest.mark.parametrize("way", ["another robot", "another start"])
def test_no_numbers_of_another_robot_or_of_before_its_start_are_left_at_the_cursors(
    signals: Signals, bench: Bench, way: str
) -> None:
    signals.cursors.click()
    signals.refresh()
    table = signals.measuring.table

    def told() -> set[str]:
        texts = (table.item(row, column) for row in range(table.rowCount()) for column in range(1, 8))
        return {item.text() for item in texts if item is not None}

    assert told() - {"–"}
    if way == "another robot":
        other = bench.add("exo-02", 7421)
        other.take([described("exo-02")])
        bench.desk.select(other)
    else:
        anew = described()
        bench.station.take([dataclasses.replace(anew, description=replace(anew.description, boot_id="2"))])
    signals.refresh()
    signals.read_now()
    signals.refresh()
    assert told() <= {"–"}


@pytest.mark.parametrize(
    ("a", "b", "shown", "difference"),
    [
        (123456.0, 123464.0, ("123456", "123464"), "8"),
        (12345.61, 12345.84, ("12346", "12346"), "0.23"),
        (1.5, 1.5, ("1.5", "1.5"), "0"),
        (99999.4, 99999.6, ("99999", "100000"), "1"),
        (25.1234, 23.8777, ("25.123", "23.878"), "−1.245"),
    ],
)
def test_what_differs_is_never_told_to_be_alike(
    theme: Theme, a: float, b: float, shown: tuple[str, str], difference: str
) -> None:
    made = Measuring(theme)
    made.show_readings(-2.0, -1.0, 0, [("force", Unit("N", "N"), Measured(a, b))])
    texts = [str(made.table.item(0, column).text()) for column in (1, 2, 3)]  # type: ignore[union-attr]
    assert texts == [*shown, difference]


def test_where_there_is_no_sample_nothing_is_told() -> None:
    """Before the first, after the last, and while nothing came."""
    times = np.concatenate([np.arange(-5.0, -3.0, 0.01), np.arange(-1.0, 0.001, 0.01)])
    told = {at_s: row_at(times, at_s) for at_s in (-6.0, -5.0, -4.004, -2.0, -1.2, -0.5, 0.0, 1.0)}
    assert {at_s for at_s, row in told.items() if row is None} == {-6.0, -2.0, -1.2, 1.0}
    assert times[told[-4.004] or 0] == pytest.approx(-4.0)
    assert row_at(np.zeros(0), 0.0) is None


def test_a_cursor_in_a_gap_reads_nothing(signals: Signals, bench: Bench) -> None:
    add(bench, 1400, 100)  # four seconds nobody has sent
    signals.cursors.click()
    signals.two.at = [-3.0, -0.5]
    title(signals)
    view = signals.measuring
    assert [cell(view, 0, column) for column in ("A", "B − A")] == ["–", "–"]
    assert cell(view, 0, "B") == "830.22"  # °
    assert "A -3.000 s" in title(signals).replace("−", "-")
