"""Parameters through the wire: limits, steps, states, leases, and all or nothing over every node."""

import re
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import eds
from drivers.component import ComponentKind
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from gateway.config.robot import ParameterSettings
from gateway.modules.control import unanswered
from gateway.modules.control.catalogue import described
from gateway.modules.control.parameters import Parameter
from gateway.modules.control.rules import HEARD_S
from gateway.wire.framing import RpcError
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import DISABLED, QUICK_STOPPED, ROBOT, Bench, Client, config, serving

STEP, CYCLE, TOE, TORQUE = 0x2001, 0x2002, 0x2003, 0x6072


def u16(value: int) -> bytes:
    return value.to_bytes(2, "little")


@pytest.fixture
def writer(client: Client) -> Client:
    client.call("control.acquire", ttl_s=60)
    return client


# Reading


def test_read_asks_the_devices_now(client: Client, bench: Bench) -> None:
    values = client.call("parameter.read", names=["gait.*"])["values"]
    assert values["gait.step_length"]["value"] == 0.4
    assert values["gait.cycle_time"]["value"] == 1.2
    bench.gait.node.objects[STEP, 0] = u16(333)
    again = client.call("parameter.read", names=["gait.step_length"])["values"]["gait.step_length"]
    assert (again["value"], again["unit"], again["min"], again["max"]) == (0.333, "m", 0.25, 0.6)
    assert again["stamp_ns"] <= time.monotonic_ns()


def test_list_asks_nobody_and_knows_only_what_was_read(client: Client, bench: Bench) -> None:
    assert client.call("parameter.list")["values"]["gait.step_length"]["value"] is None
    assert bench.gait.node.log == []
    client.call("parameter.read", names=["gait.step_length"])
    listed = client.call("parameter.list")["values"]
    assert listed["gait.step_length"]["value"] == 0.4
    assert listed["gait.cycle_time"]["value"] is None
    bench.gait.lost = "no power"
    lost = client.call("parameter.list")["values"]["gait.step_length"]
    assert (lost["value"], lost["stamp_ns"], lost["problem"]) == (None, None, "gait is not there: no power")


def test_a_joint_without_a_position_is_there_as_long_as_its_node_says_something(
    client: Client, bench: Bench
) -> None:
    client.call("parameter.read", names=["left_knee.max_torque"])
    bench.left.lost = "it is pre-operational (NMT) and sends no PDOs until its master starts it"
    silent = client.call("parameter.list")["values"]["left_knee.max_torque"]
    assert (silent["value"], silent["problem"]) == (None, f"left_knee is not there: {bench.left.lost}")
    bench.left.node.life.heard_ns = time.monotonic_ns()
    heard = client.call("parameter.list")["values"]["left_knee.max_torque"]
    assert (heard["value"], heard["problem"]) == (100.0, None)
    bench.left.node.life.heard_ns = time.monotonic_ns() - round((HEARD_S + 1) * 1e9)
    assert client.call("parameter.list")["values"]["left_knee.max_torque"]["value"] is None


def test_a_device_that_does_not_tell_is_null_with_the_reason(client: Client, bench: Bench) -> None:
    def fail(index: int) -> None:
        if index == STEP:
            raise DeviceTimeout("node 16 does not answer")

    bench.gait.node.before_upload = fail
    values = client.call("parameter.read")["values"]
    assert values["gait.step_length"]["value"] is None
    assert "node 16 does not answer" in values["gait.step_length"]["problem"]
    assert values["gait.cycle_time"]["value"] == 1.2


def _silent(_index: int) -> None:
    raise DeviceTimeout("no answer within 0.3 s")


def _step_length(client: Client) -> dict[str, Any]:
    found: dict[str, dict[str, Any]] = client.call("parameter.read", names=["gait.step_length"])["values"]
    return found["gait.step_length"]


def test_a_device_that_missed_a_read_is_asked_again_once_it_has_answered_anybody(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unanswered, "AGAIN_S", 1000.0)
    bench.gait.node.before_upload = _silent
    assert "no answer within 0.3 s" in _step_length(client)["problem"]
    bench.gait.node.before_upload = lambda _index: None
    asked = len(bench.gait.node.log)
    problem = _step_length(client)["problem"]
    said = r"gait did not answer \d+ ms ago, and is asked again in \d+ ms: no answer within 0.3 s"
    assert re.search(said, problem)
    assert "is not there" not in problem  # nobody knows that
    assert len(bench.gait.node.log) == asked
    bench.gait.node.upload(CYCLE, 0)
    assert _step_length(client)["value"] == 0.4


