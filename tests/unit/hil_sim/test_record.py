"""`gwrms sim-record`: sessions as JSON lines, the same for the same seed, and what is in them."""

import gzip
import io
import json
from itertools import islice, pairwise
from pathlib import Path

import pytest

from gateway.main import main
from hil_sim.channels import UNITS
from hil_sim.cli.record import COLUMNS, DANGER_COLUMNS, SessionRecorder
from hil_sim.controller import objects
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.gait.activity import Activity
from hil_sim.training_walks import practice


def recorded(
    scenario: str, seconds: float, seed: int = 1, person: int = 2, assists: str | None = None
) -> list[str]:
    file = io.BytesIO()
    SessionRecorder(file, scenario, seed, person, assists=assists).run(seconds)
    return file.getvalue().decode().splitlines()


def test_a_session_has_a_head_and_a_line_each_cycle() -> None:
    head, *lines = (json.loads(line) for line in recorded("walk", 5.0))
    assert (head["session"], head["subject"], head["scenario"]) == ("sim-1-2", 2, "walk")
    assert dict(zip(head["columns"], head["units"], strict=True)) == COLUMNS
    assert head["wearer"]["mass"] > 50.0
    rows = [dict(zip(head["columns"], line, strict=True)) for line in lines]
    assert {b["time"] - a["time"] for a, b in pairwise(rows)} == {10_000_000}
    assert [rows[0]["label"], rows[-1]["label"]] == ["stand", "walk"]
    assert 0.0 <= rows[-1]["right_phase"] < 1.0
    weight = [row["left_insole.force"] + row["right_insole.force"] for row in rows[-150:]]
    assert sum(weight) / len(weight) == pytest.approx(9.81 * head["wearer"]["mass"], rel=0.08)
    assert min(row["trunk.acceleration_z"] for row in rows) > 5.0


def test_a_robot_on_one_leg_has_that_legs_joints_both_insoles_and_both_phases() -> None:
    head, *lines = (json.loads(line) for line in recorded("walk", 2.0, assists="right"))
    assert len(head["columns"]) == len(head["units"]) == len(lines[-1]) == len(COLUMNS) - 6
    assert not [name for name in head["columns"] if name.startswith(("left_hip", "left_knee", "left_ankle"))]
    last = dict(zip(head["columns"], lines[-1], strict=True))
    assert {"right_knee.position", "left_insole.force", "right_insole.force"} <= set(last)
    assert None not in (last["left_phase"], last["right_phase"])


def test_healthy_level_walking_has_the_columns_of_dangers_and_no_danger() -> None:
    head, *lines = (json.loads(line) for line in recorded("healthy", 12.0))
    assert head["dangers"] == []
    assert head["columns"] == [*COLUMNS, *DANGER_COLUMNS]
    assert {line[1] for line in lines} <= {"stand", "walk", "turn_left", "turn_right"}
    assert {line[-1] for line in lines} == {0.0}


def test_who_stands_has_no_phase() -> None:
    assert json.loads(recorded("stand", 1.0)[-1])[1:4] == ["stand", None, None]


def test_the_same_seed_records_the_same_and_another_one_does_not() -> None:
    first, again, other = (recorded("practice", 1.0, seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_practice_is_everything_at_every_setting() -> None:
    robot = Exoskeleton(Scenario.STAND)
    seen, toes, paces = set(), set(), []
    for entry in islice(practice(robot, 5), 60):
        seen.add(entry.activity)
        toes.add(robot.controller.dictionary.number(objects.TOE_HEIGHT))
        paces.append(entry.pace)
    assert seen == set(Activity)
    assert len(toes) > 10
    assert max(cycle for _, cycle in filter(None, paces)) > 2.5 * min(
        cycle for _, cycle in filter(None, paces)
    )


def test_the_command_writes_every_wearer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "sim.jsonl.gz"
    command = ["sim-record", "--out", str(file), "--subjects", "3-4", "--minutes", "0.01"]
    assert main([*command, "--walks", "crouch"]) == 0
    with gzip.open(file, "rt", encoding="utf-8") as lines:
        heads = [json.loads(line) for line in lines if line.startswith("{")]
    assert [head["subject"] for head in heads] == [3, 4]
    assert {(head["walks"], head["wearer"]["walk"]["name"]) for head in heads} == {("crouch", "crouch")}
    assert list(heads[0]["columns"][4:]) == list(UNITS)


@pytest.mark.parametrize(
    "wrong",
    [
        ["--subjects", "4-3"],
        ["--subjects", "all"],
        ["--minutes", "0"],
        ["--minutes", "x"],
        ["--walks", "moonwalk"],
        ["--assists", "both"],
        ["--assists", "left", "--scenario", "dangers"],
        ["--assists", "left", "--scenario", "healthy"],
    ],
)
def test_wrong_usage_is_refused(wrong: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim-record", "--out", str(tmp_path / "x"), *wrong]) == 2
    assert wrong[0] in capsys.readouterr().err


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim-record", "--out", str(tmp_path / "no" / "sim.jsonl")]) == 1
    assert f"{tmp_path}/no/sim.jsonl: No such file" in capsys.readouterr().err
