"""What each rule looks at on a robot, and that a sample of it comes to the rule."""

import time
from typing import Any

import pytest

from drivers.component import ComponentKind
from gateway.config.guard import WATCHES
from gateway.guard.watcher import RuleState as Found
from tests.unit.guard.bench import JOINT, Bench, Part

HEAT = {"rated": 1.0, "time_constant_s": 1.0}
SIDES = {"left": "left_knee", "right": "left_hip", "quantity": "position", "above": 0.1}
BRAKE = {"max": 2.0, "deceleration": 5.0}


@pytest.mark.parametrize(
    ("watch", "keys", "inputs"),
    [
        ("node_lost", {}, ["left_knee", "left_hip", "gait"]),
        ("emcy", {}, ["left_knee", "left_hip", "gait"]),
        ("following_error", {"above": 1.0}, ["left_knee.following_error", "left_hip.following_error"]),
        ("current", {"above": 1.0}, ["left_knee.current", "left_hip.current"]),
        ("torque", {"above": 1.0}, ["left_knee.torque", "left_hip.torque"]),
        ("i2t", HEAT, ["left_knee.current", "left_hip.current"]),
        ("i2t", {**HEAT, "of": "torque"}, ["left_knee.torque", "left_hip.torque"]),
        ("temperature", {"above": 1.0}, ["left_knee.temperature", "left_hip.temperature"]),
        ("joint_limit", {"max": 1.0}, ["left_knee.position", "left_hip.position"]),
        ("tilt", {"above": 1.0}, ["trunk.tilt_forward", "trunk.tilt_side"]),
        ("tilt_rate", {"above": 1.0}, ["trunk.angular_velocity_x", "trunk.angular_velocity_y"]),
        ("insole_stale", {}, ["left_insole", "right_insole"]),
        ("sdo_latency", {"above": 0.1}, ["left_knee", "left_hip", "gait"]),
        (
            "digital_input",
            {"must_be_clear": [16]},
            ["left_knee.digital_inputs", "left_hip.digital_inputs"],
        ),
        ("voltage", {"min": 40.0}, ["left_knee.voltage", "left_hip.voltage"]),
        ("velocity", {"above": 1.0}, ["left_knee.velocity", "left_hip.velocity"]),
        ("stopping_distance", BRAKE, ["left_knee", "left_hip"]),
        ("drift_while_held", {"above": 0.1}, ["left_knee.position", "left_hip.position"]),
        ("asymmetry", SIDES, ["left_knee and left_hip"]),
        ("bus", {}, ["main", "other"]),
        ("bus", {"on": ["o*"]}, ["other"]),
        ("sync_lost", {"period_s": 0.01}, ["main", "other"]),
    ],
)
def test_a_rule_looks_at_what_it_is_called_by(
    bench: Bench, watch: str, keys: dict[str, Any], inputs: list[str]
) -> None:
    assert [one.what for one in bench.wire(watch, **keys).watchers] == inputs


def test_every_watch_is_tried_here() -> None:
    marks = test_a_rule_looks_at_what_it_is_called_by.pytestmark
    assert {case[0] for case in marks[0].args[1]} == set(WATCHES)


@pytest.mark.parametrize(
    ("watch", "keys", "quantity", "well", "over"),
    [
        ("torque", {"above": 2.0}, "torque", (2.0, -2.0), 2.01),
        ("torque", {"above": 2.0}, "torque", (0.0,), -2.01),
        ("joint_limit", {"max": 2.0}, "position", (2.0, -99.0), 2.01),
        ("joint_limit", {"min": -1.0}, "position", (-1.0, 99.0), -1.01),
        ("velocity", {"above": 2.0}, "velocity", (2.0, -2.0), -2.01),
        ("voltage", {"min": 40.0, "max": 56.0}, "voltage", (40.0, 56.0), 39.9),
        ("voltage", {"min": 40.0, "max": 56.0}, "voltage", (48.0,), 56.1),
        ("digital_input", {"must_be_clear": [16, 17]}, "digital_inputs", (0, 0xFFFC_FFFF), 0x0002_0000),
        ("digital_input", {"must_be_set": ["interlock"]}, "digital_inputs", (0x8, 0xFF), 0xFFFF_FFF7),
        ("digital_input", {"must_be_set": ["0x30"]}, "digital_inputs", (0x30,), 0x10),
    ],
)
def test_a_sample_of_it_trips_the_rule_between_open_and_close(
    bench: Bench, watch: str, keys: dict[str, Any], quantity: str, well: tuple[float, ...], over: float
) -> None:
    wiring = bench.wire(watch, on=["*_knee"], **keys)
    bench.knee.give(quantity, over)
    wiring.open()
    bench.hip.give(quantity, over)
    for value in well:
        bench.knee.give(quantity, value)
    assert not bench.changes
    bench.knee.give(quantity, over)
    assert [one.state for one in bench.changes] == [Found.TRIPPED]
    wiring.close()
    bench.knee.give(quantity, 0.0)
    assert len(bench.changes) == 1


def test_heat_trips_after_the_time_that_its_closed_form_takes(bench: Bench) -> None:
    """Twice the rated current for τ·ln(4/3) = 0.288 s."""
    wiring = bench.wire("i2t", rated=1.0, time_constant_s=1.0, on=["left_knee"])
    wiring.open()
    index, now_ns = bench.knee.quantities.index("current"), time.monotonic_ns()
    for at_ms in (0, 100, 200, 287):
        bench.knee.latest.update(now_ns + at_ms * 1_000_000, (index,), (-2.0,))
    assert not bench.changes
    bench.knee.latest.update(now_ns + 289_000_000, (index,), (-2.0,))
    assert [one.state for one in bench.changes] == [Found.TRIPPED]