def test_a_device_that_missed_a_read_is_asked_again_after_a_while(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unanswered, "AGAIN_S", 0.0)
    bench.gait.node.before_upload = _silent
    assert _step_length(client)["value"] is None
    bench.gait.node.before_upload = lambda _index: None
    assert _step_length(client)["value"] == 0.4


def test_a_name_that_does_not_exist_is_named(client: Client) -> None:
    for method in ("parameter.read", "parameter.list"):
        assert client.refused(method, names=["gait.step"]).kind == "unknown_name"


# Leases


def test_without_the_lease_nothing_is_written(client: Client, bench: Bench) -> None:
    assert client.refused("parameter.write", changes={"gait.step_length": 0.42}).kind == "no_lease"
    assert bench.gait.node.log == []


def test_one_writer_at_a_time(connect: Callable[[], Client]) -> None:
    first, second = connect(), connect()
    lease = first.call("control.acquire", ttl_s=60)
    error = second.refused("control.acquire", ttl_s=60)
    assert error.kind == "lease_held"
    assert "127.0.0.1:" in str(error)
    assert first.call("control.acquire", ttl_s=30) == {"lease": lease["lease"], "expires_s": 30}
    assert second.refused("control.release").kind == "no_lease"
    assert first.refused("control.release", lease="other").kind == "no_lease"
    first.call("control.release", lease=lease["lease"])
    assert first.refused("parameter.write", changes={"gait.step_length": 0.42}).kind == "no_lease"
    assert second.call("control.acquire", ttl_s=60)["lease"] != lease["lease"]


def test_a_lease_is_lost_with_its_connection(connect: Callable[[], Client]) -> None:
    first, second = connect(), connect()
    first.call("control.acquire", ttl_s=300)
    first.close()
    until(lambda: _acquires(second), "the lease is free")


def _acquires(client: Client) -> bool:
    id_ = client.request("control.acquire", ttl_s=1)
    try:
        return bool(client.answer(id_))
    except Exception:  # noqa: BLE001 - refused
        return False


def test_a_lease_ends_by_itself(connect: Callable[[], Client]) -> None:
    first, second = connect(), connect()
    first.call("control.acquire", ttl_s=0.05)
    until(lambda: _acquires(second), "the lease has ended")
    assert first.refused("parameter.write", changes={"gait.step_length": 0.42}).kind == "no_lease"


# Writing


def test_a_write_answers_what_the_device_held_and_holds(writer: Client, bench: Bench) -> None:
    answer = writer.call("parameter.write", changes={"gait.step_length": 0.42, "gait.cycle_time": 1.1})
    assert answer["before"] == {"gait.step_length": 0.4, "gait.cycle_time": 1.2}
    assert answer["after"] == {"gait.step_length": 0.42, "gait.cycle_time": 1.1}
    assert bench.gait.node.objects[STEP, 0] == u16(420)
    again = writer.call("parameter.write", changes={"gait.step_length": 0.43})
    assert again["write"] > answer["write"]


def test_after_is_the_value_that_the_device_can_hold(writer: Client) -> None:
    answer = writer.call("parameter.write", changes={"gait.step_length": 0.41237})
    assert answer["after"] == {"gait.step_length": 0.412}


@pytest.mark.parametrize(
    ("changes", "kind", "says", "limit"),
    [
        ({"gait.step_length": 0.61}, "out_of_limit", "above the maximum 0.6 m", 0.6),
        ({"gait.step_length": 0.249}, "out_of_limit", "below the minimum 0.25 m", 0.25),
        ({"gait.step_length": 0.51}, "out_of_limit", "may change by 0.1 m at once", 0.1),
        ({"gait.step_length": -1e300}, "out_of_limit", "below the minimum", 0.25),
        ({"gait.step": 0.4}, "unknown_name", "'gait.step'", None),
        ({"gait.toe_height": 0.09}, "wrong_state", "left_knee is operation enabled", None),
        ({"left_knee.max_torque": 50}, "wrong_state", "left_knee is operation enabled", None),
    ],
)
def test_a_refused_change_changes_nothing_of_all(
    writer: Client, bench: Bench, changes: dict[str, float], kind: str, says: str, limit: float | None
) -> None:
    before = dict(bench.gait.node.objects)
    error = writer.refused("parameter.write", changes={"gait.cycle_time": 1.25, **changes})
    assert (error.kind, error.data.get("limit")) == (kind, limit)
    assert says in str(error)
    assert bench.gait.node.objects == before
    assert bench.gait.node.written() == []


