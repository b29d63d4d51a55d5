"""Every mistake that the simulator makes is found from outside, named, and mended by the right line first."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

import eds
from drivers.bus.interfaces.controller_state import BusState
from gateway.doctor.observations import BusFacts, Computer, IdentifierFrames, Observations, Samples
from gateway.doctor.report import status, well
from gateway.doctor.table import RULES, judged
from gateway.doctor.verdicts import Edit, Finding, Unknown, Write
from hil_sim.exoskeleton import JOINTS
from hil_sim.mistakes.registry import MISTAKES
from tests.unit.doctor.patient import Patient

WALK_S = 10.0

# mistake → rule, what it is about, and of the first fix so much as says it
EXPECTED = {
    "bit_rate": ("bit_rate", "[can.main]", "bitrate = 1000000"),
    "terminator": ("terminator", "[can.main]", "60 Ω"),
    "double_node_id": ("double_node_id", "[joint.left_knee]", "answers as 2"),
    "second_sdo_client": ("second_sdo_client", "[joint.left_knee]", "0x602"),
    "bus_load": ("bus_load", "[can.main]", "0x7F0"),
    "sync": ("sync", "[can.main]", "SYNC is silent"),
    "sync_slow": ("sync", "[can.main]", "gait.0x1006:0=10000"),
    "eds_product": ("eds_product", "[joint.left_ankle]", 'eds = "joint_drive.eds"'),
    "heartbeat": ("heartbeat", "[joint.right_ankle]", "right_ankle.0x1017:0=100"),
    "heartbeat_slow": ("heartbeat", "[joint.left_hip]", "heartbeat_timeout_s = 0.25"),
    "pdo_mapping": ("pdo_mapping", "[joint.right_hip]", "configure_pdos = true"),
    "mode": ("mode", "[joint.left_knee]", "left_knee.0x6060:0=8"),
    "current_limit": ("current_limit", "[joint.left_hip]", "left_hip.0x6073:0=3000"),
    "following_window": ("following_window", "[joint.right_knee]", "right_knee.0x6065:0=22755"),
    "reaction": ("reaction", "[joint.left_ankle]", "left_ankle.0x6007:0=3"),
    "coasting": ("reaction", "[joint.right_ankle]", "right_ankle.0x605A:0=2"),
    "latency_timer": ("latency_timer", "[insole.left_insole]", "echo 1 | sudo tee"),
    "clock": ("clock", "the robot's computer", "timedatectl set-ntp true"),
    "governor": ("governor", "the robot's computer", "echo performance"),
    "realtime": ("realtime", "the robot's computer", "gwrms install-service"),
    "txqueuelen": ("txqueuelen", "[can.main]", "ip link set sim txqueuelen 1000"),
    "gear": ("gear", "[joint.left_knee]", "gear_ratio = 100.0"),
    "counts": ("gear", "[joint.right_hip]", "counts_per_revolution = 4096.0"),
    "sign": ("sign", "[joint.right_knee]", "direction = 1"),
    "joints_swapped": ("sides", "left_knee and right_knee", "[joint.left_knee] node_id = 2"),
    "insoles_swapped": ("sides", "left_insole and right_insole", "[insole.left_insole] port ="),
    "zero": ("zero", "[joint.right_hip]", "[joint.right_hip] zero_offset ="),
    "velocity_unit": ("velocity_unit", "[joint.left_hip]", 'velocity_unit = "counts/s"'),
    "insole_scale": ("insole_scale", "[insole.left_insole]", "by 10"),
    "imu_axes": ("imu", "[imu.trunk]", 'axes = ["x", "y", "z"]'),
    "imu_frozen": ("imu", "[imu.trunk]", "restart it"),
}

# Those that are seen from devices alone are made in one robot, and those of sensors in another.
OF_DRIVES = (
    *("heartbeat", "heartbeat_slow", "pdo_mapping", "mode", "current_limit"),
    *("following_window", "reaction", "coasting"),
)
OF_SENSORS = ("insole_scale", "imu_frozen")
OF_BUS = ("bit_rate", "terminator", "double_node_id", "second_sdo_client", "bus_load", "sync", "sync_slow")
OF_FILE_OR_COMPUTER = tuple(name for name in EXPECTED if name not in (*OF_DRIVES, *OF_SENSORS, *OF_BUS))


def findings(seen: Observations) -> list[Finding]:
    return [one for one in judged(seen) if isinstance(one, Finding)]


def check(name: str, found: list[Finding]) -> None:
    rule, about, fix = EXPECTED[name]
    mine = [one for one in found if (one.rule, one.about) == (rule, about)]
    assert mine, found
    assert fix in mine[0].fixes[0].words
    assert mine[0].evidence


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Patient:
    return Patient(tmp_path_factory.mktemp("walker"), seconds=WALK_S)


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Patient:
    """With every mistake that drives alone show."""
    return Patient(tmp_path_factory.mktemp("drives"), OF_DRIVES)


def test_every_mistake_that_can_be_made_is_expected_and_every_rule_has_one() -> None:
    assert set(EXPECTED) == set(MISTAKES)
    assert {rule for rule, *_ in EXPECTED.values()} == {rule.name for rule in RULES} - {"component"}
    assert len(RULES) == 25 + 1


def test_a_healthy_robot_has_a_clean_bill(walker: Patient) -> None:
    verdicts = list(judged(walker.seen()))
    assert verdicts == []
    assert well(verdicts) == [rule.name for rule in RULES]
    assert status(verdicts) == 0


@pytest.mark.parametrize("name", OF_FILE_OR_COMPUTER)
def test_a_mistake_of_file_or_computer_is_found_with_the_right_fix_first(name: str, walker: Patient) -> None:
    found = findings(walker.seen(name))
    assert {one.rule for one in found} == {EXPECTED[name][0]}
    check(name, found)


@pytest.mark.parametrize("name", OF_BUS)
def test_a_mistake_on_the_bus_is_found_with_the_right_fix_first(name: str, tmp_path: Path) -> None:
    found = findings(Patient(tmp_path, [name], seconds=1.0, warm_s=1.0).seen())
    assert {one.rule for one in found} == {EXPECTED[name][0]}
    check(name, found)


def test_many_mistakes_of_drives_at_once_are_found_each_with_the_right_fix_first(drives: Patient) -> None:
    check_all(OF_DRIVES, findings(drives.seen()))


def test_many_mistakes_of_sensors_at_once_are_found_each_with_the_right_fix_first(tmp_path: Path) -> None:
    check_all(OF_SENSORS, findings(Patient(tmp_path, OF_SENSORS, WALK_S, warm_s=1.5).seen()))


def check_all(names: tuple[str, ...], found: list[Finding]) -> None:
    assert {(one.rule, one.about) for one in found} == {EXPECTED[name][:2] for name in names}
    for name in names:
        check(name, found)


def test_who_does_not_walk_is_not_called_well_where_walking_is_needed(tmp_path: Path) -> None:
    seen = Patient(tmp_path, warm_s=1.0).seen()
    verdicts = list(judged(seen))
    assert findings(seen) == []
    assert {one.rule for one in verdicts} >= {"gear", "sign", "sides", "zero", "insole_scale", "imu"}


def test_a_silent_robot_whose_devices_were_not_asked_is_not_called_well(walker: Patient) -> None:
    seen = walker.seen()
    sensors = {name: one for name, one in seen.samples.columns.items() if ".force" in name or "trunk" in name}
    verdicts = list(judged(replace(seen, objects={}, samples=replace(seen.samples, columns=sensors))))
    assert findings(replace(seen, objects={})) == []
    assert set(well(verdicts)) == {
        *("bit_rate", "terminator", "double_node_id", "second_sdo_client", "bus_load", "heartbeat", "sync"),
        *("imu", "latency_timer", "clock", "governor", "realtime", "txqueuelen"),
    }


def test_nothing_known_is_nothing_judged(walker: Patient) -> None:
    seen = walker.seen()
    nothing = Observations(seen.config, {}, {}, {}, Samples(), Computer())
    facts = BusFacts(3.0, {}, 0.0, None, 0.0, BusState.ACTIVE)
    for one in (nothing, replace(nothing, buses={"main": facts})):
        verdicts = list(judged(one))
        assert findings(one) == []
        assert well(verdicts) == []


def test_a_velocity_that_is_only_polled_now_and_then_is_no_other_unit(walker: Patient) -> None:
    seen = walker.seen()
    late = {
        name: tuple(column[at // 13 * 13] for at in range(len(column)))
        if name.endswith(".velocity")
        else column
        for name, column in seen.samples.columns.items()
    }
    assert findings(replace(seen, samples=replace(seen.samples, columns=late))) == []


def test_a_zero_is_not_judged_by_a_wrong_gear(walker: Patient) -> None:
    seen = walker.seen("zero")
    hip = seen.config.joint["right_hip"]
    joints = seen.config.joint | {"right_hip": structs.replace(hip, gear_ratio=110.0)}
    wrong = replace(seen, config=structs.replace(seen.config, joint=joints))
    assert {(one.rule, one.about) for one in findings(wrong)} == {("gear", "[joint.right_hip]")}


def test_a_heartbeat_is_not_proposed_slower_than_what_waits_for_it(walker: Patient) -> None:
    seen = walker.seen()
    joint = structs.replace(seen.config.joint["left_hip"], heartbeat_timeout_s=0.1)
    config = structs.replace(seen.config, joint=seen.config.joint | {"left_hip": joint})
    objects = {**seen.objects, "left_hip": {**seen.objects["left_hip"], (0x1017, 0): 0}}
    (found,) = findings(replace(seen, config=config, objects=objects))
    assert found.fixes[0].words.startswith("SDO: gwrms set left_hip.0x1017:0=40")


def test_what_is_to_be_written_is_told_in_its_parameters_unit(drives: Patient) -> None:
    window = replace(drives.seen(), units={"right_knee.0x6065:0": (math.tau / 409600, "rad")})
    (found,) = (one for one in findings(window) if one.rule == "following_window")
    assert "right_knee.0x6065:0=0.349057328283rad" in found.fixes[0].words
    assert "22755 of the device's own" in found.fixes[0].words
    assert "first add to robot.toml" not in found.fixes[0].words
    (other,) = (one for one in findings(replace(window, units={})) if one.rule == "following_window")
    assert "first add to robot.toml" in other.fixes[0].words


def test_a_node_that_no_table_has_is_told_and_no_mistake(walker: Patient) -> None:
    seen = walker.seen()
    heard = dict(seen.buses["main"].heard or {}) | {
        0x709: IdentifierFrames(3, 1.0),
        0x77F: IdentifierFrames(1, 0.0),
    }
    verdicts = list(judged(replace(seen, buses={"main": replace(seen.buses["main"], heard=heard)})))
    (told,) = verdicts
    assert isinstance(told, Unknown)
    assert (told.about, told.why.partition(" is heard")[0]) == ("[can.main]", "node 9, 127")


def test_what_a_driver_says_is_told_unless_another_finding_names_it_better(walker: Patient) -> None:
    problems = {"left_hip": "its position jumped", "left_knee": "gear_ratio is 50", "trunk": "it hangs"}
    for mistake, told in (("gear", {"[joint.left_hip]", "[imu.trunk]"}), ("txqueuelen", {"[imu.trunk]"})):
        seen = walker.seen(mistake)
        found = findings(replace(seen, samples=replace(seen.samples, problems=problems)))
        assert {one.about for one in found if one.rule == "component"} == told


ODD = {
    "nothing": (),
    "one value": (0.0,),
    "nothing known": (None,) * 500,
    "always 0": (0.0,) * 500,
    "always the same": (1.5,) * 500,
    "below 0": (-3.0,) * 500,
    "to and fro": (0.0, 1e9) * 250,
    "no number": (float("nan"),) * 500,
    "beyond all": (float("inf"), float("-inf")) * 250,
}


@pytest.mark.parametrize("odd", ODD)
def test_odd_values_are_judged_without_an_error_and_never_called_well(odd: str, walker: Patient) -> None:
    seen = walker.seen()
    for chosen, rule in (("left_knee", "gear"), ("", "sides")):
        columns = {
            name: ODD[odd] if chosen in name else column for name, column in seen.samples.columns.items()
        }
        verdicts = list(judged(replace(seen, samples=replace(seen.samples, columns=columns))))
        assert rule not in well(verdicts)


def test_without_what_the_drive_says_the_other_leg_shows_gear_and_zero(walker: Patient) -> None:
    for name in ("gear", "counts", "zero"):
        found = findings(replace(walker.seen(name), objects={}))
        assert [(one.rule, one.about) for one in found] == [EXPECTED[name][:2]]


def test_a_healthy_robot_of_vendors_drives_has_a_clean_bill(tmp_path: Path) -> None:
    files = {"hip": "elmo_gold.dcf", "knee": "trinamic_tmcm_1270.eds", "ankle": "joint_drive.eds"}
    drives = {name: eds.locate(files[name.partition("_")[2]], None) for name in JOINTS}
    assert findings(Patient(tmp_path, drives=drives, seconds=WALK_S).seen()) == []


def test_a_fix_of_a_file_says_what_stood_there() -> None:
    assert Edit("joint", "left_knee", "gear_ratio", 100.0, 50.0).words == (
        "robot.toml: [joint.left_knee] gear_ratio = 100.0   # was 50.0"
    )
    assert Write("left_knee", 0x6065, 0, 22755, 0xFFFF_FFFF).words == (
        "SDO: gwrms set left_knee.0x6065:0=22755   # was 4294967295"
    )


def test_a_write_that_the_file_does_not_release_comes_with_the_lines_that_do() -> None:
    said = Write("left_knee", 0x6065, 0, 22755, is_released=False).words
    assert '[parameter."left_knee.object_6065"]\n              object = "0x6065:0"\n' in said
    assert "stop first (gwrms stop)" in said
