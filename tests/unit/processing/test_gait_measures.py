"""Cadence, times, shares, symmetry and variability, by hand."""

import pytest

from server_gui.core.processing.gait_events import EventKind, GaitEvent, Leg
from server_gui.core.processing.gait_measures import GaitMeasures, Stride, symmetry_index
from tests.unit.processing.footfalls import event

STRIKE, OFF = EventKind.HEEL_STRIKE, EventKind.TOE_OFF


def walk(
    strides: int, stride_s: float = 1.2, right_after: float = 0.6, stance: float = 0.65
) -> list[GaitEvent]:
    """Strides of both legs; the right one strikes `right_after` (s) after the left."""
    events = []
    for n in range(strides):
        for leg, late_s in ((Leg.LEFT, 0.0), (Leg.RIGHT, right_after)):
            events.append(event(leg, STRIKE, n * stride_s + late_s))
            events.append(event(leg, OFF, n * stride_s + late_s + stance * stride_s))
    return sorted(events, key=lambda one: one.stamp_ns)


def taken(events: list[GaitEvent]) -> tuple[GaitMeasures, list[Stride]]:
    measures = GaitMeasures()
    strides = [measures.take(one) for one in events]
    return measures, [stride for stride in strides if stride is not None]


def test_an_even_walk() -> None:
    measures, strides = taken(walk(8))
    gait = measures.now(round(8 * 1.2e9))
    assert gait.walking
    assert gait.cadence_spm == pytest.approx(100.0)
    assert gait.double_support == pytest.approx(0.30)
    for leg in Leg:
        found = gait.legs[leg]
        figures = [found.stride_s, found.step_s, found.stance, found.swing]
        assert figures == [pytest.approx(value) for value in (1.2, 0.6, 0.65, 0.35)]
        assert found.variability == pytest.approx(0.0, abs=1e-9)
    assert gait.symmetry == {name: pytest.approx(0.0, abs=1e-9) for name in ("step_s", "stance", "swing")}
    assert len(strides) == 14


def test_a_limp_is_seen_in_the_step_times() -> None:
    """The left step takes 0.7 s, the right one 0.5 s."""
    gait = taken(walk(8, right_after=0.5))[0].now(round(8 * 1.2e9))
    assert gait.legs[Leg.LEFT].step_s == pytest.approx(0.7)
    assert gait.legs[Leg.RIGHT].step_s == pytest.approx(0.5)
    assert gait.symmetry["step_s"] == pytest.approx(0.2 / 0.6)
    assert gait.cadence_spm == pytest.approx(100.0)


def test_symmetry_index_is_that_of_robinson() -> None:
    assert symmetry_index(0.6, 0.4) == pytest.approx(0.4)
    assert symmetry_index(0.5, None) is None
    assert symmetry_index(0.0, 0.0) is None


def test_variability_is_the_coefficient_of_variation_of_the_stride_time() -> None:
    times_s, now_s = [1.0, 1.2, 1.0, 1.2, 1.0, 1.2], 0.0
    events = [event(Leg.LEFT, STRIKE, 0.0)]
    for time_s in times_s:
        events += [event(Leg.LEFT, OFF, now_s + 0.6), event(Leg.LEFT, STRIKE, now_s + time_s)]
        now_s += time_s
    found = taken(events)[0].now(round(now_s * 1e9)).legs[Leg.LEFT]
    assert found.variability == pytest.approx(0.10954 / 1.1, rel=1e-3)


@pytest.mark.parametrize("missing", [STRIKE, OFF])
def test_a_missed_event_makes_no_stride_out_of_two(missing: EventKind) -> None:
    events = walk(6)
    left = [one for one in events if one.leg is Leg.LEFT and one.kind is missing]
    events.remove(left[2])
    assert max(stride.time_s for stride in taken(events)[1]) == pytest.approx(1.2 if missing is OFF else 2.4)
    assert all(0.3 < stride.stance < 0.9 for stride in taken(events)[1])


