"""gwrms stop, reset and enable: what is not certain is said, and is no success."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from gateway.client.keys import server_file
from gateway.main import main
from tests.fake_robot import STATES, FakeRobot, Refusal
from tests.unit.cli.served import Terminal

DOWN, UP = "switch on disabled", "operation enabled"


def run(robot: FakeRobot, *arguments: str) -> int:
    return main([*arguments, "--robot", robot.address])


@pytest.fixture
def powered(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeRobot]:
    """A robot that is enabled, of which no stop is held, and that is reset when it is asked."""
    monkeypatch.setitem(STATES, 5, UP)
    with FakeRobot() as robot:
        robot.overrides["robot.reset"] = lambda _params: {
            "drives": {"left_knee": DOWN},
            "problems": {},
            "held": False,
        }
        yield robot


def held(robot: FakeRobot) -> dict[str, Any]:
    known = FakeRobot.describe(robot)
    return known | {"stop": known["stop"] | {"held": True, "reason": "somebody fell"}}


def test_drives_that_are_enabled_while_no_stop_is_held_lose_no_power_unasked(
    powered: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    """The advice after a stop of another robot was followed here, and this one walked."""
    assert run(powered, "reset") != 0
    assert "no terminal to ask on" in capsys.readouterr().err
    assert powered.called("robot.reset") == []
    assert run(powered, "reset", "--yes") == 0
    assert len(powered.called("robot.reset")) == 1


@pytest.mark.parametrize(("answer", "resets"), [("n\n", 0), ("\n", 0), ("", 0), ("y\n", 1)])
def test_a_reset_that_takes_power_needs_a_yes_and_asks_beside_what_programs_read(
    powered: FakeRobot,
    answer: str,
    resets: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.stdin", Terminal(answer))
    assert run(powered, "reset", "--json") == 1 - resets
    said = capsys.readouterr()
    assert "under power, or not known, are: left_hip, left_knee," in said.err
    assert len(powered.called("robot.reset")) == resets
    told = json.loads(said.out)
    if resets:
        assert told["held"] is False
    else:
        assert told["error"]["message"] == "nothing was done"


def test_a_question_shows_letters_that_would_command_the_terminal_as_what_they_are(
    powered: FakeRobot, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot tells the names in it, and could hide what the question is about."""
    monkeypatch.setattr("tests.fake_robot.JOINTS", ("left\x1b[2Jknee",))
    monkeypatch.setattr("sys.stdin", Terminal("n\n"))
    assert run(powered, "reset") == 1
    said = capsys.readouterr().err
    assert "under power, or not known, are: left" in said
    assert "\x1b" not in said


