"""Events from the pitch rate of an IMU on the foot."""

import math

import pytest

from server_gui.core.processing.foot_imu_events import FootImuEvents
from server_gui.core.processing.gait_events import EventKind, Leg
from tests.unit.processing.footfalls import fed, found_times, pitch_rate, stamps, true_times
from tests.unit.processing.scoring import score

SECONDS = 20.0


def walk() -> list[tuple[int, float | None]]:
    return [(stamp_ns, pitch_rate(stamp_ns / 1e9)) for stamp_ns in stamps(SECONDS)]


@pytest.mark.parametrize("kind", EventKind)
def test_steps_are_found(kind: EventKind) -> None:
    events = fed(FootImuEvents(Leg.LEFT).feed, walk())
    assert score(true_times(kind, SECONDS), found_times(events, kind, SECONDS)).f1 == 1.0


def test_a_foot_that_is_still_or_trembles_takes_no_step() -> None:
    trembling = [(at_ns, 0.8 * math.sin(12 * at_ns / 1e9)) for at_ns in stamps(SECONDS)]
    assert fed(FootImuEvents(Leg.LEFT).feed, trembling) == []


def test_nothing_is_found_in_a_gap() -> None:
    cut = [(at_ns, rate) for at_ns, rate in walk() if not 5.0 < at_ns / 1e9 < 9.0]
    events = fed(FootImuEvents(Leg.LEFT).feed, cut)
    assert not [event for event in events if 5.02e9 < event.stamp_ns < 9e9]
    assert next(event for event in events if event.stamp_ns >= 9e9).after_gap
    assert {event.stamp_ns for event in events} <= {
        event.stamp_ns for event in fed(FootImuEvents(Leg.LEFT).feed, walk())
    }


def test_missing_samples_are_passed_over() -> None:
    holed = [(at_ns, None if at_ns // 10_000_000 % 5 == 0 else rate) for at_ns, rate in walk()]
    events = fed(FootImuEvents(Leg.LEFT).feed, holed)
    for kind in EventKind:
        assert score(true_times(kind, SECONDS), found_times(events, kind, SECONDS)).f1 == 1.0
