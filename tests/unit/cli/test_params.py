"""`gwrms params`, as a person and as a script meet it, against a gateway over fake devices."""

import io
import json
import socket
import tomllib
from pathlib import Path

import pytest

from drivers.errors import DeviceTimeout
from eds import dcf
from gateway.main import main
from gateway.modules.control.parameters import Lock
from gateway.parameter_files.comparison import ComparisonVerdict, compare
from gateway.parameter_files.contents import COMMANDS
from gateway.wire.limits import LINE_LIMIT
from gateway.wire.parameter import ParameterInfo, ParameterValue
from tests.unit.cli.served import CYCLE, STEP, TORQUE, VELOCITY, Served, Terminal, lines


def verdicts(capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    (line,) = capsys.readouterr().out.splitlines()
    return {row["name"]: row["verdict"] for row in json.loads(line)["rows"]}


def edit(file: str, old: str, new: str) -> None:
    text = Path(file).read_text()
    assert old in text
    Path(file).write_text(text.replace(old, new))


# TOML


def test_saved_same_changed_different_applied_same(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("params", "save", "a.toml", "gait.*", "left_knee.max_torque") == 0
    assert robot.run("params", "compare", "a.toml") == 0
    assert robot.run("set", "gait.step_length=0.35", "left_knee.max_torque=80") == 0
    assert robot.run("params", "compare", "a.toml") == 1
    capsys.readouterr()
    assert robot.run("params", "apply", "a.toml", "--yes") == 0
    printed = lines(capsys)
    assert ["gait.step_length", "0.35", "0.4", "m", "different"] in printed
    assert ["left_knee.max_torque", "80", "→", "100", "%", "read", "back"] in printed
    assert (robot.gait(STEP), robot.left(TORQUE)) == (400, 1000)
    assert robot.run("params", "compare", "a.toml") == 0


def test_a_file_says_whose_it_is_and_in_which_units(robot: Served) -> None:
    assert robot.run("params", "save", "a.toml", "gait.*", "left_knee.profile_velocity") == 0
    text = Path("a.toml").read_text()
    assert '"gait.step_length" = 0.4  # m\n' in text
    assert '"left_knee.profile_velocity" = 65190  # counts/s\n' in text
    document = tomllib.loads(text)
    assert document["robot"]["name"] == "exo-test"
    assert document["robot"]["saved"].tzinfo is not None
    assert document["eds"] == {"left_knee": "joint_drive.eds", "gait": "gait_controller.eds"}


def test_without_globs_all_that_can_be_changed_is_saved(robot: Served) -> None:
    assert robot.run("params", "save", "a.toml") == 0
    names = set(tomllib.loads(Path("a.toml").read_text())["parameters"])
    released = {f"_knee.profile_{what}" for what in ("velocity", "acceleration", "deceleration")}
    assert names == {
        *(f"{side}{name}" for side in ("left", "right") for name in released),
        *(f"gait.{name}" for name in ("step_length", "cycle_time", "toe_height")),
        "left_knee.max_torque",
    }


def test_one_component_of_a_file(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("params", "save", "a.toml") == 0
    capsys.readouterr()
    assert robot.run("params", "compare", "a.toml", "--component", "gait", "--json") == 0
    assert set(verdicts(capsys)) == {"gait.step_length", "gait.cycle_time", "gait.toe_height"}


def test_a_value_that_no_device_tells_is_named_and_left_out(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.bench.gait.node.objects.pop(CYCLE)
    assert robot.run("params", "save", "a.toml", "gait.*") == 1
    assert "gait.cycle_time is not in a.toml: " in capsys.readouterr().err
    assert "gait.cycle_time" not in Path("a.toml").read_text()


def test_a_file_that_is_there_is_not_written_over_unasked(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("a.toml").write_text("mine")
    assert robot.run("params", "save", "a.toml") == 1
    assert "a.toml is there already; say --overwrite" in capsys.readouterr().err
    assert Path("a.toml").read_text() == "mine"
    assert robot.run("params", "save", "a.toml", "--overwrite") == 0


# Verdicts
VERDICTS = """
[parameters]
"gait.step_length" = 0.4004
"gait.cycle_time" = 1.3
"gait.toe_height" = 0.5
"gait.stride" = 1
"left_knee.max_torque" = 250.0
"left_knee.producer_heartbeat_time" = 50
"left_knee.controlword" = 6
"""


def test_every_parameter_gets_its_verdict(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.toml").write_text(VERDICTS)
    assert robot.run("params", "compare", "a.toml", "--json") == 1
    assert verdicts(capsys) == {
        "gait.step_length": "same",  # the device holds 400 mm for both
        "gait.cycle_time": "different",
        "gait.toe_height": "out of limits",
        "gait.stride": "not on the robot",
        "left_knee.max_torque": "different",  # the most that the EDS allows
        "left_knee.producer_heartbeat_time": "read-only",
        "left_knee.controlword": "unreadable",
        "left_knee.profile_velocity": "not in the file",
        "left_knee.profile_acceleration": "not in the file",
        "left_knee.profile_deceleration": "not in the file",
    }


def test_what_the_file_does_not_name_does_not_make_it_different(robot: Served) -> None:
    Path("a.toml").write_text('[parameters]\n"gait.step_length" = 0.4\n')
    assert robot.run("params", "compare", "a.toml") == 0


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('"gait.step_length" = 0.55', "too far at once: at most 0.1"),
        ('"gait.step_length" = 0.61', "out of limits: above 0.6"),
        ('"gait.step_length" = 0.24', "out of limits: below 0.25"),
        ('"gait.step_length" = 70000', "out of limits: 70000 is 70000000 for the device"),
    ],
)
def test_what_the_robot_would_refuse_is_said_before_anything_is_sent(
    robot: Served, capsys: pytest.CaptureFixture[str], line: str, words: str
) -> None:
    Path("a.toml").write_text(f'[parameters]\n{line}\n"gait.cycle_time" = 1.3\n')
    assert robot.run("params", "apply", "a.toml", "--yes", "--skip") == 1
    captured = capsys.readouterr()
    assert words in captured.out
    assert "nothing was sent, the robot would refuse 1 value" in captured.err
    assert robot.bench.gait.node.written() == []


@pytest.mark.parametrize(
    ("value", "verdict"),
    [
        (0.6, ComparisonVerdict.DIFFERENT),  # 0.60000002 in the device, whose maximum that is then
        (-0.7, ComparisonVerdict.DIFFERENT),  # -0.69999999
        (0.6000001, ComparisonVerdict.OUT_OF_LIMITS),
        (-0.7000001, ComparisonVerdict.OUT_OF_LIMITS),
    ],
)
def test_a_real_at_its_very_limit_is_within_it(value: float, verdict: ComparisonVerdict) -> None:
    info = ParameterInfo(
        name="knee.gain", unit="", min=-0.7, max=0.6, max_step=None, live=True, states=None, component="knee",
        object="0x2000:0", access="rw", store=False, type="REAL32",
    )  # fmt: skip
    held = ParameterValue(0.0, "", -0.7, 0.6, 0)
    (row,) = compare({"knee.gain": value}, {"knee.gain": info}, {"knee.gain": held})
    assert row.verdict is verdict


def test_a_device_that_does_not_tell_stops_the_whole_file(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    def deaf(index: int) -> None:
        if index == TORQUE[0]:
            raise DeviceTimeout("left_knee does not answer")

    robot.bench.left.node.before_upload = deaf
    Path("a.toml").write_text('[parameters]\n"gait.cycle_time" = 1.3\n"left_knee.max_torque" = 90\n')
    assert robot.run("params", "apply", "a.toml", "--yes", "--skip") == 1
    assert "unreadable: " in capsys.readouterr().out
    assert robot.bench.gait.node.written() == []


@pytest.mark.parametrize("line", ['"gait.stride" = 1', '"left_knee.producer_heartbeat_time" = 50'])
def test_what_cannot_be_changed_stops_the_whole_file_unless_it_is_left_out(
    robot: Served, capsys: pytest.CaptureFixture[str], line: str
) -> None:
    Path("a.toml").write_text(f'[parameters]\n{line}\n"gait.cycle_time" = 1.3\n')
    assert robot.run("params", "apply", "a.toml", "--yes") == 1
    assert "1 value cannot be changed; --skip leaves them out" in capsys.readouterr().err
    assert robot.gait(CYCLE) == 1200
    assert robot.run("params", "apply", "a.toml", "--yes", "--skip") == 0
    assert robot.gait(CYCLE) == 1300


# Asking


@pytest.mark.parametrize(("answer", "status", "cycle"), [("y\n", 0, 1300), ("\n", 1, 1200), ("", 1, 1200)])
def test_it_asks_before_it_writes(
    robot: Served,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    answer: str,
    status: int,
    cycle: int,
) -> None:
    Path("a.toml").write_text('[parameters]\n"gait.cycle_time" = 1.3\n')
    monkeypatch.setattr("sys.stdin", Terminal(answer))
    assert robot.run("params", "apply", "a.toml") == status
    said = capsys.readouterr().err
    assert "Write 1 parameter? [y/N]" in said
    assert ("nothing was written" in said) is (status == 1)
    assert robot.gait(CYCLE) == cycle


def test_without_a_terminal_it_does_not_write_unasked(
    robot: Served, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("a.toml").write_text('[parameters]\n"gait.cycle_time" = 1.3\n')
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert robot.run("params", "apply", "a.toml") == 1
    assert "no terminal to ask on, and nothing was sent" in capsys.readouterr().err
    assert robot.gait(CYCLE) == 1200


def test_a_trial_that_nobody_keeps_is_taken_back(
    robot: Served, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    Path("a.toml").write_text('[parameters]\n"gait.cycle_time" = 1.3\n')
    with Path("/dev/null").open() as nobody:
        monkeypatch.setattr("sys.stdin", nobody)
        assert robot.run("params", "apply", "a.toml", "--yes", "--trial", "0.3") == 1
    assert [data for _, data in robot.bench.gait.node.written()] == [
        (1300).to_bytes(2, "little"),
        (1200).to_bytes(2, "little"),
    ]


def test_nothing_to_change_is_done_without_asking(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.toml").write_text('[parameters]\n"gait.step_length" = 0.4\n')
    assert robot.run("params", "apply", "a.toml") == 0
    assert capsys.readouterr().out == "the robot holds all values of the file\n"
    assert robot.bench.gait.node.written() == []


def test_it_is_one_transaction(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.toml").write_text('[parameters]\n"left_knee.max_torque" = 80\n"gait.step_length" = 0.35\n')

    def fail(index: int, data: bytes) -> None:
        if data == (350).to_bytes(2, "little"):
            raise DeviceTimeout("gait does not answer")

    robot.bench.gait.node.before_download = fail
    assert robot.run("params", "apply", "a.toml", "--yes") == 1
    assert "everything was taken back" in capsys.readouterr().err
    assert (robot.gait(STEP), robot.left(TORQUE)) == (400, 1000)


def test_more_than_a_request_holds_is_said_before_anything_is_sent(
    robot: Served, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.cli.params.LINE_LIMIT", 100)
    Path("a.toml").write_text('[parameters]\n"gait.step_length" = 0.35\n"gait.cycle_time" = 1.3\n')
    assert robot.run("params", "apply", "a.toml", "--yes") == 1
    assert "2 changes are too many for one request" in capsys.readouterr().err
    assert robot.bench.gait.node.written() == []
    assert LINE_LIMIT == 65536


def test_json_is_one_object_a_line(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("params", "save", "a.toml", "gait.*", "--json") == 0
    assert json.loads(capsys.readouterr().out) == {"file": "a.toml", "saved": 3, "problems": {}}
    edit("a.toml", "= 1.2 ", "= 1.3 ")
    assert robot.run("params", "apply", "a.toml", "--yes", "--json") == 0
    rows, written = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert [(row["name"], row["verdict"]) for row in rows["rows"]] == [("gait.cycle_time", "different")]
    assert written["after"] == {"gait.cycle_time": 1.3}


# DCF


def test_a_device_as_a_dcf_and_back(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    everything = robot.bench.left.node
    assert robot.run("params", "save", "k.dcf", "left_knee.*", "--component", "left_knee") == 1
    capsys.readouterr()  # the fake has few of the drive's objects
    assert dcf.owner(Path("k.dcf")) == (2, "left_knee")
    assert dcf.read(Path("k.dcf"), 2).values == {
        TORQUE: 1000,
        VELOCITY: 65190,
        (0x6083, 0): 260_000,
        (0x6084, 0): 260_000,
        (0x1017, 0): 100,
    }
    assert robot.run("params", "compare", "k.dcf") == 0
    everything.objects[VELOCITY] = (70000).to_bytes(4, "little")
    everything.objects[TORQUE] = (900).to_bytes(2, "little")
    assert robot.run("params", "compare", "k.dcf") == 1
    assert robot.run("params", "apply", "k.dcf", "--yes") == 0
    assert (robot.left(VELOCITY), robot.left(TORQUE)) == (65190, 1000)
    assert robot.run("params", "compare", "k.dcf") == 0


def test_commands_are_no_configuration(robot: Served) -> None:
    assert set(COMMANDS) <= {lock.value for lock in Lock}
    robot.bench.left.node.objects |= {(0x6040, 0): b"\x0f\x00", (0x607A, 0): bytes(4), (0x6060, 0): b"\x08"}
    assert robot.run("params", "save", "k.dcf", "--component", "left_knee") == 1
    assert (0x6040, 0) not in dcf.read(Path("k.dcf"), 2).values
    assert (0x607A, 0) not in dcf.read(Path("k.dcf"), 2).values


def test_one_knees_file_is_for_the_other_one_where_that_is_said(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    assert robot.run("params", "save", "k.dcf", "left_knee.profile_*", "--component", "left_knee") == 0
    robot.bench.right.node.objects[VELOCITY] = (70000).to_bytes(4, "little")
    assert robot.run("params", "apply", "k.dcf", "--yes", "--component", "right_knee") == 0
    assert "it was saved from left_knee, this is right_knee" in capsys.readouterr().err
    assert robot.bench.right.node.objects[VELOCITY] == (65190).to_bytes(4, "little")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("save", "k.dcf"), "a DCF is for one device; give --component, one of left_knee, right_knee, gait"),
        (("save", "k.dcf", "--component", "left_hip"), "there is no CANopen device 'left_hip'"),
        (("save", "k.dcf", "--component", "left_knee", "--eds", "no.eds"), "no.eds: cannot be read"),
        (("compare", "k.dcf", "--component", "gait"), "k.dcf is for another device: its product is"),
        (("compare", "a.txt"), "a.txt: give a name that ends in .toml or .dcf"),
        (("compare", "no.toml"), "no.toml: cannot be read: No such file"),
        (("compare", "no.dcf"), "no.dcf: cannot be read: No such file"),
        (("save", "b.toml", "gait.step"), "the robot has no parameter 'gait.step'"),
    ],
)
def test_what_cannot_be_done_is_a_sentence(
    robot: Served, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    if arguments[0] == "compare":
        robot.run("params", "save", "k.dcf", "left_knee.profile_*", "--component", "left_knee")
    capsys.readouterr()
    assert robot.run("params", *arguments) == (2 if arguments[0] == "compare" else 1)
    captured = capsys.readouterr()
    assert words in captured.err
    assert captured.err.count("\n") == 1


def test_a_comparison_without_a_gateway_does_not_say_that_something_differs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    assert main(["params", "compare", "a.toml", "--robot", f"127.0.0.1:{port}", "--json"]) == 2
    assert '"error"' in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[parameters]\n"gait.step_length" = fast', "is no TOML: Invalid value (at line 2"),
        ("", 'there is no [parameters] with lines such as "gait.step_length" = 0.42'),
        ("[parameters]\n", "there is no [parameters]"),
        ("parameters = 3\n", "'parameters' has no place in it"),
        ("[parameter]\na.b = 1\n", "'parameter' has no place in it; there are [robot], [eds], [parameters]"),
        ('[parameters]\n"gait.step_length" = true\n', "gait.step_length: True is no number"),
        ('[parameters]\n"gait.step_length" = "0.4"\n', "gait.step_length: '0.4' is no number"),
        ('[parameters]\n"gait.step_length" = nan\n', "gait.step_length: nan is no number"),
        ("[parameters]\ngait.step_length = 0.4\n", 'write "gait.step_length" = …'),
    ],
)
def test_a_broken_file_is_named_with_its_place(
    robot: Served, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    Path("a.toml").write_text(text)
    assert robot.run("params", "apply", "a.toml", "--yes") == 1
    error = capsys.readouterr().err
    assert words in error
    assert "a.toml: " in error
    assert robot.bench.gait.node.written() == []


def test_a_file_of_another_robot_is_said_to_be(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("params", "save", "a.toml", "gait.*") == 0
    edit("a.toml", "exo-test", "exo-07")
    edit("a.toml", "gait_controller.eds", "gait_v2.eds")
    capsys.readouterr()
    assert robot.run("params", "compare", "a.toml") == 0
    warned = capsys.readouterr().err.splitlines()
    assert any("it was saved from exo-07, this is exo-test" in line for line in warned)
    assert any(
        "gait was described by gait_v2.eds then, now by gait_controller.eds" in line for line in warned
    )


@pytest.mark.parametrize("arguments", [(), ("safe", "a.toml")])
def test_an_unknown_command_is_wrong_usage(
    arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["params", *arguments]) == 2
    assert "usage: gwrms params COMMAND FILE" in capsys.readouterr().err
