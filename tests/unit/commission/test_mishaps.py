"""What goes wrong while a robot is commissioned is noticed, and spoils nothing that was found."""

import fcntl
import math
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import can
import pytest

from drivers.errors import SettingsError
from drivers.joint.quick_stop import StopOutcome
from drivers.scan.products import Library
from eds.profile import profiles
from eds.shipped import SHIPPED
from gateway.cli.commission import main
from gateway.commission import joints, nodes, stopping
from gateway.commission.axes import Axis
from gateway.commission.dialogue import run
from gateway.commission.draft import Draft, alone
from gateway.commission.scale import Scale
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from gateway.commission.writing import text, unfinished
from tests.unit.commission.fake_bench import OFF, ON, FakeBench, FakeDrive, Hands

KNEE, HIP = Axis(7), Axis(11)
SCALE = Scale(4096.0, 100.0, 1, 0.0)


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    return Draft(tmp_path / "exo-01.toml")


@pytest.fixture
def bench() -> FakeBench:
    return FakeBench(node_7=FakeDrive(serial_number=7), node_11=FakeDrive(serial_number=11))


def doing(drive: FakeDrive, typed: str = "", **values: object) -> Callable[[], str]:
    """Somebody changes the drive, and types."""

    def act() -> str:
        for name, value in values.items():
            setattr(drive, name, value)
        return typed

    return act


def test_what_a_drive_counted_that_got_power_meanwhile_is_not_by_hand(draft: Draft, bench: FakeBench) -> None:
    knee = bench.drives[7]
    hands = Hands(
        ("Bend the left knee", doing(knee, counts=60_000, statusword=ON)),
        ("Switch the drives off", doing(knee, statusword=OFF)),
        ("Bend the left knee", doing(knee, counts=120_000)),
    )
    assert run(joints.which_drive(draft, bench, "left_knee", [KNEE, HIP]), hands) == KNEE
    assert hands.heard("may be under power now: let go")
    assert sum("Bend the left knee" in line for line in hands.read) == 2


def test_an_angle_that_was_held_under_power_is_asked_for_again(draft: Draft, bench: FakeBench) -> None:
    knee = bench.drives[7]
    hands = Hands(
        ("one known angle", doing(knee, "0", counts=5_000, statusword=ON)),
        ("Switch the drives off", doing(knee, statusword=OFF)),
        ("one known angle", doing(knee, "0", counts=0)),
        ("another known angle", doing(knee, "45", counts=51_200)),
    )
    assert run(joints.meaning(draft, bench, "left_knee", KNEE), hands).zero_offset == 0.0


def test_no_hand_is_laid_on_a_joint_that_got_power_between_its_two_ends(
    draft: Draft, bench: FakeBench
) -> None:
    knee = bench.drives[7]
    hands = Hands(
        ("How far within its ends", doing(knee)),
        ("as straight as", doing(knee, counts=0, statusword=ON)),
        ("Switch the drives off", doing(knee, statusword=OFF)),
        ("as straight as", doing(knee, counts=-4_096)),
        ("as bent as", doing(knee, counts=102_400)),
    )
    run(joints.limits(draft, bench, "left_knee", KNEE, SCALE), hands)
    low = draft.value("guard.rule.left_knee_range", "min")
    assert low == pytest.approx(-math.tau / 100 + math.radians(3), abs=1e-3)


def test_a_drive_that_vanishes_is_waited_for_at_every_reading(draft: Draft, bench: FakeBench) -> None:
    knee = bench.drives[7]
    hands = Hands(
        ("Bend the left knee", doing(knee, counts=60_000, there=False)),
        ("does not answer", doing(knee, there=True)),
        ("one known angle", doing(knee, "0", there=False, counts=0)),
        ("does not answer", doing(knee, there=True)),
        ("another known angle", doing(knee, "45", there=False, counts=51_200)),
        ("does not answer", doing(knee, there=True)),
    )
    axis = run(joints.which_drive(draft, bench, "left_knee", [KNEE, HIP]), hands)
    assert axis == KNEE
    assert run(joints.meaning(draft, bench, "left_knee", KNEE), hands).direction == 1
    knee.there = False
    back = Hands(("does not answer", doing(knee, there=True)))
    run(joints.ratings(draft, bench, "left_knee", KNEE, 100.0), back)
    knee.there = False
    back = Hands(("does not answer", doing(knee, there=True)))
    run(nodes.heartbeat(draft, bench, 7), back)
    assert draft.value("node.7", "heartbeat") == 100


