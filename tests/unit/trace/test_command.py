"""`gwrms trace` on a live bus, where it is mute, and over recordings; filters, files, load, refusals."""

import json
import threading
from pathlib import Path

import pytest

from drivers.cli.trace import main
from drivers.errors import SettingsError, Unavailable
from tests.unit.bus.fake_node import FakeNode

LOG = """\
(1732351378.000000) can0 000#0102
(1732351378.100000) can0 182#3712F0D8FFFF
(1732351378.500000) can0 602#4041600000000000
(1732351379.200000) can0 182#3712F0D8FFFF
(1732351380.300000) can0 705#05
"""
ROBOT = """\
[can.main]
interface = "virtual"
channel = "{channel}"
bitrate = 1000000
[joint.left_knee]
bus = "main"
node_id = 2
eds = "joint_drive.eds"
"""


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.name)


@pytest.fixture
def robot(tmp_path: Path, channel: str) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT.format(channel=channel), encoding="utf-8")
    return path


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "walk.log"
    path.write_text(LOG, encoding="ascii")
    return path


def shown(capsys: pytest.CaptureFixture[str], *words: object) -> list[str]:
    assert main([str(word) for word in words]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_recording_is_told_by_the_names_of_a_robot(
    log: Path, robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = shown(capsys, log, "--robot", robot)
    assert len(lines) == 5
    assert "NMT" in lines[0]
    assert "start: left_knee" in lines[0]
    assert "182  TPDO1      left_knee    6041h:00 Statusword = 0x1237 (operation enabled)" in lines[1]
    assert "heartbeat  node 5       operational" in lines[4]


def test_filters_go_together_and_json_is_a_line_a_frame(
    log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--eds", "2=joint_drive.eds", "--node", "2", "--kind", "pdo", "--count", "1", "--json")
    (row,) = map(json.loads, shown(capsys, log, *words))
    assert (row["t"], row["id"], row["data"], row["node_id"]) == (1732351378.1, 0x182, "3712f0d8ffff", 2)
    assert row["values"][1] == {
        "object": "0x6064:0",
        "name": "Position actual value (counts)",
        "value": -10000,
        "words": "-10000",
    }


def test_what_is_shown_is_written_and_reads_the_same(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pcap, back = tmp_path / "a.pcap", tmp_path / "b.log"
    assert shown(capsys, log, "--kind", "pdo,nmt", "--write", pcap, "--quiet") == []
    shown(capsys, pcap, "--write", back)
    assert back.read_text("ascii").splitlines() == [
        line.replace("can0", "can") for line in LOG.splitlines() if "#01" in line or "182#" in line
    ]


TWO = """\
(1732351378.000000) can0 702#05
(1732351378.100000) can1 702#7F
(1732351378.200000) can0 182#3712F0D8FFFF
"""
TWO_BUSES = """\
[can.left]
channel = "can0"
[can.right]
channel = "can1"
[joint.left_knee]
bus = "left"
node_id = 2
eds = "joint_drive.eds"
[joint.right_knee]
bus = "right"
node_id = 2
eds = "joint_drive.eds"
"""


@pytest.fixture
def two(tmp_path: Path) -> tuple[Path, Path]:
    """A recording of two buses, and the file of their robot."""
    log, robot = tmp_path / "two.log", tmp_path / "two.toml"
    log.write_text(TWO, encoding="ascii")
    robot.write_text(TWO_BUSES, encoding="utf-8")
    return log, robot


def test_each_bus_of_a_recording_has_nodes_of_its_own(
    two: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, robot = two
    back = tmp_path / "back.log"
    lines = shown(capsys, log, "--robot", robot, "--write", back)
    names = [("can0", "left_knee"), ("can1", "right_knee"), ("can0", "left_knee")]
    assert [(line.split()[1], line.split()[4]) for line in lines] == names
    assert back.read_text("ascii") == TWO
    (line,) = shown(capsys, log, "--robot", robot, "--node", "right_knee", "--json")
    assert json.loads(line)["interface"] == "can1"
    (line,) = shown(capsys, log, "--eds", "can1/2=joint_drive.eds", "--object", "0x6041") or [""]
    assert line == "", "the EDS is of the other bus"


def test_recordings_are_merged_by_time(
    two: tuple[Path, Path], log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = shown(capsys, log, two[0], "--json")
    stamps = [json.loads(line)["t"] for line in lines]
    assert len(stamps) == 8
    assert stamps == sorted(stamps)


def test_the_load_of_two_buses_is_a_table_each(
    two: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    loads = [json.loads(line) for line in shown(capsys, two[0], "--load", "--json")]
    frames = {one["interface"]: round(one["frames_per_s"] * one["seconds"]) for one in loads}
    assert frames == {"can0": 2, "can1": 1}
    text = shown(capsys, two[0], "--load")
    assert [line for line in text if line.endswith(":")] == ["can0:", "can1:"]


def test_two_live_buses_are_one_trace_by_time(channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Frames of both, in the order in which they came, with the interface of each."""
    done = threading.Event()
    names = [f"{channel}-0", f"{channel}-1"]
    with FakeNode(names[0], 9) as first, FakeNode(names[1], 9) as second:

        def talk() -> None:
            while not done.wait(0.01):
                first.send(0x709, b"\x05")
                second.send(0x709, b"\x7f")

        thread = threading.Thread(target=talk)
        thread.start()
        try:
            lines = shown(capsys, *(f"virtual:{name}" for name in names), "--count", "8", "--json")
        finally:
            done.set()
            thread.join()
    told = [json.loads(line) for line in lines]
    stamps = [one["t"] for one in told]
    assert stamps == sorted(stamps)
    assert {(one["interface"], one["data"]) for one in told} == {(names[0], "05"), (names[1], "7f")}
    assert first.seen == second.seen == []


def test_one_of_two_buses_that_is_not_there_ends_both(channel: str) -> None:
    with pytest.raises(Unavailable, match="there is no interface nocan0"):
        main([f"virtual:{channel}", "nocan0"])


def test_seconds_are_those_of_the_recording(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert len(shown(capsys, log, "--seconds", "1")) == 3


def test_the_load_of_a_recording_is_a_table_a_second(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    loads = [json.loads(row) for row in shown(capsys, log, "--load", "--json", "--bitrate", "500000")]
    assert [round(load["frames_per_s"] * load["seconds"]) for load in loads] == [3, 1]
    text = shown(capsys, log, "--load")
    assert text[0].split() == ["NODE", "KIND", "FRAMES/S", "kbit/s", "LOAD"]
    assert text[-2].split()[0] == "all"
    assert text[-2].endswith("–"), "nobody has said the bit rate"


def test_on_a_live_bus_it_is_mute(channel: str, robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = threading.Event()
    with FakeNode(channel, 9) as talker, FakeNode(channel, 10) as listener:

        def talk() -> None:
            while not done.wait(0.005):
                talker.send(0x182, bytes.fromhex("37 12 F0 D8 FF FF"))

        thread = threading.Thread(target=talk)
        thread.start()
        try:
            lines = shown(capsys, robot, "--count", "3")
        finally:
            done.set()
            thread.join()
    assert len(lines) == 3
    assert "left_knee" in lines[0]
    assert {can_id for can_id, _ in listener.seen} == {0x182}
    assert talker.seen == []


@pytest.mark.parametrize(
    "words",
    [
        ("--quiet",),
        ("--count", "0"),
        ("--seconds", "0"),
        ("--load", "--node", "2"),
        ("can0",),
        ("--write", "a.txt"),
    ],
)
def test_what_makes_no_sense_is_said_first(log: Path, words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(log), *words])
    assert ended.value.code == 2


@pytest.mark.parametrize("word", ["drive.eds", "0=joint_drive.eds", "200=joint_drive.eds", "2=none.eds"])
def test_an_eds_that_cannot_be_is_refused(log: Path, word: str) -> None:
    with pytest.raises(SettingsError):
        main([str(log), "--eds", word])


def test_a_bus_that_is_not_there_is_told() -> None:
    with pytest.raises(Unavailable, match="there is no interface nocan0"):
        main(["nocan0"])
