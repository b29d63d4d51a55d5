"""A joint's zero is found again as before; nothing else of the file changes, and nothing moves."""

import json
import math
import os
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from drivers.errors import SettingsError
from drivers.joint.settings import JointSettings
from gateway.cli import calibrate
from gateway.cli.line_input import Typed
from gateway.commission.dialogue import run
from gateway.commission.draft import DraftValue
from gateway.commission.edit import NotEdited, comment_of, with_value
from gateway.commission.zero import NotRepeated, posture, repeated
from gateway.config.reading import load
from gateway.main import main
from tests.unit.commission.fake_bench import ON, FakeBench, FakeDrive, Hands
from tests.unit.commission.homing_drive import HomingDrive, encoded

TURN = 409_600
ASKED = bytes.fromhex("4064600000000000")
KNEE = JointSettings(
    bus="main",
    node_id=7,
    eds="joint_drive.eds",
    counts_per_revolution=4096,
    gear_ratio=100,
    direction=-1,
    zero_offset=0.5,
)
FILE = """\
# of the bench in room 12
[robot]
name = "exo-01"

[can.main]
interface = "virtual"
channel = "{channel}"

[joint.left_knee]
bus = "main"
node_id = 5  # moved by hand
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100
# rad; of 30° and 75° by hand
zero_offset = 0.5

[joint.right_knee]
bus = "main"
node_id = 6
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100
zero_offset = 0.25
"""


def counts(angle: float) -> int:
    return round(-(angle - 0.5) / math.tau * TURN)


def measured(drive: FakeDrive, *, degrees: float | None = 30.0, most: float = 10.0) -> tuple[float, Hands]:
    hands = Hands(("Hold the", lambda: ""), ("At which", lambda: "30"), ("Write it", lambda: "y"))
    zero = run(repeated(FakeBench(node_7=drive), "left_knee", KNEE, degrees, most), hands)
    assert zero is not None
    assert posture(zero.how) == 30
    return zero.offset, hands


def test_the_zero_is_that_of_the_posture_and_the_change_is_shown() -> None:
    drive = FakeDrive(counts=counts(math.radians(28)))  # the drive says 28° where the joint is at 30°
    zero, hands = measured(drive)
    assert zero == pytest.approx(0.5 + math.radians(2), abs=1e-4)
    assert hands.heard("was 0.50000 rad and is 0.534")
    assert hands.heard("by this: +2.00°")
    assert measured(drive, degrees=None)[0] == zero, "an angle that nobody has noted is asked for"


class Wandering(FakeDrive):
    """Its joint turns while it is read."""

    @property
    def counts(self) -> int:
        self.__dict__["at"] = self.__dict__.get("at", 0) + 500
        return int(self.__dict__["at"])

    @counts.setter
    def counts(self, value: int) -> None:
        self.__dict__["at"] = value


@pytest.mark.parametrize(
    ("drive", "words"),
    [
        (lambda: FakeDrive(counts=counts(math.radians(60))), "more than 10°"),
        (lambda: FakeDrive(counts=counts(math.radians(30)), statusword=ON), "may be under power"),
        (lambda: Wandering(counts=0), "while it was read"),
    ],
)
def test_what_may_be_wrong_leaves_the_zero_as_it_was(drive: Callable[[], FakeDrive], words: str) -> None:
    with pytest.raises(NotRepeated, match=words):
        measured(drive())


def test_a_larger_change_is_taken_when_told() -> None:
    assert measured(FakeDrive(counts=counts(math.radians(60))), most=40)[0] == pytest.approx(
        0.5 - math.radians(30), abs=1e-4
    )


def test_one_value_is_another_and_all_else_stays() -> None:
    made = with_value(FILE, "joint.left_knee", "zero_offset", DraftValue(0.75, "rad; 30° by hand"))
    assert "zero_offset = 0.75" in made
    assert "of 30° and 75°" not in made
    assert comment_of(made, "joint.left_knee", "zero_offset") == "rad; 30° by hand"
    assert [one for one in made.splitlines() if "zero" not in one and "rad;" not in one] == [
        one for one in FILE.splitlines() if "zero" not in one and "rad;" not in one
    ]
    again = with_value(made, "joint.right_knee", "zero_offset", DraftValue(-0.1, "rad; " + "so " * 60))
    assert tomllib.loads(again)["joint"]["right_knee"]["zero_offset"] == -0.1
    assert with_value(again, "joint.right_knee", "zero_offset", DraftValue(0.2, "x")).count("so so") == 0


@pytest.mark.parametrize(
    "text",
    [
        "joint = { left_knee = { zero_offset = 0.5 } }\n",
        "[joint]\nleft_knee.zero_offset = 0.5\n",
        '[joint.left_knee]\neds = """\n[joint.left_knee]\nzero_offset = 1\n"""\nzero_offset = 0.5\n',
    ],
)
def test_a_file_that_is_written_otherwise_is_not_guessed_at(text: str) -> None:
    with pytest.raises(NotEdited, match="write zero_offset = 1"):
        with_value(text, "joint.left_knee", "zero_offset", DraftValue(1))


def test_a_value_that_was_not_there_is_added() -> None:
    made = with_value("[joint.left_knee]\nnode_id = 5\n", "joint.left_knee", "zero_offset", DraftValue(1.5))
    assert tomllib.loads(made) == {"joint": {"left_knee": {"node_id": 5, "zero_offset": 1.5}}}