def begun(draft: Draft, bench: FakeBench) -> None:
    """The left knee's drive was found; then somebody went away."""
    draft.put("can.main", "interface", "virtual")
    draft.put("can.main", "channel", "x")
    knee = bench.drives[7]
    hands = Hands(
        ("robot called", lambda: "exo-01"),
        ("Are these all", lambda: "all"),
        ("leads this bus", lambda: "master"),
        ("joints called", lambda: "left_knee left_hip"),
        ("Bend the left knee", doing(knee, counts=knee.counts + 60_000)),
        ("its file?", lambda: "y"),
    )
    with pytest.raises(EOFError):
        go(draft, bench, hands)


def go(draft: Draft, bench: FakeBench, hands: Hands) -> None:
    run(commission(draft, bench, Library([SHIPPED / "joint_drive.eds"]), SerialPorts(), []), hands)


def test_a_joint_whose_drive_left_before_it_was_finished_is_not_in_the_file(
    draft: Draft, bench: FakeBench
) -> None:
    begun(draft, bench)
    bench.drives[7].there = False
    go(draft, bench, Hands(("Are these all", lambda: "all"), ("Bend the left hip", lambda: "skip")))
    assert unfinished(draft) == ("left_knee",)
    made = text(draft, "Ada", "now")
    assert "[joint.left_knee]" not in made
    assert "left_knee, node 7, is not here" in made


def test_what_was_found_of_another_device_with_the_same_node_id_is_asked_again(
    draft: Draft, bench: FakeBench
) -> None:
    begun(draft, bench)
    bench.drives[7].serial_number = 4711
    hands = Hands(("Are these all", lambda: "all"))
    with pytest.raises(EOFError):
        go(Draft(draft.file), bench, hands)
    assert hands.heard("Node 7 is another device")
    assert hands.heard("Bend the left knee")


def test_the_same_devices_are_gone_on_with(draft: Draft, bench: FakeBench) -> None:
    begun(draft, bench)
    hands = Hands(("Are these all", lambda: "all"))
    with pytest.raises(EOFError):
        go(Draft(draft.file), bench, hands)
    assert not hands.heard("Bend the left knee")


def test_who_leads_the_bus_now_counts_more_than_what_was_chosen(draft: Draft, bench: FakeBench) -> None:
    draft.put("gateway", "role", "master", "chosen")
    found = bench.nodes()
    found.traffic.take(1, 0x000, b"\x01\x00")
    run(nodes.role(draft, found), Hands())
    assert draft.value("gateway", "role") == "observer"


@pytest.mark.parametrize("name", ["é", 'left"knee', "left-knee", "Left_knee", "1_knee", "left.knee"])
def test_a_joint_is_called_by_what_a_table_can_be_called(draft: Draft, name: str) -> None:
    hands = Hands(("joints called", lambda: name), ("joints called", lambda: "left_knee"))
    assert run(joints.names(draft, [KNEE]), hands) == ["left_knee"]


def test_two_do_not_commission_one_file_at_once(tmp_path: Path) -> None:
    file = tmp_path / "exo-01.toml"
    with alone(file), pytest.raises(SettingsError, match="another gwrms commission"), alone(file):
        pass
    with alone(file):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_lock_that_was_removed_as_it_was_taken_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = fcntl.flock

    def late(lock: BinaryIO, how: int) -> None:
        (tmp_path / "exo-01.toml.commission.lock").unlink()  # by who had it until now
        taken(lock, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with pytest.raises(SettingsError, match="another gwrms commission"), alone(tmp_path / "exo-01.toml"):
        pass


def test_a_folder_that_cannot_be_written_is_told_before_anything_is_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SettingsError, match="could not be written"):
        main([str(tmp_path / "not_there" / "exo-01.toml"), "virtual:x"])
    assert capsys.readouterr().out == ""


def test_a_draft_of_another_bus_is_not_gone_on_with(tmp_path: Path) -> None:
    file = tmp_path / "exo-01.toml"
    draft = Draft(file)
    draft.put("can.main", "interface", "virtual")
    draft.put("can.main", "channel", "other")
    with pytest.raises(SettingsError, match="is of the bus virtual:other, not virtual:x"):
        main([str(file), "virtual:x"])


