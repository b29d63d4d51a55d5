"""The fleet's small parts: facts of a session, counters of a link."""

import time

import msgspec
import pytest
from msgspec.structs import replace

from gateway.client import Address, Batch, ClockOffset, ConnectionState
from gateway.wire.component import ComponentInfo
from gateway.wire.parameter import ParameterInfo
from server_gui.core.fleet.link_statistics import SECOND_NS, LinkReport, LinkStatistics
from server_gui.core.fleet.session_facts import configuration_hash, facts
from server_gui.core.follow.events import LinkChanged, Resources, Telemetry
from server_gui.core.processing.communication import Health
from tests.unit.processing.test_resource import look
from tests.unit.recording.robots import description

KNEE = ComponentInfo("left_knee", "joint", "ok", None, {"eds": "joint_drive.eds", "node_id": 2})
STEP = ParameterInfo(
    "gait.step_length", "m", 0.2, 0.6, 0.1, True, None, "gait", "0x2001:0", "rw", False, None, None, "", 0.001
)
EXO = replace(description("exo-01"), components=[KNEE], parameters=[STEP])


def test_what_changes_by_itself_does_not_change_the_configuration() -> None:
    lost = replace(KNEE, state="lost", problem="no heartbeat")
    unknown = replace(STEP, problem="not read yet")
    same = replace(
        EXO, boot_id="boot-2", components=[lost], parameters=[unknown], modules={"component": "running"}
    )
    assert configuration_hash(same) == configuration_hash(EXO)


@pytest.mark.parametrize(
    "changed",
    [
        replace(EXO, role="master"),
        replace(EXO, components=[replace(KNEE, device={"eds": "other.eds", "node_id": 2})]),
        replace(EXO, parameters=[replace(STEP, max=0.5)]),
        replace(EXO, parameters=[]),
    ],
)
def test_what_the_robots_file_says_is_the_configuration(changed: msgspec.Struct) -> None:
    assert configuration_hash(msgspec.convert(msgspec.to_builtins(changed), type(EXO))) != configuration_hash(
        EXO
    )


def test_facts_name_units_versions_and_who_records() -> None:
    found = facts(EXO, "Ada", "new insoles")
    assert found.units["left_knee.velocity"] == "rad/s"
    assert found.versions["protocol"] == "1"
    assert found.versions["gwrms collect"]
    assert "gateway" not in found.versions  # which does not tell it
    assert facts(replace(EXO, version="0.1.0"), "", "").versions["gateway"] == "0.1.0"
    assert (found.operator, found.notes) == ("Ada", "new insoles")


def telemetry(
    link: int, stream: int, seq: int, dropped: int = 0, missed: int = 0, at_s: int = 100
) -> Telemetry:
    columns: dict[str, list[float | None]] = {"a.b": [0.5, None], "a.c": [1.0, 1.0]}
    batch = Batch([1, 2], columns, seq, dropped, missed, link, at_s * SECOND_NS)
    return Telemetry(stream, batch, ClockOffset(5_000_000, 250_000))


def test_losses_add_up_over_links_and_streams() -> None:
    counted = LinkStatistics(Address())
    for event in (
        telemetry(1, 1, 0, dropped=3),
        telemetry(1, 1, 4, dropped=5, missed=3),
        telemetry(2, 1, 0, dropped=0),
        telemetry(2, 1, 1, dropped=2),
        telemetry(2, 2, 0, dropped=1),
    ):
        counted.take(event)
    report = counted.report("s-1")
    assert (report.rows, report.dropped, report.missed, report.session) == (10, 8, 3, "s-1")
    assert report.bytes == 10 * (4 + 2) * 8
    assert (report.clock_offset_s, report.clock_uncertainty_s) == (0.005, 0.00025)


