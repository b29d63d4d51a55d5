"""Every rule of the guard: a fault of the simulated robot trips it, and walking does not."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from gateway.config.guard import WATCHES
from gateway.guard.watcher import RuleState
from hil_sim.drive.power_state import Command, PowerState
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.gait.activity import Activity
from hil_sim.gait.timetable import Entry
from tests.scenario.watched import Watched

pytestmark = pytest.mark.timeout(600)

RULES = """
[guard.rule.lost]
watch = "node_lost"
on = ["left_*", "right_*"]

[guard.rule.controller_lost]
watch = "node_lost"
on = ["gait"]

[guard.rule.emergency]
watch = "emcy"
codes = ["0x23"]

[guard.rule.slow_sdo]
watch = "sdo_latency"
above = 0.1

[guard.rule.emergency_stop]
watch = "digital_input"
name = "emergency stop"
must_be_clear = [16]

[guard.rule.end_switch]
watch = "digital_input"
on = ["*_hip", "*_knee"]
must_be_clear = ["negative_limit_switch", "positive_limit_switch"]

[guard.rule.supply]
watch = "voltage"
min = 40.0
max = 56.0
hysteresis = 1.0

[guard.rule.following]
watch = "following_error"
above = 0.1

[guard.rule.current]
watch = "current"
above = 8.0

[guard.rule.torque]
watch = "torque"
above = 65.0

[guard.rule.fast]
watch = "velocity"
on = ["*_hip"]
above = 3.0

[guard.rule.heat]
watch = "i2t"
rated = 5.0
time_constant_s = 5.0
above = 0.9

[guard.rule.hot]
watch = "temperature"
above = 80.0

[guard.rule.limit]
watch = "joint_limit"
on = ["*_hip"]
min = -0.5
max = 0.9
hysteresis = 0.05

[guard.rule.braking]
watch = "stopping_distance"
on = ["*_hip"]
min = -0.5
max = 0.9
deceleration = 10.0
reaction_s = 0.02

[guard.rule.drift]
watch = "drift_while_held"
above = 0.05

[guard.rule.uneven]
watch = "asymmetry"
left = "left_hip"
right = "right_hip"
quantity = "position"
above = 0.12
window_s = 3.0

[guard.rule.limping]
watch = "asymmetry"
left = "left_insole"
right = "right_insole"
quantity = "force"
of = "mean"
above = 80.0
window_s = 8.0

[guard.rule.falling]
watch = "tilt"
above = 0.7

[guard.rule.falling_fast]
watch = "tilt_rate"
above = 1.5

[guard.rule.foot]
watch = "insole_stale"

[guard.rule.bus]
watch = "bus"
silent_s = 0.2