def test_a_gap_ends_the_stride_that_it_is_in() -> None:
    events = walk(6)
    third = [one for one in events if one.leg is Leg.LEFT and one.kind is OFF][2]
    events[events.index(third)] = event(Leg.LEFT, OFF, third.stamp_ns / 1e9, after_gap=True)
    left = [stride for stride in taken(events)[1] if stride.leg is Leg.LEFT]
    assert len(left) == 4


def test_who_has_stopped_has_no_cadence() -> None:
    measures, _ = taken(walk(6))
    assert measures.now(round(7.0e9)).walking
    stopped = measures.now(round(12.0e9))
    assert not stopped.walking
    assert stopped.cadence_spm is None
    assert stopped.legs[Leg.LEFT].stride_s is None


def test_whoever_is_seen_too_briefly_is_not_said_to_stand() -> None:
    measures = GaitMeasures()
    assert measures.now(0).walking is None
    for stamp_s in (1.0, 1.4, 1.8, 2.2, 2.6, 3.0, 3.4, 3.8):
        measures.see(round(stamp_s * 1e9))
    assert measures.now(round(3.0e9)).walking is None
    assert measures.now(round(4.0e9)).walking is False
    measures.take(event(Leg.LEFT, EventKind.HEEL_STRIKE, 4.5))
    assert measures.now(round(5.0e9)).walking is None, "one step is no whole stride yet"


def test_who_was_not_seen_for_a_while_is_not_said_to_stand() -> None:
    measures, _ = taken(walk(6))
    for stamp_s in (7.0, 7.2, 11.0):
        measures.see(round(stamp_s * 1e9))
    assert measures.now(round(11.1e9)).walking is None, "steps may have been made meanwhile"
    measures.see(round(11.4e9))
    assert measures.now(round(13.6e9)).walking is False


def test_another_walk_begins_anew() -> None:
    measures, _ = taken(walk(6))
    for one in walk(3, stride_s=2.0, right_after=1.0):
        later = event(one.leg, one.kind, 100.0 + one.stamp_ns / 1e9)
        measures.take(later)
    assert measures.now(round(105e9)).cadence_spm == pytest.approx(60.0)


def test_whoever_has_only_begun_to_walk_has_no_cadence_yet() -> None:
    said = []
    measures = GaitMeasures()
    for one in walk(4, stride_s=1.6, right_after=0.8):
        measures.take(one)
        said.append(measures.now(one.stamp_ns))
    assert any(gait.walking and gait.cadence_spm is None for gait in said)
    assert {round(gait.cadence_spm) for gait in said if gait.cadence_spm is not None} == {75}


def test_a_stride_in_which_somebody_stood_is_no_part_of_the_cadence() -> None:
    first = [event(Leg.LEFT, STRIKE, -2.4), event(Leg.RIGHT, STRIKE, -2.3), event(Leg.LEFT, OFF, -0.5)]
    measures, strides = taken([*first, event(Leg.RIGHT, OFF, 0.3), *walk(4, stride_s=1.6, right_after=0.8)])
    assert max(stride.time_s for stride in strides) > 2.0
    gait = measures.now(round(4 * 1.6e9))
    assert gait.cadence_spm == pytest.approx(75.0)
    assert gait.legs[Leg.LEFT].stride_s == pytest.approx(1.6)


def test_a_leg_that_is_not_seen_any_more_has_no_part_in_what_is_measured_now() -> None:
    """Its strides of a minute ago gave a cadence, and were compared with those of the other leg."""
    right = [one for one in walk(60) if one.leg is Leg.RIGHT or one.stamp_ns < 12e9]
    gait = taken(right)[0].now(round(60 * 1.2e9))
    assert gait.walking
    assert (gait.legs[Leg.RIGHT].strides, gait.legs[Leg.LEFT].strides) == (10, 0)
    assert (gait.cadence_spm, set(gait.symmetry.values())) == (None, {None})


def test_running_has_no_double_support() -> None:
    strides = taken(walk(6, stance=0.4))[1]
    assert [stride.double_support for stride in strides] == [None] * len(strides)
