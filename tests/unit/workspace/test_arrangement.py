"""Plots and their curves: one unit an axis, nothing dropped silently, and two robots on one time."""

import math

import numpy as np
import pytest

from gateway.units import Units
from gateway.wire.component import ChannelInfo
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.flags import Flag, FlagKind
from server_gui.core.desk.station import Station
from server_gui.core.workspace.alignment import Align, offset_text, shift_ns
from server_gui.core.workspace.curve_binding import CurveBinding, meaning, with_beside
from server_gui.core.workspace.expressions import Block, Floats
from server_gui.core.workspace.series import HELD_S, Beside, Series, joined
from server_gui.core.workspace.workspace import MOST_CURVES, MOST_PLOTS, Refused, Workspace
from tests.support.desk import Bench, described, telemetry

SECOND_NS = 1_000_000_000
START_NS = 1000 * SECOND_NS
KNEE, TORQUE = "left_knee.position", "left_knee.torque"
CHANNELS = {info.name: info for info in described().description.channels}


def meant(text: str) -> CurveBinding:
    return meaning(text, CHANNELS, Units())


def units(workspace: Workspace) -> list[object]:
    return [meant(plot.curves[0]).unit if plot.curves else None for plot in workspace.plots]


def rows(station: Station, first: int, values: list[float | None], start_ns: int = START_NS) -> None:
    """A row each 10 ms, of the knee's angle."""
    stamps_ns = [start_ns + (first + number) * 10_000_000 for number in range(len(values))]
    station.take([telemetry(stamps_ns, {KNEE: values})])


@pytest.fixture
def bench() -> Bench:
    made = Bench(Desk())
    for number, name in enumerate(("exo-01", "exo-02")):
        made.add(name, 7420 + number).take([described(name)])
    return made


# Plots


def test_what_has_one_unit_shares_a_plot_and_a_name_of_its_own_keeps_it() -> None:
    workspace = Workspace()
    for text in (KNEE, TORQUE, "error = left_knee.position - left_hip.position", "right_knee.torque"):
        workspace.put(meant(text), [meant(plot.curves[0]).unit for plot in workspace.plots])
    assert [plot.curves for plot in workspace.plots] == [
        [KNEE, "error = left_knee.position - left_hip.position"],
        [TORQUE, "right_knee.torque"],
    ]


def test_another_unit_is_refused_and_says_why() -> None:
    workspace = Workspace()
    workspace.arrange([meant(KNEE)])
    before = workspace.revision
    with pytest.raises(Refused, match=r"left_knee.torque is in N·m, plot 1 in °.*New plot"):
        workspace.add(meant(TORQUE), 0, meant(KNEE).unit)
    with pytest.raises(Refused, match=r"this robot has no left_toe\.position"):
        workspace.new_plot(meant("left_toe.position"))
    with pytest.raises(Refused, match="cannot be added"):
        workspace.new_plot(meant("left_knee.position + left_knee.torque"))
    assert (workspace.curves, workspace.revision) == ([KNEE], before)


def test_there_is_room_for_so_many() -> None:
    workspace = Workspace()
    names = [name for name, info in CHANNELS.items() if info.unit == "Pa"]
    workspace.arrange([meant(name) for name in names])
    assert len(workspace.curves) == MOST_CURVES
    with pytest.raises(Refused, match=f"{MOST_CURVES} curves"):
        workspace.new_plot(meant(KNEE))
    workspace = Workspace()
    for _ in range(MOST_PLOTS):
        workspace.new_plot()
    with pytest.raises(Refused, match=f"{MOST_PLOTS} plots"):
        workspace.new_plot()


def test_a_plot_goes_with_its_last_curve_and_all_else_stays() -> None:
    workspace = Workspace()
    workspace.arrange([meant(KNEE), meant(TORQUE)])
    workspace.new_plot(meant(KNEE), TORQUE, 0)
    workspace.remove(KNEE, 0)
    assert [plot.curves for plot in workspace.plots] == [[KNEE], [TORQUE]]
    workspace.remove(KNEE)
    assert workspace.curves == [TORQUE]
    workspace.remove_plot(0)
    assert workspace.plots == []


def test_a_plain_channel_is_one_whatever_its_name_has_in_it() -> None:
    odd = ChannelInfo("gait-1.step-length", "m", "gait-1", "step-length")
    found = meaning(odd.name, {odd.name: odd}, Units())
    assert (found.problem, found.written) == ("", None)
    assert found.unit is not None
    assert found.unit.symbol == "mm"


# Computed once a row