@pytest.mark.parametrize(
    ("state", "asks"),
    [
        ("not ready to switch on", False),
        (DOWN, False),
        ("ready to switch on", False),
        ("switched on", True),
        ("quick stop active", True),
        ("fault reaction active", True),
        ("fault", False),
        ("", True),  # not a state that is known
    ],
)
def test_every_drive_that_may_hold_its_joint_is_asked_about(
    powered: FakeRobot, state: str, asks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(STATES, 5, state)
    monkeypatch.setattr("sys.stdin", Terminal("n\n"))
    assert (run(powered, "reset") == 1) is asks
    assert len(powered.called("robot.reset")) == (not asks)


def test_a_held_stop_is_reset_without_a_question(powered: FakeRobot) -> None:
    powered.overrides["robot.describe"] = lambda _params: held(powered)
    assert run(powered, "reset") == 0
    assert len(powered.called("robot.reset")) == 1


def test_a_robot_that_was_stopped_while_its_reset_was_asked_about_stays_stopped(
    powered: FakeRobot, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Slow(Terminal):
        def isatty(self) -> bool:
            powered.overrides["robot.describe"] = lambda _params: held(powered)
            return True

    monkeypatch.setattr("sys.stdin", Slow("y\n"))
    assert run(powered, "reset") == 1
    assert powered.called("robot.reset") == []
    assert "stopped the robot meanwhile" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("method", "asked"),
    [
        ("robot.describe", "are: every drive (not known)."),
        ("component.snapshot", "are: left_hip (not known), left_knee (not known),"),
    ],
)
@pytest.mark.parametrize("answer", [{"gone": "wrong"}, None])
@pytest.mark.parametrize(("typed", "resets"), [("n\n", 0), ("y\n", 1)])
def test_a_look_that_fails_is_asked_about_and_keeps_no_fault_from_its_reset(
    powered: FakeRobot,
    method: str,
    asked: str,
    answer: object,
    typed: str,
    resets: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It took the power of drives that nobody had seen, unasked."""

    def refuse(_params: object) -> object:
        raise Refusal(-32010, "no module answers", kind="device_timeout")

    powered.overrides[method] = refuse if answer is None else lambda _params: answer
    monkeypatch.setattr("sys.stdin", Terminal(typed))
    assert run(powered, "reset") == 1 - resets
    assert asked in capsys.readouterr().err
    assert len(powered.called("robot.reset")) == resets


def test_a_joint_without_a_state_is_asked_about_by_its_name(
    powered: FakeRobot, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Only joints with a channel of their state were looked at."""
    monkeypatch.setitem(STATES, 5, DOWN)
    known = FakeRobot.describe(powered)
    channels = [one for one in known["channels"] if one["name"] != "left_knee.state"]
    assert len(channels) < len(known["channels"])
    powered.overrides["robot.describe"] = lambda _params: known | {"channels": channels}
    monkeypatch.setattr("sys.stdin", Terminal("n\n"))
    assert run(powered, "reset") == 1
    assert "are: left_knee (not known). A reset" in capsys.readouterr().err
    assert powered.called("robot.reset") == []


def test_a_robot_that_is_not_served_says_why_and_is_not_reset(
    powered: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(_params: object) -> object:
        raise Refusal(-32010, "robot.toml: [robot] name: is missing", kind="unavailable")

    powered.overrides["robot.describe"] = refuse
    assert run(powered, "reset") == 1
    assert "robot.toml: [robot] name: is missing" in capsys.readouterr().err
    assert powered.called("robot.reset") == []


def test_a_reset_that_was_told_yes_looks_at_nothing_first(powered: FakeRobot) -> None:
    assert run(powered, "reset", "--yes") == 0
    called = [method for method, _ in powered.calls]
    assert "component.snapshot" not in called
    assert "robot.describe" not in called


def test_a_reset_takes_the_lease_and_says_that_no_stop_is_held(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        robot.overrides["robot.reset"] = lambda _params: {
            "drives": {"left_knee": DOWN},
            "problems": {},
            "held": False,
        }
        assert run(robot, "reset") == 0
        called = [method for method, _ in robot.calls]
    assert [one for one in called if one.startswith(("control.", "robot.reset"))] == [
        "control.acquire",
        "robot.reset",
        "control.release",
    ]
    out = capsys.readouterr().out
    assert f"left_knee  {DOWN}" in out
    assert "No stop is held." in out


@pytest.mark.parametrize(("problems", "held"), [({"left_knee": "it does not answer"}, True), ({}, True)])
def test_a_stop_that_stays_held_is_no_success(
    capsys: pytest.CaptureFixture[str], problems: dict[str, str], held: bool
) -> None:
    with FakeRobot() as robot:
        robot.overrides["robot.reset"] = lambda _params: {
            "drives": {"left_knee": "unknown"},
            "problems": problems,
            "held": held,
        }
        assert run(robot, "reset") == 1
    said = capsys.readouterr()
    assert "STILL HELD" in said.out
    for name, why in problems.items():
        assert why in said.out
        assert why not in said.err, "each reason is said once"
        assert f"the stop is still held: {name}" in said.err


def test_a_drive_that_is_enabled_is_told_with_its_mode(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        robot.overrides["robot.enable"] = lambda params: {
            "drives": {"left_knee": UP},
            "problems": {},
            "modes": {"left_knee": "cyclic synchronous position"},
        }
        assert run(robot, "enable", "left_*") == 0
        assert robot.called("robot.enable") == [{"joints": ["left_*"]}]
    assert "cyclic synchronous position" in capsys.readouterr().out


def test_a_drive_that_could_not_be_enabled_is_no_success(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        robot.overrides["robot.enable"] = lambda params: {
            "drives": {"left_knee": "fault"},
            "problems": {"left_knee": "it is in fault; its quick stop: confirmed"},
        }
        assert run(robot, "enable", "--json") == 1
    said = capsys.readouterr()
    assert json.loads(said.out)["drives"] == {"left_knee": "fault"}
    assert "NOT ENABLED" in said.err


def test_what_is_refused_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    def refuse(_params: object) -> dict[str, object]:
        raise Refusal(-32016, "the stop of desk is held; reset it first", kind="stopped")

    with FakeRobot() as robot:
        robot.overrides["robot.enable"] = refuse
        assert run(robot, "enable") == 1
    assert "reset it first" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("answer", "status", "words"),
    [
        ({"controllers": {"gait": "confirmed"}}, 0, "gait"),
        ({"controllers": {"gait": "unreachable"}}, 1, "NOT CONFIRMED by gait"),
        ({"fallbacks": {"left_knee": "its voltage was disabled"}}, 0, "its voltage was disabled"),
        ({"problem": "this stop is held, but not beyond this gateway: full"}, 0, "not beyond this gateway"),
    ],
)
def test_a_stop_tells_controllers_fallbacks_and_what_does_not_last(
    capsys: pytest.CaptureFixture[str], answer: dict[str, object], status: int, words: str
) -> None:
    with FakeRobot() as robot:
        robot.overrides["robot.stop"] = lambda _params: {
            "drives": {"left_knee": "confirmed"},
            "held": True,
            **answer,
        }
        assert run(robot, "stop") == status
    said = capsys.readouterr()
    assert words in said.out + said.err


@pytest.mark.parametrize("entry", ['"{}"', '{{ address = "{}" }}'])
def test_a_robot_is_asked_by_its_name_in_the_servers_file(entry: str) -> None:
    with FakeRobot() as robot:
        server_file().parent.mkdir(parents=True, exist_ok=True)
        server_file().write_text(f"[robots]\nexo-02 = {entry.format(robot.address)}\n", encoding="utf-8")
        assert main(["stop", "--robot", "exo-02"]) == 0
        assert len(robot.called("robot.stop")) == 1
