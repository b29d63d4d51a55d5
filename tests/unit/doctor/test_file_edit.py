"""A line of the robot's file is changed where it stands and nowhere else, all of it or nothing."""

import fcntl
import os
import tomllib
from pathlib import Path

import pytest

from gateway.doctor.file_edit import NotMended, change, edited
from gateway.doctor.verdicts import Edit
from tests.unit.doctor.robots import TEXT

GEAR = Edit("joint", "left_knee", "gear_ratio", 100.0, 50.0)
MENDED = TEXT.replace("gear_ratio = 50.0   #", "gear_ratio = 100.0   #")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_one_line_changes_and_its_comment_stays() -> None:
    assert edited(TEXT, GEAR) == TEXT.replace("gear_ratio = 50.0   #", "gear_ratio = 100.0   #")


def test_a_key_that_is_not_there_is_added_behind_its_header() -> None:
    new = edited(TEXT, Edit("joint", "right_knee", "direction", -1, None))
    assert new == TEXT.replace("[joint.right_knee]\n", "[joint.right_knee]\ndirection = -1\n")


@pytest.mark.parametrize(
    "text",
    [
        TEXT.replace("gear_ratio = 50.0   #", "'gear_ratio' = 50.0   #"),
        TEXT.replace("[joint.left_knee]   # the left one", '[joint."left\\u005fknee"]'),
        '[joint]\nleft_knee = {gear_ratio = 50.0}\n[can.x]\na = "[joint.left_knee]"\n',
    ],
)
def test_a_file_that_is_written_otherwise_is_left_alone_and_the_line_is_told(text: str) -> None:
    assert tomllib.loads(text)
    with pytest.raises(NotMended, match="gear_ratio = 100"):
        edited(text, GEAR)


def test_a_table_that_is_not_there_any_more_is_not_made() -> None:
    with pytest.raises(NotMended, match=r"no \[joint.left_knee\]"):
        edited("[robot]\n", GEAR)


def test_a_list_is_written_as_toml() -> None:
    text = '[imu.trunk]\naxes = ["x", "-y", "-z"]   # how it lies\nport = "p"\n'
    new = edited(text, Edit("imu", "trunk", "axes", ["x", "y", "z"], ["x", "-y", "-z"]))
    assert new == '[imu.trunk]\naxes = ["x", "y", "z"]   # how it lies\nport = "p"\n'


def test_a_line_that_somebody_has_changed_since_is_left_alone() -> None:
    with pytest.raises(NotMended, match=r"gear_ratio is 60.0 by now, and was judged as 50.0"):
        edited(TEXT.replace("gear_ratio = 50.0   #", "gear_ratio = 60.0   #"), GEAR)


def test_a_line_is_not_mended_twice(file: Path) -> None:
    change(file, [GEAR])
    with pytest.raises(NotMended, match="ask the doctor again"):
        change(file, [GEAR])


def test_a_link_stays_a_link_and_its_file_keeps_its_mode(file: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.toml"
    link.symlink_to(file)
    file.chmod(0o640)
    change(link, [GEAR])
    assert link.is_symlink()
    assert file.read_text(encoding="utf-8") == MENDED
    assert file.stat().st_mode & 0o777 == 0o640


def test_lines_of_windows_stay_so(file: Path) -> None:
    file.write_bytes(TEXT.replace("\n", "\r\n").encode())
    change(file, [GEAR])
    assert file.read_bytes() == MENDED.replace("\n", "\r\n").encode()


def test_lines_of_both_kinds_are_for_people(file: Path) -> None:
    file.write_bytes(b"# mine\r\n" + TEXT.encode())
    with pytest.raises(NotMended, match="by hand"):
        change(file, [GEAR])


def test_what_the_gateway_would_not_take_is_not_written(file: Path) -> None:
    with pytest.raises(NotMended, match="would not be taken any more"):
        change(file, [Edit("joint", "left_knee", "node_id", 5, 2)])
    assert file.read_text(encoding="utf-8") == TEXT


def test_two_do_not_change_the_file_at_once(file: Path) -> None:
    folder = os.open(file.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        with pytest.raises(NotMended, match="another program changes"):
            change(file, [GEAR])
    finally:
        os.close(folder)
    change(file, [GEAR])
    assert sorted(one.name for one in file.parent.iterdir()) == ["robot.toml"]
