"""Signals: what is ticked is drawn; a paused view stands still while data go on; exports are exact."""

import csv
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtWidgets import QPushButton

from gateway.units import Units
from server_gui.core.desk.flags import Flag, FlagKind
from server_gui.core.workspace.trigger import Condition
from server_gui.core.workspace.workspace import MOST_CURVES
from server_gui.views.theme import Theme
from server_gui.views.widgets.scroll_area import ScrollArea
from server_gui.views.widgets.time_axis import NOW, PAUSED
from server_gui.views.workspace.page import Signals
from tests.gui.fakes import Bench, destroy
from tests.gui.rules import settle
from tests.support.desk import JOINTS, described, looked, telemetry, walking


@pytest.fixture
def signals(theme: Theme, bench: Bench) -> Iterator[Signals]:
    bench.station.take([walking(300)])
    made = Signals(bench.desk, theme)
    made.resize(900, 600)
    made.show()
    made.refresh()
    yield made
    destroy(made)


def test_channels_of_one_unit_share_a_plot(signals: Signals) -> None:
    signals.choose(["left_hip.position", "right_hip.position", "left_hip.torque"])
    assert [plot.channels for plot in signals.plots] == [
        ("left_hip.position", "right_hip.position"),
        ("left_hip.torque",),
    ]


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_a_narrow_page_is_never_scrolled_sideways(theme: Theme, bench: Bench, scale: float) -> None:
    theme.set(scale=scale)
    bench.station.take([walking(300)])
    page = Signals(bench.desk, theme)
    page.cursors.setChecked(True)
    scrolled = ScrollArea(page)
    scrolled.show()
    for width in (1000, 600, 470, 320):
        scrolled.resize(width, 500)
        settle()
        page.refresh()
        settle()
        assert page.width() <= scrolled.viewport().width()
        buttons = page.tools.findChildren(QPushButton)
        assert max(button.geometry().right() for button in buttons) < page.tools.width()
    destroy(scrolled)


def test_nothing_ticked_says_what_to_do(signals: Signals) -> None:
    signals.choose([])
    assert signals.empty.isVisible()
    assert "Tick channels" in signals.empty.text()


def test_a_filter_leaves_only_components_that_have_a_channel(signals: Signals) -> None:
    def seen() -> list[str]:
        rows = [signals.channels.topLevelItem(row) for row in range(signals.channels.topLevelItemCount())]
        return [row.text(0) for row in rows if row is not None and not row.isHidden()]

    every = seen()
    signals.channels.show_only("left_knee position")
    assert seen() == ["left knee"]
    signals.channels.show_only("")
    assert seen() == every


def test_too_many_curves_are_named_not_dropped_silently(signals: Signals) -> None:
    names = [
        f"{joint}.{quantity}"
        for joint in JOINTS
        for quantity in ("position", "velocity", "torque", "current", "temperature")
    ]
    signals.choose(names)
    signals.read_now()
    signals.refresh()
    assert sum(len(plot.channels) for plot in signals.plots) == MOST_CURVES
    assert f"{len(names) - MOST_CURVES} more are not drawn" in signals.said.text()


