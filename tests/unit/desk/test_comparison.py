"""A file beside a robot: what differs, what cannot be brought about, and files that cannot be used."""

from pathlib import Path

import pytest

from gateway.parameter_files.comparison import ComparisonVerdict
from gateway.parameter_files.contents import FileProblem
from server_gui.core.tuning.comparison import Comparison, open_file, save_file, staged_as
from tests.support.desk import HELD, Bench, described, looked

STEP, ANGLE, TORQUE = "gait.step_length", "gait.trunk_angle", "left_knee.max_torque"
FILE_TEXT = f"""
[robot]
name = "exo-07"
[parameters]
"{STEP}" = 0.43
"{ANGLE}" = 0.05
"{TORQUE}" = 95.0
"left_hip.no_such" = 1
"""


def opened(path: Path, bench: Bench) -> Comparison:
    made = open_file(path, described().description, None)
    made.update(bench.station.known, bench.station.robot.parameters)
    return made


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "monday.toml"
    made.write_text(FILE_TEXT, encoding="utf-8")
    return made


def test_every_value_of_a_file_is_the_same_or_different_or_cannot_be_changed(
    bench: Bench, file: Path
) -> None:
    compared = opened(file, bench)
    assert {name: row.verdict for name, row in compared.rows.items()} == {
        STEP: ComparisonVerdict.DIFFERENT,
        ANGLE: ComparisonVerdict.SAME,
        TORQUE: ComparisonVerdict.OUT_OF_LIMITS,
    }
    assert compared.unchangeable == ("left_hip.no_such",)
    assert staged_as(compared.different) == {STEP: 0.43, TORQUE: 95.0}


def test_it_follows_the_robot(bench: Bench, file: Path) -> None:
    compared = opened(file, bench)
    bench.station.take([looked({**HELD, STEP: 0.43})])
    compared.update(bench.station.known, bench.station.robot.parameters)
    assert [row.name for row in compared.different] == [TORQUE]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.toml", "step = ", "is no TOML"),
        ("a.toml", "", r"there is no \[parameters\]"),
        ("a.txt", "", r"give a name that ends in \.toml or \.dcf"),
        ("a.dcf", "", "choose a parameter of that device"),
        ("a.toml", None, "cannot be read"),
    ],
)
def test_a_file_that_cannot_be_used_says_why(
    bench: Bench, tmp_path: Path, name: str, text: str | None, said: str
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(FileProblem, match=said):
        opened(tmp_path / name, bench)


def test_what_is_saved_compares_as_the_same(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "now.toml"
    assert save_file(file, described().description, bench.station.robot.parameters) == len(HELD)
    compared = opened(file, bench)
    assert len(compared.rows) == len(HELD)
    assert compared.different == []


def test_where_nothing_can_be_saved_it_is_said(bench: Bench, tmp_path: Path) -> None:
    description = described().description
    with pytest.raises(FileProblem, match="cannot be written"):
        save_file(tmp_path / "nowhere" / "now.toml", description, bench.station.robot.parameters)
    with pytest.raises(FileProblem, match="there is nothing to save"):
        save_file(tmp_path / "now.toml", description, {})