def test_a_step_of_exactly_the_limit_is_allowed(writer: Client) -> None:
    assert writer.call("parameter.write", changes={"gait.step_length": 0.5})["after"] == {
        "gait.step_length": 0.5
    }


def test_what_is_not_live_may_be_written_while_no_drive_can_move(writer: Client, bench: Bench) -> None:
    bench.left.set_state(DISABLED)
    assert writer.refused("parameter.write", changes={"gait.toe_height": 0.09}).kind == "wrong_state"
    bench.right.set_state(QUICK_STOPPED)  # still under power
    assert writer.refused("parameter.write", changes={"gait.toe_height": 0.09}).kind == "wrong_state"
    bench.right.set_state(DISABLED)
    assert writer.call("parameter.write", changes={"gait.toe_height": 0.09})["after"] == {
        "gait.toe_height": 0.09
    }


def test_a_joints_parameter_asks_only_its_own_drive(writer: Client, bench: Bench) -> None:
    bench.left.set_state(DISABLED)
    answer = writer.call("parameter.write", changes={"left_knee.max_torque": 50})
    assert answer["after"] == {"left_knee.max_torque": 50.0}


def test_an_unknown_drive_state_means_do_not(writer: Client, bench: Bench) -> None:
    bench.left.set_state(DISABLED)
    del bench.right.node.objects[0x6041, 0]
    error = writer.refused("parameter.write", changes={"gait.toe_height": 0.09})
    assert error.kind == "wrong_state"
    assert "right_knee is unknown" in str(error)
    bench.right.node.objects[0x6041, 0] = b"\x01\x00"  # no state of the standard
    assert "statusword is 0x0001" in str(writer.refused("parameter.write", changes={"gait.toe_height": 0.09}))


def test_an_absent_drive_means_do_not(client: Client, bench: Bench) -> None:
    bench.absent["right_knee"] = (ComponentKind.JOINT, "its EDS is broken")
    bench.left.set_state(DISABLED)
    client.call("control.acquire", ttl_s=60)
    assert "its EDS is broken" in str(client.refused("parameter.write", changes={"gait.toe_height": 0.09}))


