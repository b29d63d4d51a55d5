"""A recorded walk played again, seen by programs that know nothing of it."""

import json
import os
import selectors
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import can
import pytest

from gateway.main import main as gwrms
from hil_sim.cli.sim import main
from hil_sim.replay.can_log import ReplayError
from hil_sim.replay.robot import ReplayedRobot
from tests.unit.hil_sim.outside import of
from tests.unit.hil_sim.recording import Recording, keep_bytes, record

KNEE = 2
WRONG_STATE, NO_DATA, READ_ONLY, NO_OBJECT = "08000022", "08000024", "06010002", "06020000"


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return record(tmp_path_factory.mktemp("walk"))


class Replay:
    """A recording that is played as fast as it goes, and python-can on its bus."""

    def __init__(self, robot: ReplayedRobot, bus: can.BusABC) -> None:
        self.robot = robot
        self.messages: list[can.Message] = []
        self._bus = bus
        robot.open()
        robot.loop.each_turn(lambda: self.messages.extend(iter(lambda: bus.recv(timeout=0), None)))

    def run(self, seconds: float | None = None) -> list[can.Message]:
        """What came on the bus meanwhile."""
        before = len(self.messages)
        self.robot.run(seconds)
        return self.messages[before:]

    def ask(self, node: int, request: str) -> str:
        """An SDO request; the value of an expedited upload as it travels, else the abort code, or ""."""
        data = bytes.fromhex(request).ljust(8, b"\0")
        self._bus.send(can.Message(arbitration_id=0x600 + node, data=data, is_extended_id=False))
        answers = of(self.run(0.02), 0x580 + node)
        if not answers:
            return ""
        if answers[0][0] == 0x80:
            return answers[0][:3:-1].hex()
        assert answers[0][0] & 0xE3 == 0x43, answers[0].hex(" ")
        return answers[0][4 : 8 - (answers[0][0] >> 2 & 3)].hex()


@contextmanager
def playing(folder: Path, *logs: Path, **options: Any) -> Iterator[Replay]:
    with can.Bus(interface="virtual", channel=str(folder), preserve_timestamps=True) as bus:
        robot = ReplayedRobot(folder, logs, virtual_channel=str(folder), speed=None, **options)
        with closing(robot):
            yield Replay(robot, bus)


def candump(path: Path, *lines: str) -> Path:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="ascii")
    return path


def content(message: can.Message) -> tuple[int, bytes]:
    return message.arbitration_id, bytes(message.data)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_every_frame_comes_again_as_far_from_the_first_as_it_was_recorded(
    walk: Recording, tmp_path: Path, suffix: str
) -> None:
    with playing(tmp_path, walk.folder / f"walk{suffix}") as replay:
        played = replay.run()  # ends by itself
    assert list(map(content, played)) == list(map(content, walk.messages))
    first, recorded_first = played[0].timestamp, walk.messages[0].timestamp
    for message, recorded in zip(played, walk.messages, strict=True):
        assert message.timestamp - first == pytest.approx(recorded.timestamp - recorded_first, abs=3e-6)


def test_several_logs_and_captures_begin_with_the_earliest_stamp_of_all(tmp_path: Path) -> None:
    early = candump(tmp_path / "a.log", "(100.5) can0 181#01", "(102.0) can0 181#03")
    late = candump(tmp_path / "b.log", "(101.0) can0 182#02")
    keep_bytes(tmp_path / "left.bin", b"x", 115200)
    about = tmp_path / "left.bin.json"
    about.write_text('{"baudrate": 115200, "seconds": 0.01, "began_s": 100.0}', encoding="ascii")
    with playing(tmp_path / "robot", early, late, captures={"left": tmp_path / "left.bin"}) as replay:
        played = replay.run()
    assert [(message.timestamp, message.data[0]) for message in played] == [(0.5, 1), (1.0, 2), (2.0, 3)]


def test_extended_remote_and_error_frames_are_played_as_such(tmp_path: Path) -> None:
    log = candump(tmp_path / "a.log", "(1.0) can0 1ABCDEF0#01", "(1.1) can0 182#R", "(1.2) can0 20000080#00")
    with playing(tmp_path, log) as replay:
        extended, remote, error = replay.run()
    assert (extended.arbitration_id, extended.is_extended_id) == (0x1ABCDEF0, True)
    assert (remote.arbitration_id, remote.is_remote_frame) == (0x182, True)
    assert error.is_error_frame


