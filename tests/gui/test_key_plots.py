"""The overview's plots: one time, limits, flags, a pointer over all; the wheel zooms time, not for good."""

import itertools
import time
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, Qt
from PySide6.QtGui import QFontMetrics, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from gateway.wire.robot import GuardInfo, GuardRuleInfo
from server_gui.core.desk.flags import Flag, FlagKind
from server_gui.core.follow.events import Described
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.overview.key_plot import SECONDS, KeyPlot
from server_gui.views.overview.page import Overview
from server_gui.views.theme import Theme
from server_gui.views.widgets.cursors import told
from server_gui.views.widgets.time_axis import LAST, PAUSED
from server_gui.views.widgets.value_axis import ValueAxis
from tests.gui.fakes import Bench, destroy
from tests.gui.running import wait
from tests.support.desk import described, looked, telemetry, walking

HOUR_S = 3600.0


class Painted(QObject):
    """Counts how often a widget is painted."""

    def __init__(self) -> None:
        super().__init__()
        self.count = 0

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        self.count += event.type() is QEvent.Type.Paint
        return False


@pytest.fixture
def overview(theme: Theme, bench: Bench) -> Iterator[Overview]:
    bench.station.take([walking(1200, -HOUR_S), looked()])
    made = Overview(bench.desk, theme)
    made.resize(1100, 800)
    made.show()
    draw(made)
    yield made
    destroy(made)


def draw(overview: Overview) -> None:
    QApplication.processEvents()
    overview.read_now()
    overview.refresh()
    QApplication.processEvents()


