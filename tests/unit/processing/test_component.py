"""Component-processing: which source counts, targets, and memory that stays."""

import math
import tracemalloc

from server_gui.core.processing.component import ComponentProcessing
from server_gui.core.processing.gait_events import EventSource, Leg
from tests.unit.processing.footfalls import force, pitch_rate, stamps

FORCES = ("left_insole.force", "right_insole.force")
JOINTS = [f"{leg}_{joint}" for leg in Leg for joint in ("hip", "knee", "ankle")]


def row(time_s: float) -> dict[str, list[float | None]]:
    swing = math.tau * time_s / 1.2
    values: dict[str, list[float | None]] = {f"{joint}.position": [0.4 * math.sin(swing)] for joint in JOINTS}
    values |= {f"{joint}.following_error": [0.02] for joint in JOINTS}
    values |= {f"{leg}_insole.cell_{cell}": [0.0] for leg in Leg for cell in range(16)}
    values["left_insole.force"], values["right_insole.force"] = [force(time_s)], [force(time_s, 0.6)]
    return values


def test_a_robot_without_anything_derives_nothing() -> None:
    shown = ComponentProcessing().shown()
    assert not shown.gait.walking
    assert shown.sources == {Leg.LEFT: None, Leg.RIGHT: None}


def test_an_insole_that_is_not_trusted_gives_no_events() -> None:
    processing = ComponentProcessing()
    processing.distrusted = frozenset({"left_insole"})
    events = [
        event
        for stamp_ns in stamps(6.0)
        for event in processing.take([stamp_ns], {name: row(stamp_ns / 1e9)[name] for name in FORCES}).events
    ]
    assert {event.leg for event in events} == {Leg.RIGHT}
    assert processing.shown().sources == {Leg.LEFT: None, Leg.RIGHT: EventSource.PRESSURE}


def test_an_imu_on_the_foot_gives_events_where_there_is_no_insole() -> None:
    processing = ComponentProcessing()
    columns = "left_foot.angular_velocity_y", "trunk.angular_velocity_y"
    for stamp_ns in stamps(6.0):
        rate = pitch_rate(stamp_ns / 1e9)
        processing.take([stamp_ns], {columns[0]: [rate], columns[1]: [rate]})
    assert len(processing.shown().events) >= 8
    assert processing.shown().sources[Leg.LEFT] is EventSource.FOOT_IMU


def test_memory_stays_the_same_however_long_it_goes_on() -> None:
    processing = ComponentProcessing()
    rows = [row(time_ns / 1e9) for time_ns in stamps(6.0)]  # five whole strides

    def go_on(rounds: range) -> int:
        for number in rounds:
            for step, values in enumerate(rows):
                processing.take([number * 6_000_000_000 + step * 10_000_000], values)
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        after_some, after_more = go_on(range(4)), go_on(range(4, 6))
    finally:
        tracemalloc.stop()
    assert after_more - after_some < 20_000