def test_frames_with_one_stamp_stay_in_the_order_of_the_file(tmp_path: Path) -> None:
    log = candump(tmp_path / "a.log", *[f"(1.0) can0 {identifier}#" for identifier in ("702", "182", "080")])
    with playing(tmp_path, log) as replay:
        assert [message.arbitration_id for message in replay.run()] == [0x702, 0x182, 0x080]


def test_a_loop_begins_again_after_the_end(tmp_path: Path) -> None:
    log = candump(tmp_path / "a.log", "(1.0) can0 181#01", "(1.1) can0 181#02")
    with playing(tmp_path, log, loop=True) as replay:
        played = replay.run(0.5)
    assert [message.data[0] for message in played] == [1, 2] * 4 + [1]
    steps = [later.timestamp - one.timestamp for one, later in pairwise(played)]
    assert steps == pytest.approx([0.1, 0.01] * 4)


def test_serial_ports_send_what_was_recorded(walk: Recording, tmp_path: Path) -> None:
    recorded, heard = walk.captures["trunk"].read_bytes(), bytearray()
    with (
        playing(tmp_path, captures={"trunk": walk.captures["trunk"]}) as replay,
        port(tmp_path / "trunk") as fd,
    ):
        replay.robot.loop.watch(fd, selectors.EVENT_READ, lambda _: heard.extend(os.read(fd, 4096)))
        replay.run()
        replay.robot.loop.forget(fd)
    assert recorded.startswith(bytes(heard))
    assert len(recorded) - len(heard) < 100  # it ends before the last bytes are read


@contextmanager
def port(path: Path) -> Iterator[int]:
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


# -- SDO -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def known(walk: Recording) -> Iterator[Replay]:
    """The walk in its own folder, where robot.toml names the devices' files; played half."""
    with playing(walk.folder, walk.log) as replay:
        replay.run(1.5)
        yield replay


def test_a_recorded_device_answers_from_its_eds(known: Replay) -> None:
    assert known.ask(KNEE, "40 18 10 01") == "00000000"
    assert known.ask(KNEE, "40 00 1A 01") == "10004160"  # 6041h, 16 bits
    assert known.ask(KNEE, "40 72 60 00") == "d007"


def test_measured_values_are_those_of_the_last_pdo(known: Replay) -> None:
    knee = of(known.messages, 0x182)[-1]
    assert known.ask(KNEE, "40 41 60 00") == knee[:2].hex()
    later = known.ask(KNEE, "40 64 60 00")
    assert later in [data[2:6].hex() for data in of(known.messages, 0x182)[-5:]]


def test_what_was_not_seen_is_not_invented(known: Replay) -> None:
    assert known.ask(KNEE, "40 79 60 00") == NO_DATA  # 6079h is in no PDO
    assert known.ask(KNEE, "40 00 30 00") == NO_OBJECT


def test_every_write_is_refused_and_nothing_changes(known: Replay) -> None:
    for request in ("2B 72 60 00 E8 03", "2B 40 60 00 02 00", "23 10 10 01 73 61 76 65"):
        assert known.ask(KNEE, request) == WRONG_STATE
    assert known.ask(KNEE, "2B 41 60 00 02 00") == READ_ONLY
    assert known.ask(KNEE, "40 72 60 00") == "d007"


def test_nodes_that_were_not_recorded_or_have_no_eds_stay_silent(known: Replay, tmp_path: Path) -> None:
    assert known.ask(9, "40 00 10 00") == ""
    log = candump(tmp_path / "a.log", "(1.0) can0 702#05", "(9.0) can0 702#05")
    with playing(tmp_path, log) as replay:
        assert replay.robot.recorded_nodes == {KNEE}
        assert replay.ask(KNEE, "40 00 10 00") == ""


