"""The truth file: complete lines, what they say, and how they relate to sensors and clocks."""

import json
import statistics
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.gait.activity import Activity
from hil_sim.gait.timetable import Entry
from hil_sim.gait.wearer import GRAVITY
from hil_sim.robot import SimulatedRobot
from hil_sim.truth import COLUMNS, TruthFile
from hil_sim.without_bus import BareExoskeleton
from tests.support.waiting import until

Row = dict[str, Any]


def read(path: Path) -> tuple[Row, list[Row]]:
    head, *lines = path.read_text(encoding="utf-8").splitlines()
    header = json.loads(head)
    return header, [dict(zip(header["columns"], json.loads(line), strict=True)) for line in lines]


def recorded(path: Path, robot: Exoskeleton, seconds: float) -> tuple[Row, list[Row]]:
    truth = TruthFile(path, robot)
    robot.power_on()
    robot.clock.run_until(round(seconds * 1e9))
    truth.close()
    return read(path)


def test_the_header_names_columns_units_seed_and_wearer(tmp_path: Path) -> None:
    header, rows = recorded(tmp_path / "truth", Exoskeleton(Scenario.STAND, seed=5, person=3), 0.5)
    assert header["columns"] == list(COLUMNS)
    assert dict(zip(header["columns"], header["units"], strict=True))["left_knee.velocity"] == "rad/s"
    assert header["seed"] == 5
    assert header["wearer"]["mass"] == pytest.approx(rows[-1]["left_foot.force"] / 4.9, rel=0.1)
    assert len(rows) == 50


def test_times_are_of_both_clocks(tmp_path: Path) -> None:
    before_ns = time.monotonic_ns()
    _, rows = recorded(tmp_path / "truth", Exoskeleton(Scenario.STAND), 0.3)
    assert [row["simulated_ns"] for row in rows] == [10_000_000 * n for n in range(1, 31)]
    stamps = [row["monotonic_ns"] for row in rows]
    assert before_ns < stamps[0]
    assert stamps == sorted(stamps)
    assert stamps[-1] < time.monotonic_ns()


def test_who_walks_has_phases_and_alternating_events(tmp_path: Path) -> None:
    _, rows = recorded(tmp_path / "truth", Exoskeleton(Scenario.WALK, seed=1), 4.5)
    assert rows[10]["label"] == "stand"
    assert rows[10]["left_phase"] is None
    even = rows[250:]
    assert {row["label"] for row in even} == {"walk"}
    assert not any(row["transition"] for row in even)
    events = [(row, event) for row in even for event in row["events"]]
    order = ["left_heel_strike", "right_toe_off", "right_heel_strike", "left_toe_off"]
    begin = order.index(events[0][1])
    assert [event for _, event in events] == [order[(begin + n) % 4] for n in range(len(events))]
    for row, event in events:
        if event == "left_heel_strike":
            assert row["left_phase"] < 0.05 or row["left_phase"] > 0.99
            assert row["left_foot.cop_x"] < 0.06
        if event == "right_toe_off":
            assert 0.55 < row["right_phase"] < 0.68
            assert row["right_foot.cop_x"] is None


def test_the_file_alone_shows_that_newton_holds(tmp_path: Path) -> None:
    robot = BareExoskeleton(Scenario.FALL, seed=2)
    robot.follow([Entry(Activity.WALK, 3.0), Entry(Activity.FALL, 2.5), Entry(Activity.STAND)])
    header, rows = recorded(tmp_path / "truth", robot, 7.0)
    mass = header["wearer"]["mass"]
    for row in rows:
        forces = row["left_foot.force"] + row["right_foot.force"] + row["support.force"]
        assert forces == pytest.approx(mass * (GRAVITY + row["trunk.acceleration_z"]), abs=0.01)
    told = [event for row in rows for event in row["events"] if event in ("fall", "impact", "stumble")]
    assert told == ["fall", "impact"]


def test_velocities_are_those_of_the_joints(tmp_path: Path) -> None:
    _, rows = recorded(tmp_path / "truth", BareExoskeleton(Scenario.WALK), 3.5)
    for joint in ("left_hip", "right_knee"):
        slopes = [(b[f"{joint}.position"] - a[f"{joint}.position"]) / 0.01 for a, b in pairwise(rows)]
        told = [(a[f"{joint}.velocity"] + b[f"{joint}.velocity"]) / 2.0 for a, b in pairwise(rows)]
        assert statistics.correlation(slopes, told) > 0.98


def lived(truth: Path | None) -> list[float]:
    """Where the first seconds of a day have brought the joints."""
    robot = BareExoskeleton(Scenario.DAY, seed=7, person=2)
    if truth is not None:
        recorded(truth, robot, 1.2)
    else:
        robot.power_on()
        robot.clock.run_until(1_200_000_000)
    return [drive.joint.position for drive in robot.drives.values()]


def test_the_same_arguments_give_the_same_truth_and_writing_it_changes_nothing(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    assert lived(one) == lived(two) == lived(None)
    rows = [[row | {"monotonic_ns": 0} for row in read(path)[1]] for path in (one, two)]
    assert rows[0] == rows[1]


def test_lines_are_there_while_the_robot_runs(tmp_path: Path) -> None:
    path = tmp_path / "truth"
    with SimulatedRobot(tmp_path / "robot", virtual_channel=str(tmp_path), truth=path):
        until(lambda: path.read_bytes().count(b"\n") >= 20, path.read_bytes)
    assert read(path)[1]


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    robot = SimulatedRobot(tmp_path / "robot", virtual_channel=str(tmp_path), truth=tmp_path / "no" / "truth")
    with pytest.raises(SimulatorError, match="no/truth: No such file"):
        robot.open()
