"""Scenario files: what they may say, and how expectations are judged."""

import tomllib
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from hil_sim.clock import SECOND_NS
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import Scenario
from hil_sim.robot import SimulatedRobot
from hil_sim.scenario.expectation import Expectation, Moment, Seen, Track, Verdict
from hil_sim.scenario.runner import schedule
from hil_sim.scenario.script import Script, examined, load
from hil_sim.scenario.table import ScenarioError

FOLDER = Path(__file__).parents[3] / "scenarios"


def script(tmp_path: Path, text: str) -> Script:
    file = tmp_path / "one.toml"
    file.write_text(text, encoding="utf-8")
    return load(file)


def expect(tmp_path: Path, text: str) -> Expectation:
    (one,) = script(tmp_path, f"[[expect]]\n{text}").expectations
    return one


def judge(one: Expectation, **series: Sequence[tuple[float, Seen]]) -> Verdict:
    """The verdict on what was seen of names whose dots are written as __."""
    moments = sorted(
        (
            Moment(time_s, {name.replace("__", "."): value})
            for name, seen in series.items()
            for time_s, value in seen
        ),
        key=lambda moment: moment.time_s,
    )
    return one.judge({one.track: moments})


# -- files


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.toml")), ids=lambda file: file.stem)
def test_every_scenario_in_the_tree_can_be_read_and_explains_itself(file: Path) -> None:
    found = load(file)
    assert found.title != file.stem
    assert found.expectations
    assert any(line.startswith("# ") for line in file.read_text(encoding="utf-8").splitlines())


def test_an_empty_file_is_a_walking_robot(tmp_path: Path) -> None:
    found = script(tmp_path, "")
    assert (found.title, found.scenario, found.seed, found.lines) == ("one", Scenario.WALK, 0, ())


def test_a_scenario_lasts_a_second_longer_than_the_last_time_it_names(tmp_path: Path) -> None:
    assert script(tmp_path, '[[at]]\ntime_s = 7\nactivity = "sit"').seconds == 8
    text = '[[expect]]\ncomponent = "*"\nstate = "ok"\n'
    assert script(tmp_path, text + "within_s = [3, 9.5]").seconds == 10.5
    assert script(tmp_path, text + "at_s = 3").seconds == 4
    assert script(tmp_path, "[robot]\nseconds = 60").seconds == 60


