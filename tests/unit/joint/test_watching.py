"""A joint is judged by values of one time: an old velocity explains no new position."""

import pytest

from drivers.joint.supervision import beside
from drivers.latest import Latest
from drivers.samples import Channel

MS = 1_000_000
CHANNELS = (Channel("knee.velocity", "knee", "velocity", "rad/s"),)


@pytest.mark.parametrize(("age_ms", "value"), [(0, 1.5), (20, 1.5), (-20, 1.5), (50, None), (250, None)])
def test_a_velocity_counts_beside_a_position_of_its_own_time_only(age_ms: int, value: float | None) -> None:
    latest = Latest("knee", CHANNELS, stale_after_s=0.5)
    latest.update(1000 * MS, (0,), (1.5,))
    stamp_ns = (1000 + age_ms) * MS
    assert beside(latest, 0, stamp_ns, max(stamp_ns, 1000 * MS)) == value


def test_a_drive_without_velocity_has_none() -> None:
    assert beside(Latest("knee", CHANNELS, 0.5), None, 0, 0) is None
    assert beside(Latest("knee", CHANNELS, 0.5), 0, 0, 0) is None