def test_a_comment_stays_one_line_and_beside_a_value_only_where_it_fits(draft: Draft) -> None:
    draft.put("robot", "name", "exo-01")
    draft.put("robot", "joints", [])
    draft.put("can.main", "interface", "virtual")
    draft.put("imu.trunk", "port", "/dev/serial/by-id/usb-a_name_that_is_long", "as it was plugged in")
    draft.put("gateway", "role", "observer", "another controller leads the bus: " + "RPDOs, " * 20)
    lines = text(draft, 'Ada\n[evil] "x"', "now").splitlines()
    assert "[evil]" not in [line.strip() for line in lines]
    assert lines[lines.index('port = "/dev/serial/by-id/usb-a_name_that_is_long"') - 1] == (
        "# as it was plugged in"
    )
    assert 'role = "observer"' in lines


@pytest.mark.parametrize(
    "left",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"[]",
        b'{"robot": 7}',
        b'{"robot": {"joints": {"value": "left_knee"}}}',
        b'{"joint.left_knee": {"node_id": {"value": 128}}}',
        b'{"robot": {"deep": {"value": ' + b"[" * 30_000,
    ],
)
def test_a_damaged_draft_is_named_and_not_gone_on_with(tmp_path: Path, left: bytes) -> None:
    (tmp_path / "exo-01.toml.commission").write_bytes(left)
    with pytest.raises(SettingsError, match=r"exo-01\.toml\.commission: cannot be gone on with"):
        Draft(tmp_path / "exo-01.toml")


@pytest.mark.parametrize(
    "left",
    [
        b"{",
        b'{"robot": 7}',
        b'{"node.x": {"identity": {"value": 1}}, "joint.y": {"node_id": {"value": null}}}',
    ],
)
def test_a_stop_asks_all_where_the_draft_is_damaged_or_a_folder_is_gone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, left: bytes
) -> None:
    monkeypatch.setattr("gateway.cli.motion_ends.signal.signal", lambda *_: None)
    file = tmp_path / "exo-01.toml"
    file.with_name("exo-01.toml.commission").write_bytes(left)
    with can.Bus(interface="virtual", channel="damaged") as other:
        options = ["--stop", f"--eds={tmp_path / 'gone'}", str(file), "virtual:damaged"]
        assert main(options) == 1
        sent = {frame.arbitration_id for frame in iter(lambda: other.recv(0.5), None)}
    assert {0x600 + node for node in range(1, 128)} <= sent
    assert "all 127 node ids were asked to stop" in capsys.readouterr().out


def test_a_stop_after_the_file_is_written_asks_its_joints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.cli.motion_ends.signal.signal", lambda *_: None)
    file = tmp_path / "exo-01.toml"
    file.write_text("[joint.left_knee]\nnode_id = 2\n[joint.right_knee]\nnode_id = 5\naxis = 1\n")
    with can.Bus(interface="virtual", channel="written") as other:
        assert main(["--stop", str(file), "virtual:written"]) == 1
        sent = {frame.arbitration_id for frame in iter(lambda: other.recv(0.5), None)}
    assert sent == {0x602, 0x605}
    assert capsys.readouterr().out.startswith("NOT CONFIRMED: node 2 is unreachable, node 5, axis 1 is")


def test_a_stop_asks_every_node_where_the_draft_cannot_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drives of the draft that the robot's file of before does not have went on."""
    monkeypatch.setattr("gateway.cli.motion_ends.signal.signal", lambda *_: None)
    file = tmp_path / "exo-01.toml"
    file.write_text("[joint.left_knee]\nnode_id = 2\n")
    Path(f"{file}.commission").write_text("[[[ damaged")
    with can.Bus(interface="virtual", channel="damaged") as other:
        assert main(["--stop", str(file), "virtual:damaged"]) == 1
        sent = [frame.arbitration_id for frame in iter(lambda: other.recv(0.5), None)]
    assert sent[0] == 0x602, "what is known comes first"
    assert {0x600 + node for node in range(1, 128)} <= set(sent)


def test_a_stop_is_not_confirmed_where_there_may_be_drives_that_nobody_knows() -> None:
    said = stopping.Stopped({"node 5": StopOutcome.CONFIRMED}, stopping.OTHERS)
    assert not said.confirmed
    assert said.words == f"NOT CONFIRMED: {stopping.OTHERS}; only node 5 confirmed it"


def test_the_rated_torque_that_is_shown_is_in_the_unit_of_its_maker(
    draft: Draft, bench: FakeBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    maxon = next(one for one in profiles() if one.name == "maxon EPOS4")
    monkeypatch.setattr(joints, "profile_of", lambda _description: maxon)
    draft.put("node.7", "eds", "joint_drive.eds")
    bench.drives[7].objects[0x6076, 0] = 400_000  # µN·m
    hands = Hands()
    run(joints.ratings(draft, bench, "left_knee", KNEE, 100.0), hands)
    assert hands.heard("rated torque at the joint 40 N·m")