def test_named_states_count_instead(bench: Bench, tmp_path: Path) -> None:
    text = ROBOT.replace(
        'object = "0x2003:0"', 'object = "0x2003:0"\nlive = true\nstates = ["operation enabled"]'
    )
    with serving(config(tmp_path, text)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        client.call("parameter.write", changes={"gait.toe_height": 0.09})
        bench.left.set_state(DISABLED)
        error = client.refused("parameter.write", changes={"gait.toe_height": 0.08})
        assert "switch on disabled; this parameter may be written in: operation enabled" in str(error)


# All or nothing

CHANGES = {"gait.step_length": 0.38, "gait.cycle_time": 1.1, "left_knee.max_torque": 50}


@pytest.fixture
def standing(writer: Client, bench: Bench) -> Client:
    """A writer of a robot whose drives are off, so that everything may be written."""
    bench.left.set_state(DISABLED)
    bench.right.set_state(DISABLED)
    return writer


def test_write_is_reverted_when_the_third_object_aborts(standing: Client, bench: Bench) -> None:
    def refuse(index: int, data: bytes) -> None:
        raise DeviceAbort("0x6072:0: the value is too high", 0x0609_0031)

    bench.left.node.before_download = refuse
    error = standing.refused("parameter.write", changes=CHANGES)
    assert error.kind == "rolled_back"
    assert error.data["abort_code"] == 0x0609_0031
    assert (error.data["component"], error.data["object"]) == ("left_knee", "0x6072:0")
    assert error.data["outcome"] == {
        "gait.step_length": "taken back",
        "gait.cycle_time": "taken back",
        "left_knee.max_torque": "unchanged",
    }
    # In reverse order, and verified.
    assert bench.gait.node.written() == [
        (STEP, u16(380)),
        (CYCLE, u16(1100)),
        (CYCLE, u16(1200)),
        (STEP, u16(400)),
    ]
    assert bench.gait.node.log[-1] == ("upload", STEP, None)


def test_what_becomes_smaller_is_written_first(standing: Client, bench: Bench) -> None:
    """A speed or a torque is limited before anything grows."""
    standing.call("parameter.write", changes={"gait.step_length": 0.42, "gait.cycle_time": 1.1})
    assert bench.gait.node.written() == [(CYCLE, u16(1100)), (STEP, u16(420))]


def test_an_abort_of_the_only_change_is_told_as_itself(standing: Client, bench: Bench) -> None:
    def refuse(index: int, data: bytes) -> None:
        raise DeviceAbort("0x2001:0: a general error", 0x0800_0000)

    bench.gait.node.before_download = refuse
    error = standing.refused("parameter.write", changes={"gait.step_length": 0.42})
    assert (error.kind, error.data["abort_code"]) == ("device_abort", 0x0800_0000)
    assert error.data["outcome"] == {"gait.step_length": "unchanged"}


def test_a_write_that_nobody_knows_about_is_taken_back(standing: Client, bench: Bench) -> None:
    """The download times out although the device took the value."""

    def lose_the_answer(index: int, data: bytes) -> None:
        if data == u16(420):
            bench.gait.node.objects[index, 0] = data
            raise DeviceTimeout("no answer")

    bench.gait.node.before_download = lose_the_answer
    error = standing.refused("parameter.write", changes={"gait.step_length": 0.42})
    assert error.kind == "rolled_back"
    assert bench.gait.node.objects[STEP, 0] == u16(400)


def test_what_a_device_stores_differently_is_taken_back(standing: Client, bench: Bench) -> None:
    bench.gait.node.store = lambda index, data: u16(419) if data == u16(420) else data
    error = standing.refused("parameter.write", changes={"gait.step_length": 0.42})
    assert error.kind == "rolled_back"
    assert "the device holds a3 01" in str(error)
    assert bench.gait.node.objects[STEP, 0] == u16(400)


def test_a_device_that_ignores_writes_is_a_mismatch(standing: Client, bench: Bench) -> None:
    bench.gait.node.store = lambda index, data: u16(400)
    error = standing.refused("parameter.write", changes={"gait.step_length": 0.42})
    assert error.kind == "mismatch"


def test_a_node_lost_in_mid_write_is_told_loudly(standing: Client, bench: Bench) -> None:
    def lose(index: int, data: bytes) -> None:
        def gone(index: int) -> None:
            raise Unavailable("bus main is not open")

        bench.gait.node.before_upload = gone
        raise Unavailable("bus main is not open")

    bench.gait.node.before_download = lose
    error = standing.refused("parameter.write", changes=CHANGES)
    assert error.kind == "rollback_failed"
    assert "could not be taken back: gait.step_length" in str(error)
    assert error.data["outcome"]["gait.step_length"].startswith("unknown: ")
    assert error.data["outcome"]["gait.cycle_time"] == "not written"


def test_a_roll_back_that_fails_goes_on_with_the_others(standing: Client, bench: Bench) -> None:
    def refuse_torque(index: int, data: bytes) -> None:
        raise DeviceAbort("no", 0x0800_0000)

    def refuse_old_cycle(index: int, data: bytes) -> None:
        if data == u16(1200):
            raise DeviceAbort("no", 0x0800_0000)

    bench.left.node.before_download = refuse_torque
    bench.gait.node.before_download = refuse_old_cycle
    error = standing.refused("parameter.write", changes=CHANGES)
    assert error.kind == "rollback_failed"
    assert bench.gait.node.objects[STEP, 0] == u16(400)
    assert bench.gait.node.objects[CYCLE, 0] == u16(1100)


def test_what_cannot_be_read_first_is_not_written(standing: Client, bench: Bench) -> None:
    def fail(index: int) -> None:
        raise DeviceTimeout("node 2 does not answer")

    bench.left.node.before_upload = fail
    error = standing.refused("parameter.write", changes=CHANGES)
    assert (error.kind, error.data["component"]) == ("device_timeout", "left_knee")
    assert str(error).endswith("; nothing was written"), "the other device's: was it written?"
    assert bench.gait.node.written() == []


def test_a_stop_interrupts_a_write_which_is_taken_back(standing: Client, bench: Bench) -> None:
    began: Future[None] = Future()
    go_on: Future[None] = Future()

    def wait(index: int, data: bytes) -> None:
        if index == STEP and not began.done():
            began.set_result(None)
            go_on.result(WAIT_S)

    bench.gait.node.before_download = wait
    write = standing.request("parameter.write", changes=CHANGES)
    began.result(WAIT_S)
    assert standing.call("robot.stop", reason="test")["held"]
    go_on.set_result(None)
    with pytest.raises(Exception, match="the robot was stopped before this was written") as caught:
        standing.answer(write)
    error: Any = caught.value
    assert error.kind == "rolled_back"
    assert bench.gait.node.objects[STEP, 0] == u16(400)
    assert (
        standing.call("parameter.write", changes={"gait.step_length": 0.41})["after"]["gait.step_length"]
        == 0.41
    )


def test_a_parameter_of_an_absent_device_is_unavailable(client: Client, bench: Bench) -> None:
    bench.absent["gait"] = (ComponentKind.DEVICE, "gait.eds is broken")
    client.call("control.acquire", ttl_s=60)
    error = client.refused("parameter.write", changes={"gait.step_length": 0.42})
    assert error.kind == "unavailable"
    assert "gait.eds is broken" in str(error)
    value = client.call("parameter.read", names=["gait.step_length"])["values"]["gait.step_length"]
    assert (value["value"], "gait.eds is broken" in value["problem"]) == (None, True)
    infos = {one["name"]: one for one in client.call("robot.describe")["parameters"]}
    assert infos["gait.step_length"]["problem"] == "gait.eds is broken"


# Values and bytes


def parameter(object_: str, **settings: Any) -> Parameter:
    description = eds.load(eds.locate("joint_drive.eds", None), 1)
    given = ParameterSettings(object=object_, **settings)
    return described("knee.x", given, {"knee": description}, {})


@pytest.mark.parametrize(
    ("object_", "scale", "value", "data"),
    [
        ("0x6072:0", 0.1, 100.0, "e8 03"),  # UNSIGNED16
        ("0x6072:0", 0.1, 99.96, "e8 03"),
        ("0x605A:0", 1.0, -1, "ff ff"),  # INTEGER16
        ("0x6081:0", 0.001, 4_000_000.0, "00 28 6b ee"),  # UNSIGNED32
    ],
)
def test_values_as_bytes(object_: str, scale: float, value: float, data: str) -> None:
    one = parameter(object_, scale=scale)
    assert one.problem is None
    assert one.coding.encode(value).hex(" ") == data


@pytest.mark.parametrize(
    ("object_", "value", "kind"),
    [
        ("0x6072:0", 65536, "out_of_limit"),
        ("0x6072:0", -1, "out_of_limit"),
        ("0x6041:0", 1, "read_only"),
        ("0x7FFF:0", 1, "unavailable"),
        ("0x1008:0", 1, "unavailable"),
    ],
)
def test_what_cannot_be_written_is_named(object_: str, value: float, kind: str) -> None:
    with pytest.raises(RpcError) as caught:
        parameter(object_).encode(value)
    assert caught.value.kind == kind
    assert "knee.x" in str(caught.value)


SCALED = [parameter("0x6072:0", scale=scale) for scale in (0.001, 0.01, 0.1, 1.0, 0.0174532925)]


@given(st.integers(0, 1000), st.sampled_from(SCALED))
def test_what_the_device_holds_is_written_back_unchanged(counts: int, one: Parameter) -> None:
    value = one.decode(u16(counts))
    assert one.coding.encode(value) == u16(counts)


def test_the_stricter_of_file_and_eds_wins() -> None:
    description = eds.load(eds.locate("gait_controller.eds", None), 16)
    wide = ParameterSettings(object="0x2001:0", scale=0.001, min=0.0, max=9.0)
    narrow = ParameterSettings(object="0x2001:0", scale=0.001, min=0.3, max=0.5)
    turned = ParameterSettings(object="0x2001:0", scale=-0.001)
    settings = {"gait.a": wide, "gait.b": narrow, "gait.c": turned}
    found = {name: described(name, one, {"gait": description}, {}) for name, one in settings.items()}
    assert (found["gait.a"].min, found["gait.a"].max) == (0.2, 0.6)
    assert (found["gait.b"].min, found["gait.b"].max) == (0.3, 0.5)
    assert (found["gait.c"].min, found["gait.c"].max) == (-0.6, -0.2)
