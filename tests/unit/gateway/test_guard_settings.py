"""The guard's table: whatever cannot work is refused, in words, with the table and the key."""

from pathlib import Path

import pytest

from gateway.config import ConfigError, RobotConfig
from gateway.config.guard import limit
from gateway.config.guard_rules import Action, Blind, HeatRule, LevelRule
from tests.unit.gateway.harness import ROBOT, config

IMU = '[imu.trunk]\nport = "/dev/null-imu"\nbaudrate = 115200\nformat = "witmotion"\naxes = ["x", "y", "z"]\n'
SIDES = 'watch = "asymmetry", left = "left_knee", quantity = "position", above = 0.1'
OWN_NODE = ('channel = "unused"', 'channel = "unused"\nnode_id = 100')


def guarded(folder: Path, text: str, robot: str = ROBOT) -> RobotConfig:
    return config(folder, text + robot + IMU)


def rule(text: str) -> str:
    return "\n".join(["[guard.rule.one]", *text.split(", ")]) + "\n"


def test_without_the_table_there_is_no_guard(tmp_path: Path) -> None:
    assert config(tmp_path).guard is None


def test_rules_are_read_by_what_they_watch(tmp_path: Path) -> None:
    text = """
[guard]
[guard.rule.knee_hot]
watch = "i2t"
on = ["*_knee"]
rated = 5
time_constant_s = 20
actions = ["quick_stop", "alarm"]
blind = "act"
[guard.rule.falling]
watch = "tilt"
above = 0.6
"""
    guard = guarded(tmp_path, text).guard
    assert guard is not None
    hot, falling = guard.rule["knee_hot"], guard.rule["falling"]
    assert isinstance(hot, HeatRule)
    assert (hot.on, hot.above, hot.blind) == (("*_knee",), 1.0, Blind.ACT)
    assert hot.actions == (Action.QUICK_STOP, Action.ALARM)
    assert isinstance(falling, LevelRule)
    assert (falling.on, falling.actions, falling.blind) == (None, (Action.ALARM,), Blind.ALARM)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("guard = 5\n", ("[guard]: is a table",)),
        ("[guard]\nrule = 5\n", ("each of its rules", "[guard.rule.NAME]")),
        ("[guard]\n", ("neither heartbeat_ms nor", "watch nothing")),
        ("[guard]\nheart_ms = 5\n", ("heart_ms: is not known", "did you mean 'heartbeat_ms'")),
        ("[guard]\nheartbeat_ms = 9\n", ("[guard] heartbeat_ms", "at least 10")),
        ("[guard]\nheartbeat_ms = 20001\n", ("[guard] heartbeat_ms", "at most 20000")),
        ("[guard]\nheartbeat_ms = 100\n", ("heartbeat_ms", "[can.main] node_id: is missing")),
        (rule("above = 5"), ("[guard.rule.one] watch", "watch: is missing; allowed are", "joint_limit")),
        (rule('watch = "currant", above = 5'), ("[guard.rule.one] watch", "current")),
        (rule("watch = [1], above = 5"), ("[guard.rule.one] watch",)),
        ("[guard.rule]\none = 5\n", ("[guard.rule.one]",)),
        ('[guard.rule."a b"]\nwatch = "emcy"\n', ("[guard.rule.a b]", "a name is a letter")),
        ('[guard.rule.alarms]\nwatch = "emcy"\n', ("'alarms' is taken by the guard itself",)),
        (rule('watch = "current"'), ("[guard.rule.one] above: is missing",)),
        (rule('watch = "current", above = "5"'), ("[guard.rule.one] above", "must be a number")),
        (rule('watch = "current", above = 0'), ("[guard.rule.one] above", "above 0")),
        (rule('watch = "current", above = inf'), ("[guard.rule.one] above: inf is no finite number",)),
        (rule('watch = "current", above = nan'), ("[guard.rule.one] above",)),
        (rule('watch = "current", above = 5, for_s = -1'), ("[guard.rule.one] for_s", "at least 0")),
        (rule('watch = "current", above = 5, clear_s = 0'), ("[guard.rule.one] clear_s", "above 0")),
        (rule('watch = "current", above = 5, hysteresis = 5'), ("hysteresis", "never be over")),
        (rule('watch = "current", above = 5, min = 1'), ("min: is not known", "above")),
        (rule('watch = "joint_limit"'), ("min, max: one of them or both",)),
        (rule('watch = "joint_limit", min = 1, max = 1'), ("min", "nothing lies between")),
        (rule('watch = "joint_limit", min = 1, max = 2, hysteresis = 0.5'), ("nothing lies between",)),
        (rule('watch = "joint_limit", min = -inf'), ("min: -inf is no finite number",)),
        (rule('watch = "i2t", rated = 5'), ("time_constant_s: is missing",)),
        (rule('watch = "i2t", rated = 5, time_constant_s = 1, of = "power"'), ("of",)),
        (rule('watch = "i2t", rated = 5, time_constant_s = 1, hysteresis = 1'), ("never be over",)),
        (rule('watch = "emcy", codes = []'), ("[guard.rule.one] codes",)),
        (rule('watch = "emcy", codes = ["2310"]'), ("[guard.rule.one] codes",)),
        (rule('watch = "emcy", codes = ["0x23100"]'), ("[guard.rule.one] codes",)),
        (rule('watch = "emcy", codes = ["0x00"]'), ("codes: 0x00 says that an error is over",)),
        (rule('watch = "emcy", actions = []'), ("[guard.rule.one] actions",)),
        (rule('watch = "emcy", actions = ["stop"]'), ("[guard.rule.one] actions", "stop")),
        (rule('watch = "emcy", blind = "ignore"'), ("[guard.rule.one] blind", "ignore")),
        (rule('watch = "emcy", on = []'), ("[guard.rule.one] on",)),
        (rule('watch = "emcy", on = ["left_nee"]'), ("on: 'left_nee' is no joint or device", "left_knee")),
        (rule('watch = "tilt", above = 1, on = ["left_knee"]'), ("'left_knee' is no imu", "trunk")),
        (rule('watch = "node_lost", silent_s = 0'), ("[guard.rule.one] silent_s", "above 0")),
        (rule('watch = "digital_input", name = "STO"'), ("must_be_set, must_be_clear: one",)),
        (
            rule('watch = "digital_input", must_be_set = []'),
            ("must_be_set, must_be_clear: one",),
        ),
        (rule('watch = "digital_input", must_be_set = ["0x0"]'), ("with a bit: it could never trip",)),
        (rule('watch = "digital_input", must_be_set = [32]'), ("[guard.rule.one] must_be_set", "at most 31")),
        (rule('watch = "digital_input", must_be_set = [-1]'), ("[guard.rule.one] must_be_set", "at least 0")),
        (rule('watch = "digital_input", must_be_set = ["lock"]'), ("must_be_set", "interlock")),
        (
            rule('watch = "digital_input", must_be_set = ["interlock"], must_be_clear = ["0xC"]'),
            ("[guard.rule.one] must_be_clear: interlock must be set too: it would never be over",),
        ),
        (rule('watch = "voltage"'), ("min, max: one of them or both",)),
        (rule('watch = "voltage", above = 60'), ("above: is not known", "max")),
        (rule('watch = "stopping_distance", max = 1'), ("deceleration: is missing",)),
        (rule('watch = "stopping_distance", deceleration = 5'), ("min, max: one of them or both",)),
        (rule('watch = "stopping_distance", deceleration = 0, max = 1'), ("deceleration", "above 0")),
        (rule('watch = "stopping_distance", deceleration = inf, max = 1'), ("no finite number",)),
        (rule('watch = "bus", on = ["left_knee"]'), ("on: 'left_knee' is no bus", "here are main")),
        (rule('watch = "sync_lost"'), ("period_s: is missing",)),
        (rule('watch = "sync_lost", period_s = 0.01, can_id = 0'), ("can_id", "at least 1")),
        (rule('watch = "asymmetry", left = "a", right = "b", above = 1'), ("quantity: is missing",)),
        (rule(f'{SIDES}, right = "left_knee"'), ("right: 'left_knee' is its left too",)),
        (
            rule(f'{SIDES}, right = "right_nee"'),
            ("right: 'right_nee' is no joint, which has a position", "right_knee"),
        ),
        (rule(f'{SIDES}, right = "left_insole"'), ("right: 'left_insole' is no joint",)),
        (rule(f'{SIDES}, right = "right_knee", on = ["*"]'), ("on: asymmetry watches its left and right",)),
        (rule(f'{SIDES}, right = "right_knee", hysteresis = 1'), ("hysteresis", "never be over")),
        (rule(f'{SIDES.replace("position", "place")}, right = "right_knee"'), ("quantity", "load_share")),
        (rule('watch = "drift_while_held", above = 0.1, for_s = 1'), ("for_s: is not known",)),
        (rule('watch = "sdo_latency", above = 0.1, hysteresis = 0.1'), ("never be over",)),
        (rule('watch = "emcy", actions = ["hold"]'), ("[guard.rule.one] actions", "hold")),
        (IMU.replace("trunk", "guard").replace("-imu", "-2"), ("'guard' is taken by the gateway itself",)),
    ],
)
def test_what_cannot_work_is_refused(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError) as caught:
        guarded(tmp_path, text)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(("on", "refused"), [("", True), ('on = ["m*"]', True), ('on = ["other"]', False)])
