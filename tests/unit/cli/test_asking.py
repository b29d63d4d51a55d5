"""The asking commands, as a person and as a script meet them, against a gateway that speaks the contract."""

import csv
import json
import re
import threading
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from gateway.cli import connect
from gateway.client import Address
from gateway.main import main
from tests.fake_robot import JOINTS, FakeRobot, Refusal
from tests.support.waiting import until

UTC_TEXT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z")


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


def run(robot: FakeRobot, *arguments: str) -> int:
    return main([*arguments, "--robot", robot.address])


def printed(capsys: pytest.CaptureFixture[str]) -> str:
    return capsys.readouterr().out


def test_describe_names_what_is_wrong(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    robot.lost.add("trunk")
    assert run(robot, "describe") == 0
    text = printed(capsys)
    assert "exo-fake" in text
    assert any("trunk" in line and "lost" in line and "cable" in line for line in text.splitlines())
    assert "gait.step_length" in text


def test_describe_says_which_profile_is_used_for_whom(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    known = robot.describe()
    for part in known["components"]:
        if part["name"] in ("left_hip", "right_hip"):
            part["device"] = {"profile": "maxon EPOS4"}
    robot.overrides["robot.describe"] = lambda _params: known
    assert run(robot, "describe") == 0
    assert "PROFILES (known beside their EDS)\nmaxon EPOS4  left_hip, right_hip\n" in printed(capsys)


def test_describe_says_who_one_is_and_what_that_one_may_not(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = {"parameter.write": "anna is a viewer on this robot"}
    hello = {
        "protocol": 1,
        "robot": "exo-fake",
        "role": "viewer",
        "boot_id": "b",
        "identity": "anna",
        "refused": refused,
    }
    robot.overrides["hello"] = lambda _params: hello
    assert run(robot, "describe") == 0
    assert printed(capsys).startswith("you are anna, as viewer; not for you: parameter.write\n")


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (("describe",), "components"),
        (("describe",), "controllers_held"),
        (("snapshot", "resource"), "cpu"),
        (("snapshot", "component"), "values"),
        (("snapshot", "status"), "quality"),
        (("get",), "values"),
        (("set", "gait.step_length=0.42"), "after"),
        (("stop",), "drives"),
    ],
)
def test_json_is_one_line_of_the_robots_answer(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], key: str
) -> None:
    assert run(robot, *arguments, "--json") == 0
    (line,) = printed(capsys).splitlines()
    assert key in json.loads(line)