def test_an_expression_is_computed_for_new_rows_only_and_stands_beside_the_channels(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    station, double = bench.station, meant("left_knee.position * 2")
    series = Series(station)
    counts: list[int] = []
    rows(station, 0, [1.0, None, 3.0])
    assert series.values(double, 10).tolist() == pytest.approx([2.0, math.nan, 6.0], nan_ok=True)
    computed = next(iter(series._computed.values()))
    take = computed._program.take

    def counted(block: Block) -> Floats:
        counts.append(len(block.times))
        return take(block)

    monkeypatch.setattr(computed._program, "take", counted)
    rows(station, 3, [4.0, 5.0])
    assert series.values(double, 2).tolist() == [8.0, 10.0]
    assert series.values(double, 2).tolist() == [8.0, 10.0]
    assert counts == [2]
    station.rings.clear()  # its clock has begun anew
    rows(station, 0, [7.0])
    assert series.values(double, 9).tolist() == [14.0]


def test_what_is_computed_goes_on_round_the_ring(bench: Bench) -> None:
    station, series, double = bench.station, Series(bench.station), meant("left_knee.position * 2")
    station.rings.rows = 50
    station.rings.clear()
    for first in range(0, 400, 7):
        rows(station, first, [float(number) for number in range(first, first + 7)])
        kept = station.rings.values(KNEE, 50)
        assert series.values(double, 50).tolist() == (2 * kept).tolist()
    rows(station, 1000, [float(number) for number in range(200)])  # more at once than it holds
    assert series.values(double, 50).tolist() == [2.0 * number for number in range(150, 200)]


# Two robots


def test_a_value_of_another_clock_is_the_last_and_never_an_old_one() -> None:
    theirs, values = np.array([0.0, 0.1, 0.2, 1.0]), np.array([1.0, 2.0, math.nan, 4.0])
    at = np.array([-0.01, 0.0, 0.05, 0.15, 0.25, 0.9, 1.0, 1.0 + HELD_S, 1.2])
    expected = [math.nan, 1.0, 1.0, 2.0, math.nan, math.nan, 4.0, 4.0, math.nan]
    assert joined(at, theirs, values).tolist() == pytest.approx(expected, nan_ok=True)
    assert np.isnan(joined(at, np.zeros(0), np.zeros(0))).all()


@pytest.mark.parametrize(
    ("by", "expected"), [(Align.START, 500.0), (Align.MARK, 500.2), (Align.FAULT, None), (Align.STOP, None)]
)
def test_two_are_aligned_by_what_both_have(bench: Bench, by: Align, expected: float | None) -> None:
    one, other = bench.desk.stations
    rows(one, 0, [0.0] * 200)
    rows(other, 0, [0.0] * 200, START_NS - 500 * SECOND_NS)
    one.flags.add(Flag(START_NS + SECOND_NS, "step", FlagKind.MARK), Flag(START_NS, "x", FlagKind.FAULT))
    other.flags.add(Flag(START_NS - 500 * SECOND_NS + 800_000_000, "step", FlagKind.MARK))
    found = shift_ns(one, other, by)
    assert found == (None if expected is None else round(expected * 1e9))
    said = offset_text(one, other, found, 0.0)
    assert ("cannot be aligned" in said) is (expected is None)


def test_by_now_the_newest_rows_stand_where_their_age_says_and_stay_there(bench: Bench) -> None:
    one, other = bench.desk.stations
    rows(one, 0, [0.0])
    rows(other, 0, [0.0], START_NS - 500 * SECOND_NS)
    found = shift_ns(one, other, Align.NOW)
    assert found == pytest.approx(0, abs=1e9), "both robots' clocks are known to be ours"
    assert shift_ns(one, other, Align.NOW, 123) == 123, "it trembles"
    assert offset_text(one, other, 0, 0.25) == "its newest row is 499.75 s earlier, moved by +0.25 s"
    assert offset_text(one, other, 500 * SECOND_NS, 0.0) == "its newest row is of the same instant"


def test_what_is_beside_is_joined_and_an_expression_may_have_both(bench: Bench) -> None:
    one, other = bench.desk.stations
    beside = Beside(other)
    beside.shift_ns = 500 * SECOND_NS
    series = Series(one, beside)
    both = with_beside(CHANNELS.values(), CHANNELS.values())
    rows(one, 0, [5.0, 6.0, 7.0])
    rows(other, 0, [1.0, 2.0], START_NS - 500 * SECOND_NS)
    difference = meaning(f"{KNEE} - beside.{KNEE}", both, Units())
    assert difference.problem == ""
    assert series.values(difference, 3).tolist() == [4.0, 4.0, 5.0], "the third holds the last, 10 ms old"
    alone = meaning(f"beside.{KNEE}", both, Units())
    assert series.values(alone, 3).tolist() == [1.0, 2.0, 2.0]
    times = one.rings.times(10)
    assert beside.values(meant("left_knee.position * 2"), one.rings, times).tolist() == [2.0, 4.0, 4.0]
    missing = meaning(f"beside.{KNEE}", CHANNELS, Units())
    assert "nothing beside it has left_knee.position" in missing.problem
    assert np.isnan(series.values(missing, 3)).all()
