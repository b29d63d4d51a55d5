"""However the command is ended, it says so, keeps what was found, and lets the file go."""

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from drivers.bus.settings import CanSettings
from gateway.cli import commission_lines, joint_test
from gateway.cli.motion_ends import ENDS
from gateway.commission import stopping
from gateway.commission.axes import Axis
from gateway.commission.bench import CanBench
from gateway.commission.draft import Draft
from gateway.commission.stopping import stop, stop_all
from gateway.main import main
from tests.support.waiting import until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.commission.homing_drive import HomingDrive
from tests.unit.joint.standard import S

Process = subprocess.Popen[str]


def terminated(process: Process) -> None:
    process.send_signal(signal.SIGTERM)


def hung_up(process: Process) -> None:
    process.send_signal(signal.SIGHUP)


def nobody_there(process: Process) -> None:
    assert process.stdin is not None
    process.stdin.close()


def stopped(process: Process) -> None:
    assert process.stdin is not None
    process.stdin.write('{"stop": true}\n')
    process.stdin.flush()


@pytest.mark.parametrize(
    ("end", "status", "words"),
    [
        (terminated, 143, "interrupted"),
        (hung_up, 129, "interrupted"),
        (nobody_there, 1, "nobody answers any more"),
        (stopped, 1, "no drive is known yet; all 127 node ids were asked to stop"),
    ],
)
def test_a_question_that_waits_is_left_in_order(
    tmp_path: Path, end: Callable[[Process], None], status: int, words: str
) -> None:
    file = tmp_path / "exo-01.toml"
    command = [sys.executable, "-P", "-m", "gateway.main", "commission", "--json", str(file), "virtual:ends"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        for said in process.stdout:
            if "ask" in (line := _read(said)):
                break
        assert line["ask"].startswith("What is the robot called")
        end(process)
        rest = process.stdout.read()
    assert process.returncode == status, rest
    assert words in rest
    assert [one.name for one in tmp_path.iterdir()] == ["exo-01.toml.commission"]


def test_a_stop_asks_the_drives_that_were_found_and_those_of_the_file_before(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """While a robot was commissioned anew, those of its file that were not found yet went on."""
    draft = Draft(tmp_path / "exo-01.toml")
    draft.put("node.5", "identity", [0, 0, 5])
    draft.file.write_text("[joint.left_knee]\nnode_id = 6\n[joint.right_knee]\nnode_id = 5\n")
    channel = request.node.nodeid
    bench = CanBench("main", CanSettings(interface="virtual", channel=channel))
    on = S.OPERATION_ENABLED
    with HomingDrive(channel, 5, state=on) as found, HomingDrive(channel, 6, state=on) as kept:
        try:
            stopped = stop(bench, draft)
            assert stopped.drives == {"node 5": "confirmed", "node 6": "confirmed"}
            assert stopped.states == dict.fromkeys(stopped.drives, "switch on disabled")
            assert all(0.0 < after_ms < 5000.0 for after_ms in stopped.after_ms.values())
            assert set(stopped.after_ms) == set(stopped.drives)
        finally:
            bench.close()
        assert (found.state, kept.state) == (S.SWITCH_ON_DISABLED, S.SWITCH_ON_DISABLED)


@pytest.fixture
def bench(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[CanBench]:
    """A bus by the test's name; its nodes have time to answer on a slow computer, too."""
    monkeypatch.setattr(stopping, "ANSWER_S", 1.0)
    made = CanBench("main", CanSettings(interface="virtual", channel=request.node.nodeid))
    yield made
    made.close()


def enabled(request: pytest.FixtureRequest, node: int, **quirks: Any) -> HomingDrive:
    return HomingDrive(request.node.nodeid, node, state=S.OPERATION_ENABLED, **quirks)


def test_a_drive_that_was_not_found_yet_is_stopped_too_and_named(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest
) -> None:
    draft = Draft(tmp_path / "exo-01.toml")
    draft.put("node.5", "identity", [0, 0, 5])
    with enabled(request, 5), enabled(request, 6) as unknown:
        stopped = stop(bench, draft)
        assert unknown.state == S.SWITCH_ON_DISABLED
    assert stopped.words == "STOP is confirmed by node 5, node 6"


def test_a_drive_that_was_not_found_yet_and_stays_enabled_is_no_confirmed_stop(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest
) -> None:
    """It was asked, and nobody looked whether it stopped."""
    draft = Draft(tmp_path / "exo-01.toml")
    draft.put("node.5", "identity", [0, 0, 5])
    with enabled(request, 5), enabled(request, 6, deaf_to_words={0x02}):
        stopped = stop(bench, draft)
    assert stopped.drives == {"node 5": "confirmed", "node 6": "unconfirmed"}
    assert not stopped.confirmed
    assert stopped.words == "NOT CONFIRMED: node 6 is unconfirmed"


def test_a_second_axis_of_a_node_is_stopped_and_looked_at_though_no_file_names_it(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest
) -> None:
    draft = Draft(tmp_path / "exo-01.toml")
    draft.put("node.5", "identity", [0, 0, 5])
    second = {(0x6840, 0): b"\x0f\x00", (0x6841, 0): b"\x27\x00"}  # which stays in operation enabled
    with enabled(request, 5, objects=second) as drive:
        stopped = stop(bench, draft)
        assert drive.objects[0x6840, 0] == b"\x02\x00", "a quick stop"
    assert stopped.drives == {"node 5": "confirmed", "node 5, axis 1": "unconfirmed"}
    assert not stopped.confirmed


def test_a_node_without_a_controlword_is_no_drive_that_has_to_stop(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest
) -> None:
    draft = Draft(tmp_path / "exo-01.toml")
    draft.put("node.5", "identity", [0, 0, 5])
    no_drive = {(0x6040, 0): 0x0602_0000, (0x6041, 0): 0x0602_0000}
    refusing = {(0x6040, 0): 0x0800_0022, (0x6041, 0): 0x0800_0022}  # it has one, and does not say its state
    with (
        enabled(request, 5),
        FakeNode(request.node.nodeid, 16, aborts=no_drive) as sensor,
        FakeNode(request.node.nodeid, 17, aborts=refusing),
    ):
        stopped = stop(bench, draft)
        assert sensor.requests, "it was asked, as all are"
    assert stopped.drives == {"node 5": "confirmed", "node 17": "unconfirmed"}


def test_a_draft_whose_folder_has_gone_still_does_not_tell_of_every_drive(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest
) -> None:
    draft = Draft(tmp_path / "stick" / "exo-01.toml")
    draft.file.parent.mkdir()
    draft.put("node.5", "identity", [0, 0, 5])
    shutil.rmtree(draft.file.parent)
    with enabled(request, 5), enabled(request, 6) as unknown:
        stopped = stop(bench, draft)
        assert unknown.state == S.SWITCH_ON_DISABLED
    assert stopped.drives == {"node 5": "confirmed", "node 6": "confirmed"}


def test_a_draft_beside_a_file_that_cannot_be_read_may_not_tell_of_every_drive(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest
) -> None:
    draft = Draft(tmp_path / "exo-01.toml")
    draft.put("node.5", "identity", [0, 0, 5])
    draft.file.write_text("[[[ damaged")
    with enabled(request, 5):
        stopped = stop(bench, draft)
    others = "draft and robot's file do not tell of every drive: others may be on the bus"
    assert stopped.words == f"NOT CONFIRMED: {others}; only node 5 confirmed it"


TOO_LONG = [250, 300]  # for the draft's name, and for the file's as well: looking for it is an OSError


@pytest.mark.parametrize("length", TOO_LONG)
def test_files_that_cannot_even_be_looked_for_keep_no_stop_from_going_out(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest, length: int
) -> None:
    draft = Draft(tmp_path / ("e" * length), go_on=False)
    with enabled(request, 5) as drive:
        stopped = stop(bench, draft)
        assert drive.state == S.SWITCH_ON_DISABLED
    assert stopped.drives == {"node 5": "confirmed"}
    assert not stopped.confirmed


def test_a_draft_that_may_be_there_may_tell_of_more_than_the_file(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest
) -> None:
    draft = Draft(tmp_path / ("e" * TOO_LONG[0]), go_on=False)
    draft.file.write_text("[joint.left_knee]\nnode_id = 5\n")
    with enabled(request, 5), enabled(request, 6) as unknown:
        stopped = stop(bench, draft)
        assert unknown.state == S.SWITCH_ON_DISABLED
    assert stopped.words.startswith("NOT CONFIRMED: draft and robot's file do not tell of every drive")


@pytest.mark.usefixtures("signals")
@pytest.mark.parametrize("length", TOO_LONG)
def test_the_command_sends_its_stop_whatever_its_files_are(
    tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str], length: int
) -> None:
    with enabled(request, 5) as drive:
        options = ["commission", "--stop", str(tmp_path / ("e" * length)), f"virtual:{request.node.nodeid}"]
        assert main(options) == 1
        assert drive.state == S.SWITCH_ON_DISABLED
    assert "only node 5 confirmed it" in capsys.readouterr().out


@pytest.mark.parametrize(
    "text", ["[[[ damaged", "deep = " + "[" * 5000, "[joint.left_knee]\nnode_id = 128\n"]
)
def test_a_robots_file_that_cannot_be_read_is_named_and_every_node_asked(
    tmp_path: Path, bench: CanBench, request: pytest.FixtureRequest, text: str
) -> None:
    draft = Draft(tmp_path / "exo-01.toml")
    draft.file.write_text(text)
    why = f"{draft.file} cannot be read, so no drive is known for sure; all 127 node ids were asked to stop"
    assert stop(bench, draft).words == f"NOT CONFIRMED: {why}"
    with enabled(request, 5) as drive:
        stopped = stop(bench, draft)
        assert drive.state == S.SWITCH_ON_DISABLED
    assert stopped.words == f"NOT CONFIRMED: {why}; only node 5 confirmed it"


def test_a_bus_that_is_not_there_is_said_before_anything_is_asked_and_leaves_no_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """It asked for the robot's name first, and left a draft with nothing found."""
    assert main(["commission", "--json", str(tmp_path / "exo-01.toml"), "socketcan:none9"]) == 1
    said = capfd.readouterr()
    assert "none9" in said.err
    assert "ask" not in said.out
    assert list(tmp_path.iterdir()) == []


TWO_BUSES = """
[robot]
name = "exo-01"
[gateway]
role = "master"
[can.one]
interface = "virtual"
channel = "one"
[can.two]
interface = "virtual"
channel = "two"
[joint.left_knee]
bus = "one"
node_id = 5
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100
[joint.right_knee]
bus = "two"
node_id = 5
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100
"""


@pytest.fixture
def signals() -> Iterator[None]:
    """Leave signals as they were: a stop lets nothing interrupt it, and its process ends with it."""
    before = {number: signal.getsignal(number) for number in ENDS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("signals")
def test_a_stop_reaches_the_drives_of_every_bus_and_one_that_has_the_same_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was asked on the bus of the joint alone, and its node stood for that of the other bus as well."""
    file = tmp_path / "robot.toml"
    file.write_text(TWO_BUSES, encoding="utf-8")
    drives = [HomingDrive(channel, 5, state=S.OPERATION_ENABLED) for channel in ("one", "two")]
    with drives[0], drives[1]:
        assert main(["joint-test", "stop", f"{file}:left_knee"]) == 0
    assert [drive.state for drive in drives] == [S.SWITCH_ON_DISABLED] * 2
    assert "node 5 on one, node 5 on two" in capsys.readouterr().out
    with drives[1]:
        assert main(["joint-test", "stop", f"{file}:right_knee"]) == 1
    assert "NOT CONFIRMED: node 5 on one is unreachable" in capsys.readouterr().out
    with drives[1]:
        assert main(["joint-test", "stop", f"{file}:right_knee", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)["stopped"]
    assert told["drives"] == {"node 5 on one": "unreachable", "node 5 on two": "confirmed"}
    assert told["states"] == {"node 5 on two": "switch on disabled"}
    assert list(told["after_ms"]) == ["node 5 on two"], "no time where nothing was confirmed"
    assert told["joints"] == {"node 5 on one": "left_knee", "node 5 on two": "right_knee"}


@pytest.mark.usefixtures("signals")
def test_a_stop_in_the_terminal_has_a_row_a_drive_with_its_joint_state_and_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It named the nodes in one line, without what they had said."""
    file = tmp_path / "exo-01.toml"
    file.write_text("[joint.left_knee]\nnode_id = 5\n[joint.right_knee]\nnode_id = 6\n")
    draft = Draft(file)
    draft.put("joint.left_hip", "node_id", 7)
    with (
        HomingDrive("rows", 5, state=S.OPERATION_ENABLED),
        HomingDrive("rows", 7, state=S.READY_TO_SWITCH_ON),
    ):
        assert main(["commission", "--stop", str(file), "virtual:rows"]) == 1
    first, *table = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert first == "NOT CONFIRMED: node 6 is unreachable"
    assert [re.sub(r"\d+ ms", "N ms", row) for row in table] == [
        "JOINT DRIVE STATE CONFIRMED",
        "left_knee node 5 switch on disabled after N ms",
        "right_knee node 6 not known NOT CONFIRMED: unreachable",
        "left_hip node 7 switch on disabled after N ms",
    ]


def test_an_interface_that_fails_hides_nothing_of_the_drives_of_another_bus(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its error was all that was said: that the other bus's drives had confirmed was lost."""
    channel = request.node.nodeid
    good, bad = (CanBench(name, CanSettings(interface="virtual", channel=channel)) for name in ("one", "two"))

    def fail(_node: int, _data: bytes) -> None:
        raise OSError(errno.ENETDOWN, "Network is down")

    monkeypatch.setattr(bad, "send_urgent", fail)
    with HomingDrive(channel, 5, state=S.OPERATION_ENABLED) as drive:
        try:
            stopped = stop_all({"one": (good, {Axis(5): "left_knee"}), "two": (bad, {Axis(6): "right_knee"})})
        finally:
            good.close()
            bad.close()
    assert drive.state == S.SWITCH_ON_DISABLED
    assert stopped.drives == {"node 5 on one": "confirmed", "node 6 on two": "unreachable"}
    assert not stopped.confirmed
    assert stopped.words == "NOT CONFIRMED: node 6 on two is unreachable (two: Network is down)"


def test_a_stop_of_no_drive_at_all_is_not_confirmed_and_raises_nothing() -> None:
    stopped = stop_all({})
    assert (stopped.confirmed, stopped.words) == (False, "NOT CONFIRMED: the robot's file has no drive")


def test_a_stop_by_a_line_before_a_joint_is_tested_stops_every_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said that the drive is without power, which it had not asked yet."""
    file = tmp_path / "robot.toml"
    file.write_text(TWO_BUSES, encoding="utf-8")
    source, sink = os.pipe()
    monkeypatch.setattr(joint_test, "stdin", lambda: source)
    left = HomingDrive("one", 5, state=S.OPERATION_ENABLED, delay_s=0.2)

    def stop(_drive: HomingDrive) -> None:
        os.write(sink, b'{"stop": true}\n')

    left.on_look = stop  # as soon as its state is read
    with left, HomingDrive("two", 5, state=S.OPERATION_ENABLED) as right:
        assert main(["joint-test", "step", f"{file}:right_knee", "--json"]) == 1
        assert (left.state, right.state) == (S.SWITCH_ON_DISABLED,) * 2
    os.close(sink)
    os.close(source)
    told = capsys.readouterr()
    assert '"stopped":{"confirmed":true' in told.out
    assert "without power" not in told.err


def test_a_stop_that_waits_before_anything_is_read_is_carried_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended the command, now and then, before that would have taken it for a stop."""
    taken = commission_lines.Lines.__enter__

    def late(lines: commission_lines.Lines) -> commission_lines.Lines:
        found = taken(lines)
        until(lambda: lines.stop_asked)
        return found

    source, sink = os.pipe()
    os.write(sink, b'{"stop": true}\n')
    monkeypatch.setattr(commission_lines.Lines, "__enter__", late)
    monkeypatch.setattr("gateway.cli.commission.stdin", lambda: source)
    assert main(["commission", "--json", str(tmp_path / "exo-01.toml"), "virtual:waits"]) == 1
    os.close(sink)
    os.close(source)
    assert "all 127 node ids were asked to stop" in capsys.readouterr().out


def _read(said: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(said)
    return found
