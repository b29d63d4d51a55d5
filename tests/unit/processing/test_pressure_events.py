"""Events from the force on an insole: noise, drift, loss and gaps."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server_gui.core.processing.gait_events import EventKind, GaitEvent, Leg
from server_gui.core.processing.pressure_events import CONFIRM_NS, PressureEvents
from tests.support.examples import examples
from tests.unit.processing.footfalls import DT_NS, fed, force, found_times, noisy, offs, stamps, true_times
from tests.unit.processing.scoring import score

SECONDS = 24.0


def walk(seconds: float = SECONDS) -> list[tuple[int, float]]:
    return [(stamp_ns, force(stamp_ns / 1e9)) for stamp_ns in stamps(seconds)]


def f1(events: list[GaitEvent], kind: EventKind, seconds: float = SECONDS) -> float:
    return score(true_times(kind, seconds), found_times(events, kind, seconds)).f1


@pytest.mark.parametrize("kind", EventKind)
def test_every_step_is_found_where_the_threshold_is_crossed(kind: EventKind) -> None:
    events = fed(PressureEvents(Leg.LEFT).feed, walk())
    found = score(true_times(kind, SECONDS), found_times(events, kind, SECONDS))
    assert found.f1 == 1.0
    assert all(abs(error_ns) < 5e6 for error_ns in found.errors_ns)


def test_an_event_is_known_when_it_has_lasted() -> None:
    events = fed(PressureEvents(Leg.LEFT).feed, walk())
    assert events
    for event in events:
        assert CONFIRM_NS <= event.known_ns - event.stamp_ns <= CONFIRM_NS + DT_NS


@pytest.mark.parametrize("kind", EventKind)
@pytest.mark.parametrize(("spread", "lost"), [(15.0, 0.0), (5.0, 0.2), (10.0, 0.1)])
def test_noise_and_lost_samples_cost_no_event(kind: EventKind, spread: float, lost: float) -> None:
    events = fed(PressureEvents(Leg.LEFT).feed, noisy(walk(), spread, lost))
    assert f1(events, kind) == 1.0


@pytest.mark.parametrize("kind", EventKind)
@pytest.mark.parametrize("newtons_per_s", [-10.0, 10.0, 20.0])
def test_drift_costs_no_event(kind: EventKind, newtons_per_s: float) -> None:
    drifting = [(at_ns, value + newtons_per_s * at_ns / 1e9) for at_ns, value in walk()]
    assert f1(fed(PressureEvents(Leg.LEFT).feed, drifting), kind) >= 0.98


def test_an_insole_that_has_drifted_while_standing_is_found_again_within_a_few_strides() -> None:
    detector = PressureEvents(Leg.LEFT)
    standing = [(at_ns, 420.0 + 0.2 * at_ns / 1e8) for at_ns in stamps(30.0)]
    assert fed(detector.feed, standing) == []
    walking = [(at_ns, 120.0 + force(at_ns / 1e9)) for at_ns in stamps(SECONDS, 30.0)]
    events = fed(detector.feed, walking)
    assert events[0].after_gap
    assert events[0].stamp_ns < 35e9
    found = [float(event.stamp_ns) for event in events if event.kind is EventKind.TOE_OFF]
    true = [off_s * 1e9 for off_s in offs(54.0) if events[0].known_ns / 1e9 < off_s < 53.5]
    assert score(true, [stamp_ns for stamp_ns in found if events[0].known_ns < stamp_ns < 53.5e9]).f1 == 1.0
    assert len([stamp_ns for stamp_ns in found if stamp_ns <= events[0].known_ns]) <= 1


def test_standing_that_sways_is_no_step() -> None:
    swaying = [(at_ns, 430.0 + 250.0 * math.sin(at_ns / 1e9)) for at_ns in stamps(60.0)]
    assert fed(PressureEvents(Leg.LEFT).feed, swaying) == []


def test_a_bounce_is_no_event() -> None:
    """A heel that comes up for 30 ms after it has struck."""
    bounced = [(at_ns, 0.0 if 0.04 < at_ns / 1e9 % 1.2 < 0.07 else value) for at_ns, value in walk()]
    assert f1(fed(PressureEvents(Leg.LEFT).feed, bounced), EventKind.TOE_OFF) == 1.0


WHOLE = fed(PressureEvents(Leg.LEFT).feed, walk())


@settings(max_examples=examples(20))
@given(st.floats(2.0, 20.0), st.floats(0.15, 4.0))
def test_nothing_is_invented_in_a_gap(begin_s: float, lasting_s: float) -> None:
    cut = [(at_ns, value) for at_ns, value in walk() if not begin_s <= at_ns / 1e9 <= begin_s + lasting_s]
    last_ns = max(at_ns for at_ns, _ in cut if at_ns < begin_s * 1e9)
    next_ns = min((at_ns for at_ns, _ in cut if at_ns > last_ns), default=math.inf)
    events = fed(PressureEvents(Leg.LEFT).feed, cut)
    assert not [event for event in events if last_ns < event.stamp_ns < next_ns]
    assert all(min(abs(event.stamp_ns - true.stamp_ns) for true in WHOLE) < 5e6 for event in events)
    after = [event for event in events if event.stamp_ns >= next_ns]
    assert [event.after_gap for event in after[:2]] in ([], [True], [True, False])


@settings(max_examples=examples(50))
@given(st.lists(st.tuples(st.integers(-50, 400), st.one_of(st.none(), st.floats(-1e4, 1e4))), max_size=300))
def test_whatever_comes_events_alternate_and_go_on_in_time(steps: list[tuple[int, float | None]]) -> None:
    detector, now_ns, events = PressureEvents(Leg.RIGHT), 10_000_000_000, list[GaitEvent]()
    for step_ms, value in steps:
        now_ns += step_ms * 1_000_000
        event = detector.feed(now_ns, value)
        if event is not None:
            events.append(event)
            assert event.stamp_ns <= event.known_ns == now_ns
    for before, after in pairwise(events):
        assert after.after_gap or (before.kind is not after.kind and before.stamp_ns < after.stamp_ns)


def test_a_robot_that_was_started_again_is_followed_anew() -> None:
    detector = PressureEvents(Leg.LEFT)
    late = [(at_ns + 10**15, value) for at_ns, value in walk()]
    assert fed(detector.feed, late)
    again = fed(detector.feed, walk())
    assert again[0].after_gap
    assert f1(again, EventKind.HEEL_STRIKE) == 1.0


def test_what_was_seen_already_is_passed_over() -> None:
    twice = [sample for sample in walk() for _ in range(2)]
    assert fed(PressureEvents(Leg.LEFT).feed, twice) == fed(PressureEvents(Leg.LEFT).feed, walk())