def test_rows_a_second_are_those_of_the_last_whole_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = LinkStatistics(Address())
    for second in range(90, 100):
        for seq in range(50):
            counted.take(telemetry(1, 1, seq, at_s=second))
    monkeypatch.setattr("time.monotonic_ns", lambda: 100 * SECOND_NS + 1)
    assert counted.report("").rows_per_s == 100.0
    monkeypatch.setattr("time.monotonic_ns", lambda: 110 * SECOND_NS)
    assert counted.report("").rows_per_s == 0.0


def test_the_first_seconds_of_a_link_are_no_part_of_a_slow_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording began with 17 rows a second where 100 came."""
    counted = LinkStatistics(Address())
    counted.take(LinkChanged(ConnectionState.CONNECTED, None, 100 * SECOND_NS))
    counted.take(telemetry(1, 1, 0, at_s=100))  # of a second that had begun before
    monkeypatch.setattr("time.monotonic_ns", lambda: 101 * SECOND_NS - 1)
    assert counted.report("").rows_per_s == 0.0, "not known before a second is whole"
    for seq in range(50):
        counted.take(telemetry(1, 1, seq, at_s=101))
    monkeypatch.setattr("time.monotonic_ns", lambda: 102 * SECOND_NS)
    assert counted.report("").rows_per_s == 100.0
    counted.take(LinkChanged(ConnectionState.WAITING, "closed", 102 * SECOND_NS))
    counted.take(LinkChanged(ConnectionState.CONNECTED, None, 103 * SECOND_NS))
    counted.take(telemetry(2, 1, 0, at_s=103))
    monkeypatch.setattr("time.monotonic_ns", lambda: 104 * SECOND_NS - 1)
    assert counted.report("").rows_per_s == 0.0


def test_what_came_over_the_network_is_counted_whatever_became_of_it() -> None:
    counted = LinkStatistics(Address())
    counted.take(LinkChanged(ConnectionState.CONNECTED, None, SECOND_NS))
    for at_s, received in ((10, 1_000), (15, 51_000), (20, 61_000)):
        counted.take(Resources(look(at_s), 2_000_000, at_s * SECOND_NS, received))
    report = counted.report("")
    assert (report.received, report.received_per_s) == (61_000, 2_000.0)
    counted.take(LinkChanged(ConnectionState.WAITING, "closed", 21 * SECOND_NS))
    report = counted.report("")
    assert (report.received, report.received_per_s) == (61_000, None)


def test_a_link_tells_its_quality_and_why_it_is_not_good(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = LinkStatistics(Address())
    counted.take(LinkChanged(ConnectionState.CONNECTED, None, 90 * SECOND_NS))
    counted.take(Resources(look(95), 2_000_000, 95 * SECOND_NS))
    for seq in range(10):
        counted.take(telemetry(1, 1, seq, at_s=90 + seq, dropped=seq))
    monkeypatch.setattr("time.monotonic_ns", lambda: 100 * SECOND_NS)
    quality = counted.report("").quality
    assert (quality.health, quality.round_trip) == (Health.POOR, 0.002)
    assert any("rows are lost" in reason for reason in quality.reasons)
    assert msgspec.json.decode(msgspec.json.encode(counted.report("")), type=LinkReport).quality == quality


def test_a_link_says_what_it_is_and_since_when() -> None:
    counted = LinkStatistics(Address("192.0.2.7", 7420))
    assert counted.report("").state == "idle"
    before_s = time.time()
    counted.take(LinkChanged(ConnectionState.CONNECTED, None, 1))
    counted.take(LinkChanged(ConnectionState.WAITING, "closed", 2))
    report = counted.report("")
    assert (report.address, report.state, report.problem, report.links) == (
        "192.0.2.7:7420",
        "waiting",
        "closed",
        1,
    )
    assert report.since_utc_s is not None
    assert before_s <= report.since_utc_s <= time.time()
    for again in (ConnectionState.CONNECTING, ConnectionState.WAITING):  # it is still away
        counted.take(LinkChanged(again, "refused", 3))
        assert counted.report("").since_utc_s == report.since_utc_s
    counted.take(LinkChanged(ConnectionState.CONNECTED, None, 4))
    assert (counted.report("").since_utc_s or 0) > report.since_utc_s