def test_a_scenario_may_say_how_its_wearer_walks(tmp_path: Path) -> None:
    assert script(tmp_path, "").walks == "ordinary"
    assert script(tmp_path, '[robot]\nwalks = "steppage"').walks == "steppage"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x", "one.toml: this is no TOML"),
        ("colour = 1", r"one.toml: \[colour\]: is not known: allowed are at, expect, guard, robot, title"),
        ("robot = 1", r"one.toml: \[robot\]: this must be a table"),
        ("[robot]\nspeed = 1", r"\[robot\] speed: is not known: did you mean 'seed'"),
        ('[robot]\nscenario = "swim"', "scenario: 'swim' is not known: allowed are walk, stand"),
        ('[robot]\nwalks = "crouched"', "walks: 'crouched' is not known: did you mean 'crouch'"),
        ('[robot]\nseed = "x"', "seed: 'x' must be a whole number"),
        ('[robot]\nimu = "x"', "imu: 'x' is not known: allowed are bno08x-rvc, microstrain"),
        ('[robot]\nseconds = 1\n[[at]]\ntime_s = 2\nactivity = "sit"', "seconds: 1 ends before something"),
        ("[at]\ntime_s = 2", r"\[at\]: is a list of tables: write \[\[at\]\]"),
        ('[[at]]\nactivity = "sit"', r"\[\[at\]\] number 1 time_s: is missing"),
        ('[[at]]\ntime_s = -1\nactivity = "sit"', "time_s: -1 is no time"),
        ("[[at]]\ntime_s = 1", r"\[\[at\]\] number 1: say one of fault, clear, activity"),
        ('[[at]]\ntime_s = 1\nfault = "nod_lost"', "did you mean 'node_lost'"),
        ('[[at]]\ntime_s = 1\nfault = "bus_load"\npercent = 3', "percent: is not known: allowed are fault"),
        (
            '[[at]]\ntime_s = 1\nfault = "bus_load"\nparams = { percent = 300 }',
            "percent = 300 is not possible",
        ),
        ('[[at]]\ntime_s = 1\nstop = "x"\nactivity = "sit"', "activity: is not known"),
        ("[[at]]\ntime_s = 1\nstop = 1", "stop: 1 must be a text"),
        ("[[at]]\ntime_s = 1\nset = {}", "is what it looks like"),
        (
            '[[expect]]\nstate = "ok"\nat_s = 1',
            "exactly one of component, channel, truth, answer, rule, not none",
        ),
        ('[[expect]]\ncomponent = "x"\nchannel = "y"\nat_s = 1', "not component and channel"),
        ('[[expect]]\ncomponent = "x"\nat_s = 1', "say what is expected of x with state, problem"),
        ('[[expect]]\ncomponent = "x"\nmin = 1\nat_s = 1', "min: is not known"),
        ('[[expect]]\ntruth = "x"\nmissing = true\nat_s = 1', "missing: is not known"),
        ('[[expect]]\ncomponent = "x"\nstate = "ok"', "exactly one of at_s, within_s, between_s, not none"),
        ('[[expect]]\ncomponent = "x"\nstate = "ok"\nwithin_s = 3', "within_s: 3 is no window"),
        ('[[expect]]\ncomponent = "x"\nstate = "ok"\nwithin_s = [4, 3]', "ends before it begins"),
        ('[[expect]]\ncomponent = "x"\nstate = "ok"\nwithin_s = [1, "x"]', "within_s: 'x' is no time"),
        ('[[expect]]\nchannel = "x"\nmin = "1"\nat_s = 1', "min: '1' must be a number"),
        ('[[expect]]\nchannel = "x"\nmissing = 1\nat_s = 1', "missing: 1 must be true or false"),
        ('[[expect]]\nchannel = "x"\nis = 1\nat_s = 1', "is: 1 must be a text"),
        ('[[expect]]\nrule = "hot"\nstate = "ok"\nat_s = 1', "state: is not known: allowed are"),
        ('[[expect]]\nrule = "hot"\nat_s = 1', "say what is expected of hot with tripped, reason, stop"),
        ('[[expect]]\nrule = "hot"\ntripped = 1\nat_s = 1', "tripped: 1 must be true or false"),
        ("guard = 1", r"\[guard\]: this must be a table"),
        ("[guard]\nrule = 1", r"\[guard\] rule: 1 must be a table"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        script(tmp_path, text)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none\.toml: cannot be read: No such file"):
        load(tmp_path / "none.toml")


# -- expectations

WORDS = ((1.0, "ok"), (2.0, "stale"), (3.0, "lost"), (4.0, "ok"))
STATE = 'component = "knee"\nstate = "{}"\n'


@pytest.mark.parametrize(
    ("text", "ok", "seen"),
    [
        (STATE.format("lost") + "within_s = [1, 4]", True, "knee was 'lost' at 3.00 s"),
        (
            STATE.format("lost") + "within_s = [1, 2.5]",
            False,
            "knee was 'ok' at 1.00 s, then 'stale' at 2.00 s",
        ),
        (STATE.format("stale") + "at_s = 1.5", True, "knee was 'stale' at 2.00 s"),
        (STATE.format("ok") + "at_s = 1.5", False, "knee was 'stale' at 2.00 s"),
        (STATE.format("ok") + "between_s = [0, 1.5]", True, "knee was 'ok' at 1.00 s"),
        (
            STATE.format("ok") + "between_s = [0, 9]",
            False,
            "knee was 'stale' at 2.00 s, then 'lost' at 3.00 s",
        ),
        (STATE.format("ok") + "between_s = [5, 9]", False, "nothing was seen of knee then"),
        (STATE.format("ok") + "between_s = [3.5, 9]", False, "nothing was seen of knee from 4.00 to 9.00 s"),
        (STATE.format("ok") + "at_s = 5", False, "nothing was seen of knee then"),
    ],
)
def test_words_are_judged_at_within_and_between(tmp_path: Path, text: str, ok: bool, seen: str) -> None:
    verdict = judge(expect(tmp_path, text), knee=WORDS)
    assert (verdict.ok, verdict.seen) == (ok, seen)


@pytest.mark.parametrize(
    ("condition", "value", "ok"),
    [
        ("min = 1\nmax = 2", 1.0, True),
        ("min = 1\nmax = 2", 2.0, True),
        ("min = 1\nmax = 2", 2.001, False),
        ("min = 1", 0.999, False),
        ("max = 1", -5.0, True),
        ("max = 1", None, False),
        ("max = 1", "fault", False),
        ("missing = true", None, True),
        ("missing = true", 0.0, False),
        ("missing = false", 0.0, True),
        ("missing = false", None, False),
        ('is = "fault"', "fault", True),
        ('is = "fault"', "faulty", False),
        ('is = "0"', 0.0, False),
    ],
)
def test_conditions_on_a_channel(tmp_path: Path, condition: str, value: Seen, ok: bool) -> None:
    one = expect(tmp_path, f'channel = "knee.torque"\nat_s = 1\n{condition}')
    assert judge(one, knee__torque=[(1.0, value)]).ok is ok


@pytest.mark.parametrize(
    ("wanted", "said", "ok"),
    [
        ("power", "check the power", True),
        ("cable", "check the power", False),
        ("", "", True),
        ("", "x", False),
        ("x", "", False),
    ],
)
def test_a_problem_says_something_or_nothing(tmp_path: Path, wanted: str, said: str, ok: bool) -> None:
    one = expect(tmp_path, f'component = "knee"\nproblem = "{wanted}"\nat_s = 1')
    assert one.track is Track.PROBLEM
    assert judge(one, knee=[(1.0, said)]).ok is ok


def test_a_glob_means_every_name_that_fits_and_the_wrong_one_is_told(tmp_path: Path) -> None:
    one = expect(tmp_path, 'component = "left_*"\nstate = "ok"\nat_s = 1')
    right: dict[str, list[tuple[float, Seen]]] = {"left_hip": [(1.0, "ok")], "right_hip": [(1.0, "lost")]}
    assert judge(one, **right).ok
    wrong = judge(one, **right, left_knee=[(1.0, "stale")])
    assert (wrong.ok, wrong.seen) == (False, "left_knee was 'stale' at 1.00 s")


def test_a_name_that_nobody_has_is_a_failure(tmp_path: Path) -> None:
    one = expect(tmp_path, 'component = "left_elbow"\nstate = "ok"\nat_s = 1')
    assert judge(one, left_hip=[(1.0, "ok")]) == Verdict(
        False, "left_elbow is 'ok' at 1 s", "there is no component left_elbow", 1.0
    )


def test_numbers_are_told_as_a_range_and_gaps_in_them_are(tmp_path: Path) -> None:
    one = expect(tmp_path, 'channel = "x"\nmax = 0\nbetween_s = [0, 9]')
    assert judge(one, x=[(1.0, 1.0), (2.0, 3.5)]).seen == "x was 1 to 3.5 from 1.00 to 2.00 s"
    assert judge(one, x=[(1.0, 1.0), (2.0, None)]).seen == "x was 1 at 1.00 s, then missing at 2.00 s"


def test_many_changes_are_not_all_told(tmp_path: Path) -> None:
    one = expect(tmp_path, STATE.format("fault") + "within_s = [0, 99]")
    many = [(float(time_s), ("ok", "lost")[time_s % 2]) for time_s in range(10)]
    assert judge(one, knee=many).seen.endswith("'lost' at 3.00 s, and 6 more changes")


def test_state_and_problem_of_one_line_are_two_expectations(tmp_path: Path) -> None:
    found = script(tmp_path, '[[expect]]\ncomponent = "x"\nstate = "ok"\nproblem = ""\nat_s = 1').expectations
    assert [one.words for one in found] == ["x is 'ok' at 1 s", "problem of x is nothing at 1 s"]


def test_a_rule_is_tripped_or_not_and_says_why_and_whether_it_has_stopped_the_robot(tmp_path: Path) -> None:
    text = '[[expect]]\nrule = "hot"\ntripped = true\nreason = "left_hip"\nstop = ""\nwithin_s = [1, 4]'
    tripped, reason, stop = script(tmp_path, text).expectations
    assert [tripped.track, reason.track, stop.track] == [Track.RULE, Track.REASON, Track.STOP]
    assert tripped.words == "guard rule hot is tripped once between 1 and 4 s"
    verdict = judge(tripped, hot=[(1.0, "watching"), (2.0, "tripped"), (3.0, "cleared")])
    assert (verdict.ok, verdict.seen, verdict.decided_s) == (True, "hot was 'tripped' at 2.00 s", 2.0)
    assert not judge(tripped, hot=[(1.0, "blind"), (3.0, "cleared")]).ok
    assert judge(reason, hot=[(2.0, "left_hip.temperature: 98 °C")]).ok
    assert judge(tripped, cold=[(2.0, "tripped")]).seen == "there is no guard rule hot"


def test_a_rule_that_has_not_tripped_may_be_blind(tmp_path: Path) -> None:
    one = expect(tmp_path, 'rule = "hot"\ntripped = false\nbetween_s = [1, 4]')
    assert judge(one, hot=[(1.0, "blind"), (2.0, "blind"), (3.0, "watching")]).ok
    wrong = judge(one, hot=[(1.0, "blind"), (3.0, "tripped"), (4.0, "cleared")])
    assert (wrong.ok, wrong.seen, wrong.decided_s) == (False, "hot was 'tripped' at 3.00 s", 3.0)


def test_a_rule_that_the_guard_has_not_is_warned_of(tmp_path: Path) -> None:
    expected = [{"rule": "hto", "tripped": True, "at_s": 1}]
    rules = {"rule": {"hot": {"watch": "temperature", "above": 90}}}
    (warning,) = examined(tmp_path / "x.toml", {"guard": rules, "expect": expected})[1]
    assert (warning.severity, warning.key) == ("warning", "rule")
    assert "did you mean 'hot'?" in warning.text
    (warning,) = examined(tmp_path / "x.toml", {"expect": expected})[1]
    assert warning.text == "the scenario has no [guard.rule.NAME]"


def test_the_guard_stands_in_the_robots_file_and_a_heartbeat_has_a_node_id(tmp_path: Path) -> None:
    guard = {"heartbeat_ms": 100, "rule": {"a b": {"watch": "emcy", "codes": ["0x23"], "actions": ["alarm"]}}}
    config = written(tmp_path, guard)
    assert (config["guard"], config["can"]["main"]["node_id"]) == (guard, 100)
    plain = written(tmp_path / "plain", None)
    assert ("guard" in plain, "node_id" in plain["can"]["main"]) == (False, False)


def written(folder: Path, guard: Mapping[str, Any] | None) -> dict[str, Any]:
    """The robot's file of a robot with this guard."""
    robot = SimulatedRobot(folder, virtual_channel=str(folder), guard=guard)
    with closing(robot):
        robot.open()
        return tomllib.loads(robot.config.read_text(encoding="utf-8"))


def test_a_guard_that_is_not_in_the_robots_file_which_is_there_is_refused(tmp_path: Path) -> None:
    written(tmp_path, {"rule": {"hot": {"watch": "temperature", "above": 90}}})
    written(tmp_path, {"rule": {"hot": {"watch": "temperature", "above": 90}}})
    with pytest.raises(SimulatorError, match=r"robot\.toml is there already, and its \[guard\] is not"):
        written(tmp_path, {"rule": {"hot": {"watch": "temperature", "above": 80}}})


# -- what happens without a gateway


def test_lines_happen_at_their_time(tmp_path: Path) -> None:
    lines = script(
        tmp_path,
        '[[at]]\ntime_s = 0.2\nfault = "node_lost"\non = "left_knee"\nfor_s = 0.2\n'
        '[[at]]\ntime_s = 0.3\nactivity = "sit"',
    ).lines
    robot = SimulatedRobot(tmp_path / "robot", virtual_channel=str(tmp_path), speed=None)
    robot.open()
    knee, seen = robot.exoskeleton.drives["left_knee"], []
    schedule(lines, robot)
    for time_s in (0.19, 0.21, 0.39, 0.41):
        robot.exoskeleton.clock.at(round(time_s * SECOND_NS), lambda: seen.append(knee.powered))
    robot.run(0.5)
    assert seen == [True, False, False, True]
    assert robot.exoskeleton.controller.dictionary[0x2005, 0].value == 2
    robot.close()


def test_a_node_that_boots_late_from_the_beginning(tmp_path: Path) -> None:
    lines = script(
        tmp_path, '[[at]]\ntime_s = 0\nfault = "late_boot"\non = "left_knee"\nparams = { boot_s = 0.5 }'
    ).lines
    robot = SimulatedRobot(tmp_path / "robot", virtual_channel=str(tmp_path), speed=None)
    robot.open()
    heard: list[float] = []
    robot.exoskeleton.bus.attach(
        "listener",
        lambda frame, _: heard.append(robot.exoskeleton.clock.now_s) if frame.cob_id == 0x702 else None,
    )
    schedule(lines, robot)
    robot.run(0.6)
    assert heard[0] == pytest.approx(0.5, abs=0.01)
    robot.close()


def test_what_cannot_be_done_when_its_time_comes_ends_the_run_in_words(tmp_path: Path) -> None:
    line = '[[at]]\ntime_s = 0.1\nfault = "node_lost"\non = "gait"\n'
    robot = SimulatedRobot(tmp_path / "robot", virtual_channel=str(tmp_path), speed=None)
    robot.open()
    schedule(script(tmp_path, line * 2).lines, robot)
    with pytest.raises(
        ScenarioError, match=r"one.toml \[\[at\]\] number 2, at 0.1 s: node_lost is already on gait"
    ):
        robot.run(0.5)
    robot.close()


def test_a_line_for_the_gateway_needs_one(tmp_path: Path) -> None:
    robot = SimulatedRobot(tmp_path / "robot", virtual_channel=str(tmp_path), speed=None)
    lines = script(tmp_path, '[[at]]\ntime_s = 1\nstop = "test"').lines
    with pytest.raises(ScenarioError, match="'stop' needs a gateway: gwrms sim run"):
        schedule(lines, robot)