def test_where_frames_are_slow_each_says_the_values_that_it_draws(
    signals: Signals, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a busy computer every fifth frame is a second later."""
    signals.choose(["left_hip.torque"])
    now_ns, newest = 1_000_000_000, bench.station.rings.newest_ns
    assert newest is not None
    monkeypatch.setattr("server_gui.views.refresh_rate.now_ns", lambda: now_ns)
    for frame in range(1, 7):
        now_ns += 300_000_000
        bench.station.take([telemetry([newest + frame * 10_000_000], {"left_hip.torque": [10.0 * frame]})])
        signals.refresh()
        assert f"{10 * frame}.0" in signals.plots[0]._legend.accessibleDescription()


def test_a_paused_view_stands_still_while_data_go_on(signals: Signals, bench: Bench, tmp_path: Path) -> None:
    signals.choose(["left_hip.position"])
    signals.pause.setChecked(True)
    signals.save_csv(tmp_path / "before.csv")
    newest = bench.station.rings.newest_ns
    assert newest is not None
    bench.station.take([telemetry([newest + 10_000_000], {"left_hip.position": [9.0]})])
    signals.refresh()
    signals.save_csv(tmp_path / "after.csv")
    assert (tmp_path / "before.csv").read_bytes() == (tmp_path / "after.csv").read_bytes()
    assert bench.station.rings.values("left_hip.position", 1).tolist() == [9.0]
    axis = signals.plots[0].plot.getPlotItem().getAxis("bottom")
    assert axis.tickStrings([0.0], 1.0, 1.0) == [PAUSED], "what stands still was called now"
    signals.pause.setChecked(False)
    signals.refresh()
    assert axis.tickStrings([0.0], 1.0, 1.0) == [NOW]
    signals.save_csv(tmp_path / "live.csv")
    assert (tmp_path / "live.csv").read_text().rstrip().endswith(",9.0")


def test_an_export_has_every_digit_in_si_units(signals: Signals, bench: Bench, tmp_path: Path) -> None:
    signals.choose(["left_hip.position"])
    signals.save_csv(tmp_path / "out.csv")
    rows = list(csv.reader((tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()))
    assert rows[0] == ["time s", "left_hip.position rad"]
    assert float(rows[-1][1]) == bench.station.robot.values["left_hip.position"]
    assert rows[-1][0] == "0.000000"


def test_other_units_make_the_plots_anew(signals: Signals, bench: Bench) -> None:
    signals.choose(["left_hip.position"])
    assert signals.plots[0].unit.symbol == "°"
    bench.desk.shown.change(Units(by_si={"rad": "rad"}))
    signals.refresh()
    assert signals.plots[0].unit.symbol == "rad"


def test_the_range_follows_the_data_until_somebody_zooms(signals: Signals, bench: Bench) -> None:
    signals.choose(["left_hip.position"])
    signals.refresh()
    plot = signals.plots[0].plot
    plot.getViewBox().sigRangeChangedManually.emit([False, True])
    plot.setYRange(-1.0, 1.0, padding=0.0)
    signals.refresh()
    assert plot.getViewBox().viewRange()[1] == [-1.0, 1.0]
    signals.fit.click()
    signals.refresh()
    low, high = plot.getViewBox().viewRange()[1]
    assert low < -20.0
    assert high > 20.0


def test_the_view_begins_with_what_was_asked_for(theme: Theme, bench: Bench) -> None:
    made = Signals(bench.desk, theme)
    made.channels.usual = ("left_*.torque", "right_hip.velocity")
    made.refresh()  # nobody knows the robot's channels yet
    bench.station.take([walking(300)])
    made.refresh()
    assert set(made.chosen) == {f"left_{name}.torque" for name in ("hip", "knee", "ankle")} | {
        "right_hip.velocity"
    }
    destroy(made)


def test_one_jumps_from_event_to_event_and_every_plot_shows_them(signals: Signals, bench: Bench) -> None:
    station = bench.station
    newest_ns = station.rings.newest_ns
    assert newest_ns is not None
    first, last = newest_ns - 2_000_000_000, newest_ns - 1_000_000_000
    station.flags.add(Flag(first, "left knee: fault", FlagKind.FAULT), Flag(last, "stairs", FlagKind.MARK))
    signals._turn(-1)
    assert signals.pause.isChecked(), "the instant runs away"
    left, right = signals.plots[0].plot.window_s
    assert left <= -1.0 <= right
    signals._turn(-1)
    signals.refresh()
    assert "fault: left knee: fault" in signals.said.text()
    assert [flag.at for flag in signals.plots[0].plot._flags] == pytest.approx([-2.0, -1.0])
    signals._turn(1)
    signals.refresh()
    assert "mark: stairs" in signals.said.text()
    assert not signals.show_at(newest_ns - 3_600_000_000_000), "what is gone by now was shown"


def test_an_instant_that_is_gone_is_not_shown_as_another_one(signals: Signals, bench: Bench) -> None:
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    signals.show_around(("left_knee.position",), newest_ns - 3_600_000_000_000)
    signals.refresh()
    assert not signals.pause.isChecked()
    assert "Gone from here" in signals.said.text()
    signals.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    signals.refresh()
    assert "gone" not in signals.said.text()


def rows_until(bench: Bench, stamp_ns: int) -> None:
    """More of the walk, up to this instant."""
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    stamps_ns = [*range(newest_ns + 10_000_000, stamp_ns + 1, 10_000_000)]
    bench.station.take([telemetry(stamps_ns, {"left_knee.position": [0.2] * len(stamps_ns)}, stamp_ns)])


def test_the_seconds_after_an_instant_are_shown_as_they_come(
    signals: Signals, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who asked at once saw half of what was promised, for good."""
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    signals.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    signals.refresh()
    assert "Paused, up to 5 s more come" in signals.said.text()
    with monkeypatch.context() as patched:
        patched.setattr(type(bench.station), "is_live", property(lambda _: False))
        signals.read_now()
        signals.refresh()
        assert signals.said.text().startswith("Paused · ")
        assert "come" not in signals.said.text()
        assert " old" in signals.said.text()
    rows_until(bench, newest_ns + 2_000_000_000)
    signals.refresh()
    _left, right = signals.plots[0].plot.window_s
    assert right == pytest.approx(0.0, abs=0.01)
    assert signals.scene.newest_ns == pytest.approx(newest_ns + 2_000_000_000, abs=10_000_000)
    rows_until(bench, newest_ns + 9_000_000_000)
    signals.refresh()
    assert signals.scene.newest_ns == pytest.approx(newest_ns + 4_000_000_000, abs=20_000_000)
    signals.read_now()
    signals.refresh()
    assert "Paused" in signals.said.text()
    _left, right = signals.plots[0].plot.window_s
    assert right == pytest.approx(0.0, abs=0.02)
    rows_until(bench, newest_ns + 12_000_000_000)
    signals.refresh()
    assert signals.scene.newest_ns == pytest.approx(newest_ns + 4_000_000_000, abs=20_000_000)


@pytest.mark.parametrize("elsewhere", ["zoom", "pause"])
def test_who_looks_elsewhere_is_not_taken_back_to_an_instant(
    signals: Signals, bench: Bench, elsewhere: str
) -> None:
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    signals.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    signals.refresh()
    if elsewhere == "zoom":
        signals._zoomed(-2.0, -1.0)
    else:
        signals.pause.setChecked(False)
    rows_until(bench, newest_ns + 2_000_000_000)
    signals.refresh()
    if elsewhere == "zoom":
        assert signals.plots[0].plot.window_s == pytest.approx((-2.0, -1.0))
        assert signals.scene.newest_ns == newest_ns
    else:
        assert signals.scene.frozen is None


def test_what_was_shown_of_before_an_instant_stays_whatever_comes_later(
    signals: Signals, bench: Bench
) -> None:
    """A link that was gone for long took the fault with it that somebody looked at."""
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    signals.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    signals.refresh()
    rows = len(signals.scene.times(100.0))
    late_ns = newest_ns + 120_000_000_000
    bench.station.take([telemetry([late_ns], {"left_knee.position": [0.2]}, late_ns)])
    signals.refresh()
    assert len(signals.scene.times(100.0)) == rows
    signals.read_now()
    signals.refresh()
    assert "Paused, data continue" in signals.said.text()


def test_an_instant_at_the_newest_row_keeps_the_seconds_before_it(signals: Signals, bench: Bench) -> None:
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    signals.show_around(("left_knee.position",), newest_ns)
    rows_until(bench, newest_ns + 9_000_000_000)
    signals.refresh()
    assert signals.plots[0].plot.window_s == pytest.approx((-10.0, 0.0), abs=0.03)


def test_cursors_stay_in_the_curves_while_more_of_them_comes(signals: Signals, bench: Bench) -> None:
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    signals.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    signals.cursors.setChecked(True)
    at_ns = [newest_ns + at_s * 1e9 for at_s in signals.two.at]
    rows_until(bench, newest_ns + 2_000_000_000)
    signals.refresh()
    now_ns = signals.scene.newest_ns
    assert now_ns is not None
    assert [now_ns + at_s * 1e9 for at_s in signals.two.at] == pytest.approx(at_ns, abs=1e6)


def test_another_robot_is_shown_as_it_is_now_without_what_happened_to_the_first(
    signals: Signals, bench: Bench
) -> None:
    """It showed the other's fault, and said that it was paused while its curves ran on."""
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    bench.station.flags.add(Flag(newest_ns - 10, "left knee: fault", FlagKind.FAULT))
    signals.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    signals.refresh()
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02"), walking(300), looked()])
    bench.desk.select(other)
    signals.read_now()
    signals.refresh()
    assert not signals.pause.isChecked()
    assert "Paused" not in signals.said.text()
    assert not any(plot.plot._flags for plot in signals.plots)
    assert signals._read_s is None


def test_a_view_that_was_paused_by_hand_stays_so_whatever_its_trigger_does(
    signals: Signals, bench: Bench
) -> None:
    signals.choose(["left_knee.position"])
    signals._arm(Condition(of="left_knee.position", level=0.1))
    signals.pause.setChecked(True)
    kept = signals.scene.frozen
    bench.station.take([walking(300)])
    signals.refresh()
    assert signals.scene.frozen is kept
    signals._show_trigger(on=False)
    assert signals.scene.frozen is kept
    signals.read_now()
    signals.refresh()
    assert "Paused" in signals.said.text()


def test_where_the_page_is_small_an_instant_is_shown_above_what_arranges_it(
    theme: Theme, bench: Bench
) -> None:
    """With large text nothing of a fault's curves was in sight, below the list of channels."""
    theme.set(scale=1.5)
    bench.station.take([walking(300)])
    page = Signals(bench.desk, theme)
    area = ScrollArea(page)
    area.resize(480, 500)
    area.show()
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    page.refresh()
    settle()
    page.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    settle()
    assert page.plots[0].visibleRegion().boundingRect().height() == page.plots[0].height()
    destroy(area)


def test_a_channel_is_listed_in_the_unit_that_it_is_drawn_in(signals: Signals) -> None:
    titles = {str(item.text(0)) for item in signals.channels.items}
    assert {"position  °", "torque  N·m", "cell 0  kPa"} <= titles
    assert {plot.unit.symbol for plot in signals.plots} <= {"°", "N", "N·m", "kPa"}


def test_what_stands_still_stays_also_once_its_rows_are_no_longer_kept(
    signals: Signals, bench: Bench
) -> None:
    """Eleven minutes later four plots had no data."""
    newest_ns = bench.station.rings.newest_ns
    assert newest_ns is not None
    signals.show_around(("left_knee.position",), newest_ns - 1_000_000_000)
    rows_until(bench, newest_ns + 6_000_000_000)
    signals.refresh()
    rows = len(signals.scene.times(100.0))
    rows_until(bench, newest_ns + 660_000_000_000)
    signals._build()
    signals.refresh()
    assert len(signals.scene.times(100.0)) == rows