def test_our_own_sync_is_nothing_that_can_be_lost(tmp_path: Path, on: str, refused: bool) -> None:
    ours = ROBOT.replace("port = 0", 'port = 0\nrole = "master"').replace(
        'channel = "unused"', 'channel = "unused"\nsync_period_s = 0.01'
    )
    text = rule('watch = "sync_lost", period_s = 0.01') + on + "\n"
    robot = ours + '[can.other]\ninterface = "virtual"\nchannel = "other"\n'
    if refused:
        with pytest.raises(ConfigError, match=r"the SYNC of \[can.main\] is ours \(sync_period_s\)"):
            guarded(tmp_path, text, robot)
    else:
        assert guarded(tmp_path, text, robot).guard is not None
    assert guarded(tmp_path, text, robot.replace("master", "observer")).guard is not None


def test_a_rule_for_what_the_robot_does_not_have_is_refused(tmp_path: Path) -> None:
    robot = ROBOT.replace('[insole.left_insole]\nport = "/dev/null-left"\n', "")
    with pytest.raises(ConfigError, match="insole_stale watches each insole, and this robot has none"):
        guarded(tmp_path, rule('watch = "insole_stale"'), robot)


def test_a_bus_has_one_heartbeat_of_ours(tmp_path: Path) -> None:
    robot = ROBOT.replace(*OWN_NODE)
    assert guarded(tmp_path, "[guard]\nheartbeat_ms = 100\n", robot).guard is not None
    both = robot.replace("node_id = 100", "node_id = 100\nheartbeat_s = 0.5")
    with pytest.raises(ConfigError, match=r"\[can.main\] heartbeat_s: the guard's heartbeat_ms"):
        guarded(tmp_path, "[guard]\nheartbeat_ms = 100\n", both)