@pytest.fixture
def robot(tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(calibrate, "LISTEN_S", 0.3)
    file = tmp_path / "exo-01.toml"
    file.write_text(FILE.format(channel=request.node.nodeid), encoding="utf-8")
    return file


def faced(monkeypatch: pytest.MonkeyPatch, *does: tuple[str, Callable[[], str]]) -> Hands:
    hands = Hands(*does)
    monkeypatch.setattr(calibrate, "Terminal", lambda: hands)
    return hands


def test_the_command_writes_the_zero_and_the_journal(
    robot: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = robot.read_text(encoding="utf-8")
    hands = faced(monkeypatch, ("at 30° ", lambda: ""), ("Write it", lambda: "y"))
    with HomingDrive(request.node.nodeid, 5) as drive:
        drive.objects[0x6064, 0] = encoded(0x6064, round(0.01 / math.tau * TURN))
        assert calibrate.main(["joint", f"{robot}:left_knee", "--who", "Ada"]) == 0, hands.read
        assert drive.writes == []
    after = tomllib.loads(robot.read_text(encoding="utf-8"))
    assert after["joint"]["left_knee"]["zero_offset"] == pytest.approx(math.radians(30) - 0.01, abs=1e-4)
    assert robot.with_name("exo-01.toml.before").read_text(encoding="utf-8") == before
    journal = (load(robot).records / "journal.jsonl").read_text(encoding="utf-8")
    (one,) = [entry for entry in map(json.loads, journal.splitlines()) if entry["what"] == "calibrate"]
    assert (one["who"], one["joint"], one["before"]) == ("Ada", "left_knee", 0.5)


def answered(robot: Path, channel: str, *options: str) -> int:
    with HomingDrive(channel, 5) as drive:
        drive.objects[0x6064, 0] = encoded(0x6064, round(0.01 / math.tau * TURN))
        return calibrate.main(["joint", f"{robot}:left_knee", *options])


def test_what_was_changed_by_hand_meanwhile_is_not_written_over(
    robot: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    def changing() -> str:
        robot.write_text(robot.read_text(encoding="utf-8").replace("100", "121"), encoding="utf-8")
        return "y"

    faced(monkeypatch, ("at 30° ", lambda: ""), ("Write it", changing))
    assert answered(robot, request.node.nodeid) == 1
    text = robot.read_text(encoding="utf-8")
    assert "gear_ratio = 121" in text
    assert "zero_offset = 0.5\n" in text


def test_a_stop_while_nothing_is_powered_is_said_to_have_stopped_nothing(
    robot: Path,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = robot.read_text(encoding="utf-8")
    source, sink = os.pipe()
    os.write(sink, b"please stop\n")
    os.close(sink)
    monkeypatch.setattr("gateway.cli.commission_faces.Typed", lambda: Typed(source))
    with HomingDrive(request.node.nodeid, 5) as drive:
        assert main(["calibrate", "joint", f"{robot}:left_knee"]) == 130
        assert drive.writes == []
    os.close(source)
    assert "has stopped nothing: gwrms stop does" in capsys.readouterr().err
    assert robot.read_text(encoding="utf-8") == before


def test_ends_of_lines_a_link_and_its_mode_stay(
    robot: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = robot.with_name("real.toml")
    real.write_bytes(robot.read_bytes().replace(b"\n", b"\r\n"))
    real.chmod(0o600)
    robot.unlink()
    robot.symlink_to(real)
    faced(monkeypatch, ("at 30° ", lambda: ""), ("Write it", lambda: "y"))
    assert answered(robot, request.node.nodeid) == 0
    made = real.read_bytes()
    assert b"zero_offset = 0.5136 " in made
    assert made.count(b"\n") == made.count(b"\r\n")
    assert robot.is_symlink()
    assert stat.S_IMODE(real.stat().st_mode) == 0o600


@pytest.mark.parametrize("option", ["--angle=nan", "--angle=inf", "--angle=3000", "--max-change=nan"])
def test_no_angle_is_no_number(robot: Path, capsys: pytest.CaptureFixture[str], option: str) -> None:
    with pytest.raises(SystemExit):
        calibrate.main(["joint", f"{robot}:left_knee", option])
    assert "is no number of" in capsys.readouterr().err


def test_nobody_who_is_asked_by_another_at_once_is_read(
    robot: Path,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    faced(monkeypatch)
    channel = request.node.nodeid
    with HomingDrive(channel, 5), can.Bus(interface="virtual", channel=channel) as other:
        frame = can.Message(arbitration_id=0x605, data=ASKED, is_extended_id=False)
        task = other.send_periodic(frame, 0.05)
        assert calibrate.main(["joint", f"{robot}:left_knee"]) == 1
        task.stop()
    assert "node 5 is asked by somebody else" in capsys.readouterr().err


def test_a_drive_that_does_not_answer_leaves_the_file(
    robot: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = robot.read_text(encoding="utf-8")
    faced(monkeypatch, ("at 30° ", lambda: ""))
    assert calibrate.main(["joint", f"{robot}:left_knee"]) == 1
    assert "nothing is written" in capsys.readouterr().err
    assert robot.read_text(encoding="utf-8") == before


@pytest.mark.parametrize(
    ("where", "words"), [("left_knee", "names no joint"), ("{}:elbow", "here are left_knee")]
)
def test_what_is_no_joint_is_named(robot: Path, where: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        calibrate.main(["joint", where.format(robot)])