def wheel(plot: KeyPlot, steps: int) -> None:
    """Turn the wheel over the middle of a plot's field."""
    viewport = plot.plot.viewport()
    at = QPointF(plot.plot._lines.geometry().center())
    turned = QWheelEvent(
        at,
        QPointF(viewport.mapToGlobal(at.toPoint())),
        QPoint(),
        QPoint(0, 120 * steps),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(viewport, turned)


def ranges(overview: Overview) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    views = [plot.plot.getViewBox().viewRange() for plot in overview._plots]
    return [((round(x[0], 6), round(x[1], 6)), (y[0], y[1])) for x, y in views]


def test_the_wheel_zooms_the_time_of_all_plots_and_a_double_click_shows_all_of_it_again(
    overview: Overview, bench: Bench
) -> None:
    before = ranges(overview)
    wheel(overview._plots[0], 2)
    draw(overview)
    after = ranges(overview)
    assert after[0][0] != before[0][0]
    assert len({time_range for time_range, _ in after}) == 1, "all have the same time"
    assert [values for _, values in after] == [values for _, values in before]
    assert all(plot.plot.follows for plot in overview._plots), "the range goes on following the data"
    plot = overview._plots[1]
    opened: list[object] = []
    overview.opened.connect(opened.append)
    wheel(plot, 3)
    QTest.mouseDClick(
        plot.plot.viewport(), Qt.MouseButton.LeftButton, pos=plot.plot._lines.geometry().center()
    )
    assert {time_range for time_range, _ in ranges(overview)} == {(-SECONDS, 0.0)}
    assert not plot.plot._click.isActive(), "it is no click"
    wheel(plot, 3)
    bench.desk.select(bench.add("exo-02", 7421))
    draw(overview)
    assert {time_range for time_range, _ in ranges(overview)} == {(-SECONDS, 0.0)}
    assert opened == []


def test_a_click_opens_the_channels_in_signals(window: MainWindow, bench: Bench) -> None:
    bench.station.take([walking(300, -HOUR_S)])
    bench.draw(window)
    plot = window.tabs.overview._plots[0]
    QTest.mouseClick(
        plot.plot.viewport(), Qt.MouseButton.LeftButton, pos=plot.plot._lines.geometry().center()
    )
    assert window.tabs.currentIndex() == 0, "it may become a double click"
    wait(lambda: window.tabs.currentIndex() == 1, "opened")
    assert window.tabs.signals.chosen == ["left_knee.position", "right_knee.position"]


def test_each_curve_is_named_with_its_value_in_the_legend_and_times_have_their_unit(
    overview: Overview,
) -> None:
    angle, torque, tilt = (plot.legend for plot in overview._plots)
    assert angle.accessibleDescription().startswith("left ")
    assert "right" in angle.accessibleDescription()
    assert torque.accessibleDescription().endswith("limit ±80")
    assert "forward 2.9" in tilt.accessibleDescription()
    assert "sideways –" in tilt.accessibleDescription()
    axis = overview._plots[0].plot.getPlotItem().getAxis("bottom")
    assert axis.tickStrings([-10.0, -2.5, 0.0], 1.0, 2.0) == ["−10 s", "−2.5 s", "now"]


def test_a_limit_is_a_line_where_it_is_in_sight_and_so_is_where_the_guard_trips(
    overview: Overview, bench: Bench
) -> None:
    torque = overview._plots[1]
    assert len(torque.plot._marks._shown.limits) == 0
    newest_ns = bench.station.rings.newest_ns or 0
    stamps_ns = [newest_ns + (row + 1) * 10_000_000 for row in range(50)]
    received_ns = time.monotonic_ns() + round(HOUR_S * 1e9)
    columns: dict[str, list[float | None]] = {"left_knee.torque": [90.0] * 50}
    bench.station.take([telemetry(stamps_ns, columns, received_ns)])
    draw(overview)
    draw(overview)
    shares: list[float] = list(torque.plot._marks._shown.limits)
    assert len(shares) == 1
    assert 0.0 < shares[0] < 0.5
    about = ("knee_range", "joint_limit", "outside", ["left_knee"], ["quick_stop"], "alarm", "watching")
    knee = GuardRuleInfo(*about, 0, None, 0, [], ["position"], -0.1, 0.2)
    hip = msgspec.structs.replace(knee, on=["right_hip"], low=-9.0)
    guard = GuardInfo(configured=True, rules=[knee, hip])
    bench.station.take([Described(msgspec.structs.replace(described().description, guard=guard))])
    draw(overview)
    draw(overview)
    angle = overview._plots[0]
    assert angle.legend.accessibleDescription().endswith("−5.73 and 11.46")
    assert len(angle.plot._marks._shown.limits) == 2


def test_a_limit_beyond_the_range_is_an_arrow_at_its_edge_and_is_said_to_be_there(
    overview: Overview, bench: Bench
) -> None:
    torque = overview._plots[1]
    assert torque.plot._marks._shown.limits == ()
    assert torque.plot._arrows._beyond == (0.0, 1.0), "above and below"
    assert [glyph for _, glyph, text in torque.legend._parts if "80" in text] == ["↕"]
    newest_ns = bench.station.rings.newest_ns or 0
    stamps_ns = [newest_ns + (row + 1) * 10_000_000 for row in range(50)]
    columns: dict[str, list[float | None]] = {"left_knee.torque": [90.0] * 50}
    bench.station.take([telemetry(stamps_ns, columns, time.monotonic_ns() + round(HOUR_S * 1e9))])
    draw(overview)
    draw(overview)
    assert list(torque.plot._arrows._beyond) == [1.0]
    assert [glyph for _, glyph, text in torque.legend._parts if "80" in text] == ["┅"]


def test_what_happened_is_flagged_in_every_plot_at_its_instant(overview: Overview, bench: Bench) -> None:
    newest_ns = bench.station.rings.newest_ns or 0
    bench.station.flags.add(Flag(newest_ns - 5 * 10**9, "stop F12 by jkim", FlagKind.STOP))
    bench.station.flags.add(Flag(newest_ns - 60 * 10**9, "long ago", FlagKind.WRITE))
    draw(overview)
    draw(overview)
    for plot in overview._plots:
        ((share, kind),) = plot.plot._marks._shown.flags
        assert share == pytest.approx(0.5, abs=0.01)
        assert kind is FlagKind.STOP
    overview._hover(-5.0)
    draw(overview)
    assert overview._plots[2].note == "stop F12 by jkim · −5 s"


def test_the_end_of_the_time_axis_is_painted_anew_with_the_curves(overview: Overview) -> None:
    """It said now below grey curves, and last below live ones, until the scene was drawn a frame later."""
    plot, painted = overview._plots[0].plot, Painted()
    plot.viewport().installEventFilter(painted)
    plot.draw(object(), np.array([-1.0, 0.0]), [np.zeros(2)] * len(plot._curves), live=False)
    QApplication.sendPostedEvents(None, QEvent.Type.UpdateRequest)
    assert painted.count, "without the events of the scene, which come later"
    assert plot.getPlotItem().getAxis("bottom").tickStrings([0.0], 1.0, 1.0) == [LAST]


def test_the_pointer_reads_every_plot_at_one_time(overview: Overview, bench: Bench) -> None:
    plot = overview._plots[0]
    QTest.mouseMove(plot.plot.viewport(), plot.plot._lines.geometry().center())
    QApplication.processEvents()
    overview._hover(-4.0)
    draw(overview)
    assert all(one.plot._marks._shown.hover is not None for one in overview._plots)
    times = bench.station.rings.times(SECONDS)
    row = int(np.argmin(np.abs(times - (times[-1] - 4.0))))
    value = float(np.degrees(bench.station.rings.values("left_knee.position", len(times))[row]))
    shown = f"{value:.1f}".replace("-", "−")
    assert f"left {shown}" in plot.legend.accessibleDescription()
    assert plot.note == "−4 s"
    overview._hover(None)
    draw(overview)
    assert plot.note == ""


def test_a_plot_without_data_says_so_and_has_no_numbers(theme: Theme, bench: Bench) -> None:
    made = Overview(bench.desk, theme)
    made.resize(1100, 800)
    made.show()
    draw(made)
    for plot in made._plots:
        assert plot.plot._marks._shown.words == "no data"
        assert not plot.plot.getPlotItem().getAxis("left").style["showValues"]
    bench.station.take([walking(300, -HOUR_S)])
    draw(made)
    draw(made)
    assert made._plots[0].plot._marks._shown.words == ""
    assert made._plots[0].plot.getPlotItem().getAxis("left").style["showValues"]
    destroy(made)


@pytest.mark.parametrize("width", range(540, 1101, 80))
def test_plots_beside_each_other_say_their_age_alike(
    overview: Overview, bench: Bench, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    """One said its age, the next `STALE` without it, the third both."""
    bench.station.take([walking(300)])
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 0)
    overview.resize(width, 800)
    draw(overview)
    draw(overview)
    notes = [plot.note_label.shown.rpartition(", ")[0::2] for plot in overview._plots]
    assert len({stale for stale, _ in notes}) == 1, notes
    assert all(age.endswith(" old") for _, age in notes), notes
    assert all(plot.note_label.is_whole for plot in overview._plots)


@pytest.mark.parametrize("height", [30.0, 60.0, 200.0])
def test_numbers_beside_a_plot_never_stand_on_each_other(qt: QApplication, height: float) -> None:
    axis = ValueAxis()
    axis.set_label_room(20)
    for low, high in ((-47.0, 33.0), (0.0, 5.0), (-0.012, 0.009), (20.0, 100.0)):
        ((step, _),) = axis.tickSpacing(low, high, height)
        assert step / (high - low) * height >= 0.8 * 19.9
        ((_, values),) = axis.tickValues(low, high, height)
        assert (min(values) - low) / (high - low) * height >= 5.0, "on the words of the axis below"
    assert axis.tickSpacing(1.0, 1.0, height) == []
    assert axis.tickStrings([-2.5, 1e-17, 2.5], 1.0, 2.5) == ["−2.5", "0", "2.5"]


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
def test_the_word_at_the_end_of_the_time_axis_is_whole(
    overview: Overview, theme: Theme, scale: float
) -> None:
    theme.set(scale=scale)
    QApplication.processEvents()
    plot = overview._plots[0].plot
    axis = plot.getPlotItem().getAxis("bottom")
    width = QFontMetrics(theme.text_font(0.85)).horizontalAdvance(PAUSED)
    assert axis.mapRectToScene(axis.rect()).right() + width / 2 <= plot.width()


def test_a_fault_is_not_hidden_by_the_stop_that_it_brings() -> None:
    flags = [(0.50, FlagKind.FAULT), (0.51, FlagKind.STOP), (0.90, FlagKind.STOP), (0.905, FlagKind.WRITE)]
    assert told(flags, 0.05) == [(0.50, FlagKind.FAULT), (0.90, FlagKind.STOP)]


def test_a_low_plot_has_two_numbers_that_do_not_touch(qt: QApplication) -> None:
    axis = ValueAxis()
    axis.set_label_room(14)
    for height in (24.0, 30.0, 34.0, 40.0):
        ((_, values),) = axis.tickValues(-33.0, 31.0, height)
        gaps = [(high - low) / 64.0 * height for low, high in itertools.pairwise(values)]
        assert len(values) > 1, height
        assert min(gaps) >= 14 * 0.8, (height, values)