ROBOT = """
[can.main]
interface = "virtual"
channel = "x"
[joint.left_knee]
bus = "main"
node_id = 2
eds = "joint_drive.eds"
"""
CONVERSATION = (
    "(1.0) can0 702#05",
    "(1.1) can0 602#4072600000000000",  # somebody reads 6072h …
    "(1.2) can0 582#4B726000DC050000",
    "(1.3) can0 602#2B726000E8030000",  # … and changes it
    "(1.4) can0 582#6072600000000000",
    "(1.5) can0 602#2B81600000000000",  # this is refused
    "(1.6) can0 582#8081600012000706",
    "(1.7) can0 082#1023850000000000",
    "(9.0) can0 702#05",
)


@pytest.fixture
def spoken(tmp_path: Path) -> Iterator[Replay]:
    (tmp_path / "robot.toml").write_text(ROBOT, encoding="ascii")
    with playing(tmp_path, candump(tmp_path / "a.log", *CONVERSATION)) as replay:
        yield replay


def test_what_others_read_and_wrote_counts_from_then_on(spoken: Replay) -> None:
    assert spoken.ask(KNEE, "40 72 60 00") == "dc05"  # the first that is known
    spoken.run(1.0)
    assert spoken.ask(KNEE, "40 72 60 00") == "e803"
    assert spoken.ask(KNEE, "40 81 60 00") == "a6fe0000"  # as the EDS says


def test_what_others_spoke_by_sdo_is_not_played_to_a_device_that_answers(spoken: Replay) -> None:
    assert {message.arbitration_id for message in spoken.run(1.0)} == {0x702, 0x082}


def test_the_error_register_is_that_of_the_last_emergency(spoken: Replay) -> None:
    spoken.run(1.0)
    assert spoken.ask(KNEE, "40 01 10 00") == "85"


# -- the folder and the command ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[joint", "robot.toml cannot be read"),
        ('[joint.a]\nnode_id = 2\neds = "no.eds"', "no.eds"),
        (
            '[joint.a]\nnode_id = 2\neds = "joint_drive.eds"\n[joint.b]\nnode_id = 2\neds = "x.eds"',
            "[joint.b]: node 2 has eds 'joint_drive.eds' in another table",
        ),
    ],
)
def test_a_robot_toml_that_cannot_be_used_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "robot.toml").write_text(text, encoding="ascii")
    log = candump(tmp_path / "a.log", "(1.0) can0 702#05")
    robot = ReplayedRobot(tmp_path, [log], virtual_channel=str(tmp_path))
    with pytest.raises(ReplayError) as refused:
        robot.open()
    assert words in str(refused.value)


def test_nothing_to_play_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReplayError, match="nothing to play"):
        ReplayedRobot(tmp_path, [])


def test_the_command_plays_to_the_end_and_writes_a_beginning_of_robot_toml(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = candump(tmp_path / "a.log", "(1.0) can0 702#05", "(1.1) can0 702#05")
    keep_bytes(tmp_path / "left.bin", b"x" * 9, 115200, seconds=0.1)
    serial = ("--replay-serial", f"left={tmp_path / 'left.bin'}")
    status = gwrms(["sim", "--dir", str(tmp_path), "--replay", str(log), *serial])
    said = capsys.readouterr()
    assert status == 0, said.err
    assert json.loads(said.out) == {"ready": True, "config": str(tmp_path / "robot.toml")}
    assert "no eds for node 2" in said.err
    assert str(tmp_path / "left") in (tmp_path / "robot.toml").read_text(encoding="utf-8")


def test_the_command_names_file_and_line_of_a_broken_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = candump(tmp_path / "a.log", "(1.0) can0 702#05", "what")
    assert gwrms(["sim", "--dir", str(tmp_path), "--replay", str(log)]) == 1
    said = capsys.readouterr()
    assert said.err.startswith(f"gwrms sim: {log}, line 2: ")
    assert said.out == ""


@pytest.mark.parametrize(
    "arguments", [["--replay"], ["--replay-serial", "left.bin"], ["--replay", "a.log", "--scenario", "walk"]]
)
def test_wrong_usage_of_replay_is_2(
    tmp_path: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--dir", str(tmp_path), *arguments]) == 2
    assert "usage: gwrms sim" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["--replay", "--help"], ["--replay-serial", "-h"], ["--help", "--replay"]]
)
def test_help_needs_no_recording(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 0
    said = capsys.readouterr()
    assert (said.out.startswith("usage: gwrms sim --dir DIR [--replay FILE"), said.err) == (True, "")
