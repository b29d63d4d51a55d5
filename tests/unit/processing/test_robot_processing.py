"""The three modules behind one `apply`."""

from gateway.client import Batch, ConnectionState
from gateway.wire.component import Snapshot
from gateway.wire.robot import Clock, Description, GuardInfo
from gateway.wire.stop import StopInfo
from server_gui.core.follow.events import Described, Failed, LinkChanged, Looked, Resources, Telemetry
from server_gui.core.processing.communication import Health
from server_gui.core.processing.gait_events import EventSource, Leg
from server_gui.core.processing.robot_processing import RobotProcessing
from tests.unit.processing.footfalls import force, stamps
from tests.unit.processing.test_resource import look


def described(boot_id: str) -> Described:
    stop = StopInfo(False, None, None, {}, {})
    return Described(
        Description("exo", boot_id, "observer", [], [], [], {}, Clock(0, 0, boot_id), stop, GuardInfo())
    )


def walked(processing: RobotProcessing, seconds: float, begin_s: float = 0.0) -> int:
    for number, stamp_ns in enumerate(stamps(seconds, begin_s)):
        time_s = stamp_ns / 1e9
        columns: dict[str, list[float | None]] = {
            "left_insole.force": [force(time_s)],
            "right_insole.force": [force(time_s, 0.6)],
        }
        batch = Batch([stamp_ns], columns, number, 0, 0, 1, stamp_ns)
        processing.apply(Telemetry(1, batch, None))
    return round((begin_s + seconds) * 1e9)


def test_everything_is_known_after_some_steps() -> None:
    processing = RobotProcessing()
    processing.apply(LinkChanged(ConnectionState.CONNECTED, None, 0))
    processing.apply(described("a"))
    now_ns = walked(processing, 10.0)
    processing.apply(Resources(look(10.0), 3_000_000, now_ns))
    assert round(processing.derived().gait.cadence_spm or 0.0) == 100
    assert processing.link(now_ns).health is Health.GOOD
    assert len(processing.resource.history.recent()) == 1


def test_a_robot_that_was_started_again_is_seen_anew() -> None:
    processing = RobotProcessing()
    processing.apply(described("a"))
    walked(processing, 10.0, begin_s=1000.0)
    processing.apply(described("a"))
    assert processing.derived().gait.walking
    processing.apply(described("b"))
    assert not processing.derived().gait.walking
    walked(processing, 10.0)
    assert processing.derived().gait.walking


def test_an_insole_in_fault_is_not_believed_until_it_is_well() -> None:
    processing = RobotProcessing()
    for state, source in (("fault", None), ("ok", EventSource.PRESSURE)):
        processing.apply(Looked(Snapshot(0, {}, {}, {"left_insole": {"state": state}}), None, 0))
        walked(processing, 1.0, begin_s=2.0 if source else 0.0)
        assert processing.derived().sources == {Leg.LEFT: source, Leg.RIGHT: EventSource.PRESSURE}


def test_what_was_refused_changes_nothing() -> None:
    processing = RobotProcessing()
    processing.apply(Failed("write", "no"))
    assert not processing.derived().events