def test_nobody_to_arm_is_refused(tmp_path: Path) -> None:
    robot = '[robot]\nname = "x"\n[can.main]\ninterface = "virtual"\nchannel = "unused"\n'
    with pytest.raises(ConfigError, match="there is no joint whose drive could be armed"):
        guarded(tmp_path, "[guard]\nheartbeat_ms = 100\n", robot)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('watch = "current", above = 5, for_s = 0.5', "above 5 A for 0.5 s"),
        ('watch = "joint_limit", min = -0.1', "below -0.1 rad"),
        ('watch = "joint_limit", min = -0.1, max = 2, for_s = 1', "below -0.1 rad or above 2 rad for 1 s"),
        (
            'watch = "i2t", of = "torque", rated = 40, time_constant_s = 8',
            "mean of (torque / 40 N·m)² over 8 s above 1",
        ),
        ('watch = "node_lost"', "silent"),
        ('watch = "insole_stale", silent_s = 0.2', "silent for 0.2 s"),
        ('watch = "emcy"', "any EMCY"),
        ('watch = "velocity", above = 3', "above 3 rad/s"),
        ('watch = "voltage", min = 40, max = 56', "below 40 V or above 56 V"),
        ('watch = "sdo_latency", above = 0.1', "above 0.1 s"),
        ('watch = "digital_input", must_be_clear = [16]', "bit 16 set"),
        (
            'watch = "digital_input", name = "stop", must_be_set = ["interlock"; 17], for_s = 0.1',
            "stop, interlock, bit 17 clear for 0.1 s",
        ),
        (
            'watch = "digital_input", must_be_set = ["home_switch"], must_be_clear = ["0x3"]',
            "home switch clear; negative limit switch, positive limit switch set",
        ),
        (
            'watch = "stopping_distance", max = 1, deceleration = 5, reaction_s = 0.1',
            "at rest only above 1 rad, braking by 5 rad/s² after 0.1 s",
        ),
        ('watch = "drift_while_held", above = 0.1', "moved more than 0.1 rad, from 1 s after a stop on"),
        ('watch = "bus"', "error passive, bus off, gone, or silent for 0.5 s"),
        ('watch = "sync_lost", period_s = 0.01', "no SYNC for 0.06 s"),
        (
            f'{SIDES.replace("0.1", "80")}, right = "right_knee", of = "mean"',
            "mean of position over 5 s differs by more than 80 rad",
        ),
        ('watch = "emcy", codes = ["0x2"; "0x43"]', "EMCY 0x2, 0x43"),
    ],
)
def test_a_rule_says_what_makes_it_trip(tmp_path: Path, text: str, words: str) -> None:
    guard = guarded(tmp_path, rule(text).replace(";", ",")).guard
    assert guard is not None
    assert limit(guard.rule["one"]) == words