def test_resources_are_asked_twice_so_that_percentages_exist(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(robot, "snapshot", "resource", "--sort", "memory", "--limit", "10") == 0
    asked = robot.called("resource.snapshot")
    assert [(params["sort"], params["limit"]) for params in asked] == [("memory", 10)] * 2
    assert "21.5 %" in printed(capsys)


def test_missing_value_is_a_dash_and_its_component_is_named(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.lost.add("left_insole")
    assert run(robot, "snapshot", "component", "*_insole.force") == 0
    lines = printed(capsys).splitlines()
    assert any(line.split()[:3] == ["left_insole.force", "–", "N"] for line in lines)
    assert any("lost" in line and "no heartbeat" in line for line in lines)


def test_state_is_shown_as_its_word(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(robot, "snapshot", "component", "left_knee.state") == 0
    assert "OPERATION ENABLED" in printed(capsys)


def test_watch_prints_the_number_of_rows_asked_for(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(robot, "watch", "left_knee.position", "--rate", "100", "--count", "5") == 0
    title, *rows = printed(capsys).splitlines()
    assert "left_knee.position [rad]" in title
    assert len(rows) == 5
    assert robot.called("stream.start")[0]["rate_hz"] == 100.0


def test_another_object_s_address_is_never_proposed(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(robot, "set", "left_knee.0x6073:0=1") == 1
    said = capsys.readouterr().err
    assert "did you mean" not in said
    assert "releases no object 0x6073:0 of left_knee" in said


def test_watch_gives_null_for_what_is_lost(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    robot.lost.add("left_knee")
    assert run(robot, "watch", "left_knee.position", "--json", "--count", "1", "--rate", "50") == 0
    assert json.loads(printed(capsys))["values"] == {"left_knee.position": None}


@pytest.mark.parametrize(
    ("channel", "modules"),
    [
        ("resource.cpu_percent", ["resource"]),
        ("left_knee.position", ["component"]),
        ("*", ["component", "resource"]),
    ],
)
def test_watch_asks_only_the_modules_that_give_its_channels(
    robot: FakeRobot, channel: str, modules: list[str]
) -> None:
    assert run(robot, "watch", channel, "--count", "1", "--rate", "50") == 0
    assert robot.called("stream.start")[0]["modules"] == modules


def test_describe_groups_channels_by_component(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(robot, "describe") == 0
    lines = printed(capsys).splitlines()
    assert "trunk         tilt_forward [rad], tilt_side [rad]" in lines
    assert "state  NOT READY TO SWITCH ON, OPERATION ENABLED, FAULT" in lines


def test_watch_says_what_was_lost_on_the_way(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    robot.seq_step = 2
    assert run(robot, "watch", "left_knee.position", "--count", "3", "--rate", "100") == 0
    assert "1 notifications were lost" in capsys.readouterr().err


def test_set_takes_the_lease_shows_both_values_and_gives_it_back(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(robot, "set", "gait.step_length=0.42", "left_knee.max_torque=0.8") == 0
    lines = printed(capsys).splitlines()
    assert any(line.split()[:4] == ["gait.step_length", "0.4", "→", "0.42"] for line in lines)
    assert [name for name, _ in robot.calls if name.startswith("control.")] == [
        "control.acquire",
        "control.release",
    ]


def test_get_shows_value_unit_and_range(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(robot, "get", "gait.*") == 0
    text = printed(capsys)
    assert "gait.step_length" in text
    assert "0.2 … 0.6" in text
    assert "left_knee" not in text


def test_parameter_that_no_device_answers_for_fails(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.parameters["left_knee.max_torque"] = None  # type: ignore[assignment]
    assert run(robot, "get", "left_knee.max_torque") == 1
    assert "–" in printed(capsys)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("get", "gait.step_lenght"), "did you mean gait.step_length"),
        (("set", "gait.step_lenght=0.4"), "did you mean gait.step_length"),
        (("watch", "left_nee.position"), "did you mean left_knee.position"),
        (("snapshot", "component", "left_nee.position"), "did you mean left_knee.position"),
        (("snapshot", "component", "resource"), "ask gwrms snapshot resource"),
        (("set", "gait.step_length=9"), "above 0.6 m"),
        (
            ("set", "right_knee.0x6065:0=22755"),
            '[parameter."right_knee.object_6065"] and below it object = "0x6065:0"',
        ),
    ],
)
def test_refusal_is_a_sentence_and_changes_nothing(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    assert run(robot, *arguments) == 1
    captured = capsys.readouterr()
    assert words in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert robot.parameters["gait.step_length"] == 0.40


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        (("get", "gait"), "gait.step_length"),
        (("watch", "left_knee", "--count", "1", "--rate", "50"), "left_knee.position [rad]"),
        (("watch", "resource", "--count", "1", "--rate", "50"), "resource.cpu_percent [%]"),
        (("snapshot", "component", "left_knee"), "left_knee.position"),
    ],
)
def test_a_component_alone_means_all_that_it_has(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], shown: str
) -> None:
    assert run(robot, *arguments) == 0
    said = printed(capsys)
    assert shown in said
    assert "trunk" not in said


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        (("get", "gait.step_lenght"), "UnknownName", "did you mean gait.step_length"),
        (("set", "gait.step_length=9"), "out_of_limit", "above 0.6 m"),
        (("describe", "--robot", "127.0.0.1:1"), "", "no gateway at 127.0.0.1:1"),
    ],
)
def test_an_error_is_an_object_for_machines(
    robot: FakeRobot,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    kind: str,
    words: str,
) -> None:
    assert main([*arguments[:1], "--robot", robot.address, *arguments[1:], "--json"]) == 1
    (line,) = printed(capsys).splitlines()
    error = json.loads(line)["error"]
    assert words in error["message"]
    assert kind in error["kind"]


def test_lease_of_another_is_said_in_the_robots_words(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    def held(params: dict[str, object]) -> object:
        raise Refusal(-32003, "bench-2 holds the lease for 12 s more", kind="lease_held")

    robot.overrides["control.acquire"] = held
    assert run(robot, "set", "gait.step_length=0.42") == 1
    assert "bench-2 holds the lease" in capsys.readouterr().err
    assert robot.called("parameter.write") == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("set", "gait.step_length"),
        ("set", "gait.step_length=nan"),
        ("set", "gait.step_length=0,42"),
        ("set", "gait.step_length=0.4", "gait.step_length=0.5"),
        ("set",),
        ("watch",),
        ("watch", "x", "--rate", "0"),
        ("watch", "x", "--count", "-1"),
        ("snapshot", "weather"),
        ("snapshot", "resource", "left_knee.*"),
        ("get", "--robot", "host:port"),
        ("stop", "now"),
    ],
)
def test_wrong_usage_is_2(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    assert ended.value.code == 2
    assert "usage: gwrms" in capsys.readouterr().err


def test_what_may_be_left_out_is_not_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["snapshot"])
    assert capsys.readouterr().err.endswith("the following arguments are required: module\n")


@pytest.mark.parametrize("command", ["describe", "stop"])
def test_unreachable_robot_is_a_sentence(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as gone:
        address = gone.address
    assert main([command, "--robot", address]) == 1
    captured = capsys.readouterr()
    assert f"no gateway at {address}" in captured.err
    assert "--robot" not in captured.err
    assert captured.out == ""


@pytest.mark.parametrize("command", ["describe", "stop"])
def test_who_names_no_robot_is_told_how_where_none_answers(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with FakeRobot() as gone:
        monkeypatch.setattr(connect, "USUAL", Address.parse(gone.address))
    assert main([command]) == 1
    assert "is it running there? Another robot: --robot HOST:PORT" in capsys.readouterr().err


def test_stop_is_0_only_when_every_drive_has_confirmed(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(robot, "stop", "--reason", "test") == 0
    assert "not a safety-rated stop" in printed(capsys)
    assert robot.called("robot.stop") == [{"reason": "test"}]


@pytest.mark.parametrize("outcome", ["unconfirmed", "unreachable"])
def test_stop_that_a_drive_does_not_confirm_is_1_and_names_it(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str], outcome: str
) -> None:
    drives = dict.fromkeys(JOINTS, "confirmed") | {"left_knee": outcome}
    robot.overrides["robot.stop"] = lambda params: {"drives": drives, "held": True}
    assert run(robot, "stop") == 1
    assert "NOT CONFIRMED by left_knee" in capsys.readouterr().err


def test_stop_without_any_drive_is_1(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    robot.overrides["robot.stop"] = lambda params: {"drives": {}, "held": True}
    assert run(robot, "stop") == 1
    assert "NOT CONFIRMED" in capsys.readouterr().err


def test_stop_that_the_robot_refuses_is_loud(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    def refuse(params: dict[str, object]) -> object:
        raise Refusal(-32015, "the bus is not open", kind="unavailable")

    robot.overrides["robot.stop"] = refuse
    assert run(robot, "stop") == 1
    assert "NOT CONFIRMED, assume that the robot still moves. the bus is not open" in capsys.readouterr().err


# --- units and times as people think of them


@pytest.mark.parametrize(
    ("change", "value"),
    [("gait.step_length=420mm", 0.42), ("gait.step_length=42cm", 0.42), ("gait.step_length=.42m", 0.42)],
)
def test_a_parameter_is_set_in_a_unit_that_is_named(robot: FakeRobot, change: str, value: float) -> None:
    assert run(robot, "set", change) == 0
    assert robot.parameters["gait.step_length"] == value


@pytest.mark.parametrize("change", ["gait.step_length=3deg", "gait.step_length=420furlong"])
def test_a_unit_that_a_parameter_cannot_be_in_is_refused(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str], change: str
) -> None:
    assert run(robot, "set", change) == 1
    assert "gait.step_length: it cannot be in" in (said := capsys.readouterr().err)
    assert "write it in mm or cm or m" in said
    assert robot.called("parameter.write") == []


def test_angles_are_shown_in_degrees_where_asked(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(robot, "watch", "trunk", "--deg", "--count", "1", "--rate", "50") == 0
    title, row = printed(capsys).splitlines()
    assert "trunk.tilt_forward [°]" in title
    assert run(robot, "watch", "trunk.tilt_forward", "--json", "--count", "1", "--rate", "50") == 0
    line = json.loads(printed(capsys))
    assert abs(line["values"]["trunk.tilt_forward"]) < 0.06
    assert abs(float(row.split()[1])) < 4.0
    assert UTC_TEXT.fullmatch(line["utc"])
    assert datetime.fromisoformat(line["utc"]).tzinfo is not None


def test_watch_writes_csv_with_a_column_a_channel(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.lost.add("left_insole")
    wanted = ("trunk.tilt_side", "left_insole.force", "left_knee.state")
    assert run(robot, "watch", *wanted, "--csv", "--count", "3", "--rate", "50") == 0
    lines = list(csv.DictReader(printed(capsys).splitlines()))
    assert len(lines) == 3
    assert set(lines[0]) == {
        "utc",
        "stamp_ns [ns]",
        "trunk.tilt_side [rad]",
        "left_insole.force [N]",
        "left_knee.state",
    }
    assert [line["left_insole.force [N]"] for line in lines] == [""] * 3
    stamps = [int(line["stamp_ns [ns]"]) for line in lines]
    assert stamps == sorted(stamps)
    assert all(UTC_TEXT.fullmatch(line["utc"]) for line in lines)
    assert all(abs(float(line["trunk.tilt_side [rad]"])) <= 0.02 for line in lines)


def test_no_name_of_a_robot_commands_the_terminal_from_a_csv(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    name, described, values = "trunk.\x1b]0;owned\x07", robot.describe(), robot.values()
    described["channels"].append({"name": name, "component": "trunk", "quantity": "x", "unit": "\x1b[2J"})
    robot.overrides["robot.describe"] = lambda _params: described
    robot.values = lambda: {**values, name: 1.0}  # type: ignore[method-assign]
    assert run(robot, "watch", "trunk", "--csv", "--count", "1", "--rate", "50") == 0
    assert all(line.isprintable() for line in printed(capsys).splitlines())


@pytest.mark.parametrize("utc_ns", [10**30, -(10**20)])
def test_a_clock_that_tells_no_time_of_a_calendar_leaves_it_out(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str], utc_ns: int
) -> None:
    described = robot.describe()
    described["clock"]["utc_ns"] = utc_ns
    robot.overrides["robot.describe"] = lambda _params: described
    assert run(robot, "watch", "trunk", "--csv", "--count", "1", "--rate", "50") == 0
    assert printed(capsys).splitlines()[1].startswith(",")
    assert run(robot, "watch", "trunk", "--json", "--count", "1", "--rate", "50") == 0
    assert json.loads(printed(capsys))["utc"] is None


def test_rows_after_a_reboot_are_told_by_the_clock_of_then(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    day = timedelta(days=1)

    def describe(_params: object) -> dict[str, Any]:
        described = robot.describe()
        described["clock"]["utc_ns"] += (
            (len(robot.called("hello")) - 1) * day // timedelta(microseconds=1) * 1000
        )
        return described

    def reboot() -> None:
        until(lambda: robot.called("stream.start"))
        robot.cut()

    robot.overrides["robot.describe"] = describe
    rebooting = threading.Thread(target=reboot)
    rebooting.start()
    try:
        status = run(robot, "watch", "trunk", "--json", "--count", "100", "--rate", "50")
    finally:
        rebooting.join()
    assert status == 0
    last = json.loads(printed(capsys).splitlines()[-1])
    assert abs(datetime.fromisoformat(last["utc"]) - datetime.now(UTC) - day) < timedelta(hours=1)


@pytest.mark.parametrize(
    "number", ["1e400", "-1e400", "1e-400", "9" * 5000, "1e99999999999", "1e400mm", "1e999999kPa"]
)
def test_what_is_no_number_that_a_robot_could_hold_is_not_sent(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str], number: str
) -> None:
    assert run(robot, "set", f"gait.step_length={number}") == 1
    said = capsys.readouterr().err
    assert said.startswith("gwrms set: ")
    assert "internal error" not in said
    assert robot.called("parameter.write") == []


@pytest.mark.parametrize(
    ("typed", "sent"), [(str(2**64 - 1), 2**64 - 1), (str(-(2**63)), -(2**63)), (str(2**64), 2.0**64)]
)
def test_no_digit_of_a_whole_number_is_lost_that_an_object_can_hold(
    robot: FakeRobot, typed: str, sent: float
) -> None:
    assert run(robot, "set", f"gait.step_length={typed}") == 1
    assert [call["changes"]["gait.step_length"] for call in robot.called("parameter.write")] == [sent]