[guard.rule.sync]
watch = "sync_lost"
period_s = 0.01
tolerance_s = 0.02
"""


@pytest.fixture
def watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Watched:
    return Watched(tmp_path, monkeypatch, RULES)


@dataclass(frozen=True)
class Case:
    """A fault, and what it is called by the rule that it trips."""

    rule: str
    fault: str
    on: str | None
    says: str
    within_s: float = 2.0
    params: dict[str, Any] = field(default_factory=dict)
    after_s: float = 0.5


CASES = [
    Case("lost", "heartbeat_missing", "left_knee", "left_knee: silent for 0.2"),
    Case("controller_lost", "node_lost", "gait", "gait: silent for"),
    Case("emergency", "overcurrent", "right_hip", "right_hip: 0x2310 continuous overcurrent"),
    Case("slow_sdo", "sdo_late", "left_hip", "left_hip: answered after 0.3", params={"delay_ms": 300}),
    Case("slow_sdo", "sdo_silent", "gait", "gait: no answer"),
    Case("emergency_stop", "sto", "left_knee", "left_knee.digital_inputs: emergency stop, bit 16 set"),
    Case("end_switch", "limit_switch", "left_hip", "left_hip.digital_inputs: positive limit switch set"),
    Case("supply", "undervoltage", "left_hip", "left_hip.voltage: 38 V, below 40 V", params={"volts": 38}),
    Case("following", "following_error", "left_knee", "left_knee.following_error: "),
    Case("current", "following_error", "left_knee", "left_knee.current: "),
    Case("torque", "following_error", "left_knee", "left_knee.torque: "),
    Case("fast", "runaway", "right_hip", "right_hip.velocity: "),
    Case("heat", "following_error", "left_knee", "left_knee.current: ", 10.0, {"factor": 6}),
    Case("hot", "overtemperature", "left_hip", "left_hip.temperature: 8", 10.0),
    Case("limit", "runaway", "left_hip", "left_hip.position: ", params={"deg_per_s": 40}),
    Case("braking", "runaway", "left_hip", "left_hip: ", params={"deg_per_s": 40}),
    Case("uneven", "gait_asymmetry", None, "left_hip and right_hip: ", 10.0, after_s=4.0),
    Case("limping", "gait_asymmetry", None, "left_insole and right_insole: ", 20.0, {"impaired": 1}, 14.0),
    Case("foot", "sensor_unplugged", "left_insole", "left_insole: silent for 0.5"),
    Case("bus", "bus_cut", None, "main: no frame for 0.2"),
    Case("bus", "gateway_bus_off", None, "main: our CAN controller is bus off"),
    Case("sync", "sync_lost", None, "main: silent for 0.0"),
    Case("sync", "sync_lost", None, "main: ", 3.0, {"percent": 70}),
]


# One after another on one robot by day: each leaves the next to be seen. The bus goes last.
TOGETHER = ("foot", "end_switch", "supply", "following", "lost", "emergency", "sync", "bus")


def test_faults_that_come_one_after_another_trip_each_its_own_rule(watched: Watched) -> None:
    watched.run(0.5)
    assert watched.changes == []
    for rule in TOGETHER:
        case = next(case for case in CASES if case.rule == rule)
        assert watched.reasons(rule) == [], "what came before has not tripped it"
        watched.faults.begin(case.fault, case.on, params=case.params)
        assert watched.until(lambda: watched.reasons(rule), case.within_s), watched.changes  # noqa: B023
        assert watched.reasons(rule)[0].startswith(case.says)


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.rule}-{case.fault}")
def test_a_fault_trips_its_rule_which_says_what_it_saw(watched: Watched, case: Case) -> None:
    watched.run(case.after_s)
    assert watched.changes == []
    watched.faults.begin(case.fault, case.on, params=case.params)
    assert watched.until(lambda: watched.reasons(case.rule), case.within_s), watched.changes
    assert watched.reasons(case.rule)[0].startswith(case.says)


def send_inputs_by_pdo(robot: Exoskeleton) -> None:
    """TPDO4 of the drive carries 60FDh when it changes; its COB-ID makes it valid (CiA 301 §7.5.2.35)."""
    knee = robot.drives["left_knee"]
    knee.dictionary.write(0x1803, 1, (0x4000_0480 + knee.node_id).to_bytes(4, "little"))


@pytest.mark.parametrize(("prepare", "within_s"), [(send_inputs_by_pdo, 0.02), (lambda _robot: None, 0.3)])
def test_an_emergency_stop_is_seen_with_the_frame_that_brings_it_else_when_it_is_asked_for(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    prepare: Callable[[Exoskeleton], object],
    within_s: float,
) -> None:
    watched = Watched(tmp_path, monkeypatch, RULES, prepare)
    watched.run(1.03)
    watched.faults.begin("sto", "left_knee")
    assert watched.until(lambda: watched.reasons("emergency_stop"), within_s)


def test_what_would_come_to_rest_beyond_its_limit_is_seen_before_it_is_there(watched: Watched) -> None:
    watched.run(1.0)
    watched.faults.begin("runaway", "left_hip", params={"deg_per_s": 100})
    assert watched.until(lambda: watched.reasons("braking"), 2.0)
    assert not watched.reasons("limit")
    assert watched.simulated.drives["left_hip"].joint.position < 0.9
    assert watched.until(lambda: watched.reasons("limit"), 2.0), "and it would have got there"


def test_a_fall_is_seen_by_its_speed_and_by_where_it_ends(watched: Watched) -> None:
    watched.run(0.5)
    watched.simulated.follow([Entry(Activity.FALL)])
    assert watched.until(lambda: watched.reasons("falling_fast") and watched.reasons("falling"), 10.0)
    assert watched.reasons("falling")[0].startswith("trunk.tilt_forward: ")
    assert watched.reasons("falling_fast")[0].startswith("trunk.angular_velocity_y: ")


def test_a_joint_that_drifts_while_a_stop_is_held_is_said_again_and_again_until_it_rests(
    watched: Watched,
) -> None:
    knee = watched.simulated.drives["left_knee"]
    for drive in watched.simulated.drives.values():
        drive.power.do(Command.QUICK_STOP)
    watched.held = True
    watched.run(1.5)
    assert watched.reasons("drift") == []
    watched.faults.begin("drift", "left_knee", params={"deg_per_s": 2})
    assert watched.until(lambda: len(watched.reasons("drift")) == 3, 6.0)
    assert watched.reasons("drift")[0].startswith("left_knee.position: 0.05")
    watched.faults.clear()
    assert knee.power_state is PowerState.SWITCH_ON_DISABLED
    assert watched.until(lambda: watched.states()["drift"] is RuleState.CLEARED, 2.0)


def test_a_rule_is_blind_where_what_it_watches_stays_away_and_sees_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A silent node, a foot in no shoe, a trunk without power, a bus that is cut."""
    watched = Watched(tmp_path, monkeypatch, RULES.replace("window_s = 8.0", "window_s = 3.0"))
    watched.run(1.0)
    watched.faults.begin("bus_cut")
    for name in ("left_insole", "trunk"):
        watched.faults.begin("sensor_unplugged", name)
    seeing = {"lost", "controller_lost", "slow_sdo", "foot", "bus", "sync"}  # what is not heard is lost
    watched.run(4.0)
    states = watched.states()
    assert {states[name] for name in seeing} == {RuleState.TRIPPED}
    assert {name: state for name, state in states.items() if name not in seeing} == dict.fromkeys(
        states.keys() - seeing, RuleState.BLIND
    )
    watched.faults.clear()
    watched.run(5.0)
    after = watched.states()
    assert {name for name, state in after.items() if state in (RuleState.BLIND, RuleState.TRIPPED)} == set()


def test_every_rule_is_tripped_here() -> None:
    rules = tomllib.loads(RULES)["guard"]["rule"]
    assert {rule["watch"] for rule in rules.values()} == set(WATCHES)
    assert {case.rule for case in CASES} | {"drift", "falling", "falling_fast"} == set(rules)


@pytest.mark.parametrize(("seconds", "window_s"), [(6, 4.8), (600, 8.0)])
def test_walking_trips_nothing_and_nothing_is_blind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seconds: int, window_s: float
) -> None:
    rules = RULES.replace("window_s = 8.0", f"window_s = {window_s}")
    watched = Watched(tmp_path, monkeypatch, rules, send_inputs_by_pdo)
    watched.run(float(seconds))
    assert watched.changes == []
    assert set(watched.states().values()) == {RuleState.WATCHING}
    watched.run(0.03)  # between two answers to SDO
    watched.faults.begin("sto", "left_knee")
    assert watched.until(lambda: watched.reasons("emergency_stop"), 0.02), "a frame brings it"
