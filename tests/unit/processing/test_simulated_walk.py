"""Component-processing on a short walk of the simulator, against its truth."""

import random
from itertools import pairwise

import numpy as np
import pytest

from hil_sim.gait.activity import Activity
from hil_sim.gait.timetable import Entry
from server_gui.core.processing.component import ComponentProcessing
from server_gui.core.processing.gait_events import EventKind, EventSource, GaitEvent, Leg
from server_gui.core.processing.kinematic_events import KinematicEvents
from server_gui.core.processing.recording import summarise
from tests.unit.hil_sim.moving import Moving
from tests.unit.processing.scoring import TOLERANCE_NS, Score, score
from tests.unit.processing.walks import FORCES, Walk, kind_of, record, with_noise

ENTRIES = (
    Entry(Activity.STAND, 1.5),
    Entry(Activity.WALK, 7.0),
    Entry(Activity.STAIRS_DOWN, 5.0),
    Entry(Activity.TURN_RIGHT, 6.0),
)


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    """On the level, down stairs, round a corner; somebody with habits and uneven strides."""
    return record(ENTRIES, 19.5, tmp_path_factory.mktemp("walk") / "truth", seed=5, person=4)


def scored(walk: Walk, events: list[GaitEvent], kind: EventKind, tolerance_ns: float = TOLERANCE_NS) -> Score:
    """Both legs together, but for the last events, which are not known yet when the recording ends."""
    end_ns = walk.stamps_ns[-1] - 3e8
    total = Score()
    for leg in Leg:
        found = [float(event.stamp_ns) for event in events if kind_of(event) == f"{leg}_{kind}"]
        true = [float(time_ns) for time_ns in walk.events[f"{leg}_{kind}"]]
        true, found = ([time for time in side if time < end_ns] for side in (true, found))
        total.add(score(true, found, tolerance_ns))
    return total


@pytest.mark.parametrize("kind", EventKind)
def test_pressure_finds_the_true_events(walk: Walk, kind: EventKind) -> None:
    assert scored(walk, summarise(walk.stamps_ns, walk.columns).events, kind).f1 >= 0.98


@pytest.mark.parametrize("kind", EventKind)
def test_a_worse_insole_finds_nearly_as_many(walk: Walk, kind: EventKind) -> None:
    columns = walk.columns | with_noise(walk, newtons=10.0, lost=0.1)
    assert scored(walk, summarise(walk.stamps_ns, columns).events, kind).f1 >= 0.95


@pytest.mark.parametrize("kind", EventKind)
def test_joints_find_most_events_to_a_tenth_of_a_second(walk: Walk, kind: EventKind) -> None:
    events = summarise(walk.stamps_ns, walk.without(*FORCES)).events
    assert scored(walk, events, kind, 100_000_000).f1 >= 0.9


def test_sitting_down_and_getting_up_is_no_step_to_the_joints() -> None:
    moving, detector, events = Moving(), KinematicEvents(), list[GaitEvent]()
    for activity in (Activity.SIT, Activity.STAND, Activity.SIT):
        for moment in moving.do(activity, 5.0):
            left, right = ((leg.hip, leg.knee) for leg in moment.legs)
            events += detector.feed(round(moment.time_s * 1e9), left, right, moment.trunk.pitch)
    assert events == []


def test_measures_are_those_of_the_true_events(walk: Walk) -> None:
    found = summarise(walk.stamps_ns, walk.columns)
    for leg in Leg:
        true = walk.events[f"{leg}_heel_strike"]
        strides = [stride for stride in found.strides if stride.leg is leg]
        times_s = [(b - a) / 1e9 for a, b in pairwise(true) if b - a < 3.5e9]
        assert len(strides) == pytest.approx(len(times_s), abs=2)
        assert np.median([stride.time_s for stride in strides]) == pytest.approx(np.median(times_s), rel=0.02)
        assert all(0.5 < stride.stance < 0.75 for stride in strides)
    double = [stride.double_support for stride in found.strides if stride.double_support is not None]
    assert len(double) > 0.8 * len(found.strides)
    stances = sum(found.gait.legs[leg].stance or 0.0 for leg in Leg)
    assert found.gait.double_support == pytest.approx(stances - 1.0, abs=0.02)


def test_range_of_motion_is_that_of_the_joint_in_each_stride(walk: Walk) -> None:
    knee = walk.columns["left_knee.position"]
    strides = [one for one in summarise(walk.stamps_ns, walk.columns).strides if one.leg is Leg.LEFT]
    assert strides
    for stride in strides:
        begin, end = np.searchsorted(walk.stamps_ns, [stride.began_ns, stride.ended_ns])
        assert stride.ranges["left_knee"] == pytest.approx(np.ptp(knee[begin:end]), abs=0.1)
        assert set(stride.ranges) == {"left_hip", "left_knee", "left_ankle"}


def test_live_and_recorded_give_the_very_same_events(walk: Walk) -> None:
    """Live in batches of any size, each component's samples apart, as a stream without a rate sends."""
    processing, source, events = ComponentProcessing(), random.Random(2), list[GaitEvent]()
    apart: dict[str, list[str]] = {}
    for name in walk.columns:
        apart.setdefault(name.partition(".")[0], []).append(name)
    row = 0
    while row < len(walk.stamps_ns):
        rows = slice(row, row + source.randint(1, 4))
        for names in apart.values():
            part = {name: walk.columns[name][rows].tolist() for name in names}
            events += processing.take(walk.stamps_ns[rows].tolist(), part).events
        row = rows.stop
    expected = summarise(walk.stamps_ns, walk.columns)
    assert sorted(events, key=str) == sorted(expected.events, key=str)
    assert processing.shown().sources == dict.fromkeys(Leg, EventSource.PRESSURE)


def test_joints_take_over_from_an_insole_that_falls_silent(walk: Walk) -> None:
    columns = {name: column.copy() for name, column in walk.columns.items()}
    silent_ns = walk.stamps_ns[1000]
    columns[FORCES[0]][1000:] = np.nan
    found = summarise(walk.stamps_ns, columns)
    left = [event for event in found.events if event.leg is Leg.LEFT and event.stamp_ns > silent_ns]
    assert left[0].after_gap
    assert scored(walk, found.events, EventKind.HEEL_STRIKE).f1 >= 0.8
    assert len([stride for stride in found.strides if stride.began_ns > silent_ns]) >= 5


def test_nothing_is_made_of_a_hole_in_the_recording(walk: Walk) -> None:
    hole = slice(600, 900)
    kept = np.r_[0 : hole.start, hole.stop : len(walk.stamps_ns)]
    for left_out in ((), FORCES):
        columns = {name: column[kept] for name, column in walk.without(*left_out).items()}
        found = summarise(walk.stamps_ns[kept], columns)
        began, ended = walk.stamps_ns[hole.start - 1], walk.stamps_ns[hole.stop]
        inside = [event for event in found.events if began + 5e7 < event.stamp_ns < ended - 5e7]
        assert inside == []
        across = [stride for stride in found.strides if stride.began_ns < began and stride.ended_ns > ended]
        assert across == []