def test_emergencies_and_reboots_come_to_their_rules(bench: Bench) -> None:
    emcy, lost = bench.wire("emcy", codes=["0x86"], on=["gait"]), bench.wire("node_lost", on=["gait"])
    life = bench.gait.node.life
    life.on_heartbeat(1, b"\x05")
    for wiring in (emcy, lost):
        wiring.open()
        wiring.watchers[0].look(1)
    life.on_emcy(2, bytes.fromhex("3081110000000000"))
    assert not bench.changes
    life.on_emcy(3, bytes.fromhex("1186210000000000"))
    assert bench.changes[0].reason.startswith("gait: 0x8611 following error")
    life.on_heartbeat(4, b"\x00")
    assert [one.reason for one in bench.changes[1:]] == ["gait: has booted anew"]
    for wiring in (emcy, lost):
        wiring.close()
    assert not life._listeners


@pytest.mark.parametrize(
    ("timeout_s", "silent_s", "lost_s"),
    [(0.25, None, 0.25), (0.25, 0.7, 0.7), (None, None, 2.0), (None, 0.7, 0.7)],
)
def test_a_node_is_lost_after_the_time_that_its_rule_its_heartbeat_or_its_table_says(
    bench: Bench, timeout_s: float | None, silent_s: float | None, lost_s: float
) -> None:
    keys = {} if silent_s is None else {"silent_s": silent_s}
    (watcher,) = bench.wire("node_lost", on=["left_knee"], **keys).watchers
    life, now_ns = bench.knee.node.life, 10_000_000_000
    life.timeout_s = timeout_s
    life.on_heartbeat(now_ns, b"\x05")
    watcher.look(now_ns)
    last_ns = now_ns + round(lost_s * 1e9)
    for after_ns, state in ((0, Found.WATCHING), (1, Found.TRIPPED)):
        watcher.look(last_ns + after_ns)
        assert watcher.state is state


@pytest.mark.parametrize("sign", ["heartbeat", "answer", "sample"])
def test_a_node_without_a_heartbeat_lives_by_whatever_it_sends(bench: Bench, sign: str) -> None:
    (watcher,) = bench.wire("node_lost", on=["left_knee"]).watchers
    life, now_ns = bench.knee.node.life, 10_000_000_000
    for name in ("heartbeat", "answer", "sample"):
        heard_ns = now_ns if name == sign else now_ns - 5_000_000_000
        if name == "heartbeat":
            life.heartbeat_ns = heard_ns
        elif name == "answer":
            life.heard_ns = heard_ns
        else:
            bench.knee.latest.updated_ns = heard_ns
    watcher.look(now_ns + 1_999_000_000)
    assert watcher.state is Found.WATCHING


def test_a_node_with_a_heartbeat_is_lost_without_it_whatever_else_it_sends(bench: Bench) -> None:
    (watcher,) = bench.wire("node_lost", on=["left_knee"]).watchers
    life, now_ns = bench.knee.node.life, 10_000_000_000
    life.timeout_s, life.heartbeat_ns, life.heard_ns = 0.25, now_ns, now_ns + 1_000_000_000
    watcher.look(now_ns + 1_000_000_000)
    assert watcher.state is Found.TRIPPED


@pytest.mark.parametrize(("silent_s", "lost_s"), [(None, 0.5), (0.2, 0.2)])
def test_an_insole_is_silent_after_the_time_that_its_rule_or_table_says(
    bench: Bench, silent_s: float | None, lost_s: float
) -> None:
    keys = {} if silent_s is None else {"silent_s": silent_s}
    (watcher,) = bench.wire("insole_stale", on=["left_*"], **keys).watchers
    now_ns = 10_000_000_000
    bench.foot.latest.updated_ns = now_ns
    for after_ns, state in ((0, Found.WATCHING), (1, Found.TRIPPED)):
        watcher.look(now_ns + round(lost_s * 1e9) + after_ns)
        assert watcher.state is state


@pytest.mark.parametrize(
    ("on", "problems"),
    [
        (None, []),
        (["left_*"], ["left_hip: has no temperature"]),
        (["left_hip"], ["left_hip: has no temperature"]),
    ],
)
def test_a_drive_without_the_channel_is_said_where_somebody_has_named_it(
    bench: Bench, on: list[str] | None, problems: list[str]
) -> None:
    bench.hip = Part("left_hip", ComponentKind.JOINT, JOINT[:-1])  # no temperature
    wiring = bench.wire("temperature", above=80.0, **({} if on is None else {"on": on}))
    for watcher in wiring.watchers:
        watcher.look(1)
    assert [one.reason for one in bench.changes] == problems


def test_a_rule_that_nobody_can_feed_and_a_component_that_is_not_there_are_said(bench: Bench) -> None:
    bench.knee = Part("left_knee", ComponentKind.JOINT, ("position",))
    bench.absent["left_hip"] = (ComponentKind.JOINT, "its EDS is broken")
    for watcher in bench.wire("temperature", above=80.0).watchers:
        watcher.look(1)
    assert [one.reason for one in bench.changes] == ["left_hip: is not there: its EDS is broken"]
    bench.changes.clear()
    bench.absent.clear()
    bench.hip = Part("left_hip", ComponentKind.JOINT, ("position",))
    for watcher in bench.wire("temperature", above=80.0).watchers:
        watcher.look(1)
    assert [one.reason for one in bench.changes] == ["the robot: has no temperature"]
