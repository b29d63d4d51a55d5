"""Storing to flash: which devices can, what speaks against it now, and what came of it."""

import pytest

from gateway.client import LinkLost, RemoteError
from gateway.units import Units
from gateway.wire.component import ComponentInfo
from gateway.wire.parameter import Stored, Written
from server_gui.core.follow.events import Described
from server_gui.core.tuning.storing import Storable, objection, storable
from server_gui.core.tuning.writing import WriteState
from tests.support.desk import Bench, described, walking

STEP = "gait.step_length"


def two_axes() -> Described:
    """Left hip and knee are axes of one device."""
    facts = described()
    device: dict[str, str | int] = {"bus": "main", "node_id": 5}
    for place, part in enumerate(facts.description.components):
        if part.name in ("left_hip", "left_knee"):
            facts.description.components[place] = ComponentInfo(part.name, part.kind, "ok", None, device)
    return facts


def test_a_device_that_says_it_can_store_is_offered_with_what_it_keeps() -> None:
    (knee,) = storable(described().description)
    assert (knee.components, knee.parameters, knee.title) == (
        ("left_knee",),
        ("left_knee.max_torque",),
        "left knee",
    )


def test_axes_of_one_device_store_together() -> None:
    (both,) = storable(two_axes().description)
    assert both.components == ("left_hip", "left_knee")
    assert both.title == "left hip + left knee"


def test_what_speaks_against_it_is_said(bench: Bench) -> None:
    station = bench.station
    (knee,) = storable(described().description)
    assert objection(knee, station.robot, station.writing.trial) is None
    station.take([walking(2)])
    assert "left_knee under power" in (objection(knee, station.robot, None) or "")
    station.robot.values["left_knee.state"] = 7.0
    assert objection(knee, station.robot, None) is None
    station.writing.done(Written(7, {STEP: 0.4}, {STEP: 0.43}, trial_s=20.0))
    assert "gait.step_length is on trial" in (objection(knee, station.robot, station.writing.trial) or "")


def test_another_axis_of_the_device_under_power_speaks_against_it_too(bench: Bench) -> None:
    (both,) = storable(two_axes().description)
    bench.station.take([two_axes(), walking(2)])
    bench.station.robot.values["left_knee.state"] = 7.0
    assert "left_hip under power" in (objection(both, bench.station.robot, None) or "")


def test_a_device_that_is_no_drive_waits_for_every_drive(bench: Bench) -> None:
    bench.station.take([walking(2)])
    gait = Storable(("gait",), (STEP,))
    assert "left_hip, left_knee" in (objection(gait, bench.station.robot, None) or "")


def test_what_was_stored_is_told_as_the_robot_says_it(bench: Bench) -> None:
    bench.station.store("left_knee")
    assert bench.first.asked == [("store", ("left_knee",))]
    assert bench.station.writing.text == "left_knee is storing to its flash …"
    bench.first.answer(Stored("left_knee", "stored, and it still holds the same values"))
    assert bench.station.writing.text == "left_knee: stored, and it still holds the same values"


def test_a_write_never_stores(bench: Bench) -> None:
    bench.station.edits.stage(STEP, 0.43, bench.station.robot.parameters[STEP])
    bench.station.write(bench.station.difference(Units()))
    bench.first.answer(Written(1, {STEP: 0.4}, {STEP: 0.43}))
    assert [name for name, _ in bench.first.asked] == ["write"]
    assert not bench.station.is_stored(STEP)


@pytest.mark.parametrize(
    ("error", "state"),
    [
        (RemoteError(-32006, "the state is unknown", {"kind": "wrong_state"}), WriteState.NOT_STORED),
        (RemoteError(-32011, "NOBODY KNOWS whether it did", {"kind": "device_timeout"}), WriteState.UNKNOWN),
        (LinkLost("the link dropped"), WriteState.UNKNOWN),
    ],
)
def test_a_store_that_failed_and_one_that_nobody_knows_of_are_told_apart(
    bench: Bench, error: Exception, state: WriteState
) -> None:
    bench.station.store("left_knee")
    bench.first.fail(error)
    assert bench.station.writing.state is state
    assert bench.station.writing.text == str(error)


def test_all_devices_store_one_after_another(bench: Bench) -> None:
    station = bench.station
    station.store("left_hip", "left_knee")
    assert bench.first.named("store") == [("left_hip",)], "the second waits for the first"
    bench.first.answer(Stored("left_hip", "stored, and it still holds the same values"))
    bench.first.answer(Stored("left_knee", "stored, and it still holds the same values"))
    assert bench.first.named("store") == [("left_hip",), ("left_knee",)]
    assert station.writing.state is WriteState.DONE
    assert station.writing.text == "left_hip: stored\nleft_knee: stored"


def test_each_device_is_said_to_be_stored_refused_or_not_confirmed(bench: Bench) -> None:
    station = bench.station
    station.store("left_hip", "left_knee", "right_hip")
    bench.first.fail(RemoteError(-32010, "it is under power", {"kind": "drive_state"}))
    bench.first.fail(RemoteError(-32011, "no answer", {"kind": "device_timeout"}))
    bench.first.answer(Stored("right_hip", "stored"))
    assert station.writing.state is WriteState.UNKNOWN
    assert station.writing.text.splitlines() == [
        "left_hip: refused, it is under power",
        "left_knee: NOT CONFIRMED, no answer",
        "right_hip: stored",
    ]


def test_after_the_link_was_lost_nothing_more_is_asked(bench: Bench) -> None:
    station = bench.station
    station.store("left_hip", "left_knee")
    bench.first.fail(LinkLost("the link dropped"))
    assert bench.first.named("store") == [("left_hip",)]
    assert "left_knee: not asked, the link was lost" in station.writing.text
    assert "left_hip: NOT CONFIRMED" in station.writing.text
    assert station.writing.state is WriteState.UNKNOWN
