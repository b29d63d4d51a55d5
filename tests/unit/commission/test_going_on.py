"""Whoever stops at any question, and goes on, ends where somebody ends who never stopped."""

from pathlib import Path

import pytest

from drivers.scan.products import Library
from eds.shipped import SHIPPED
from gateway.commission.dialogue import Ask, run
from gateway.commission.draft import Draft
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from gateway.commission.writing import text, unfinished
from tests.unit.commission.fake_bench import FakeBench, FakeDrive

NODES = {"left knee": 7, "left hip": 11}
TURN = 409_600
TYPED = {
    "robot called": "exo-01",
    "joints called": "left_knee left_hip",
    "one known": "0",
    "another known": "45",
}
HELD = {"one known": 0, "another known": TURN // 8, "straight as": -TURN // 72, "bent as": TURN // 4}
BENT = TURN // 6


class Forgetful:
    """Does and types what is asked, and is called away at the question of this number."""

    def __init__(self, bench: FakeBench, away_at: int | None = None) -> None:
        self.asked = 0
        self._bench = bench
        self._away_at = away_at

    def say(self, text: str) -> None:
        pass

    def moving(self, text: str) -> str:
        raise AssertionError(f"nobody agreed to a motion: {text}")

    def ask(self, question: Ask) -> str:
        self.asked += 1
        self._move(question.text)
        if self.asked == self._away_at:
            raise EOFError
        return next((typed for words, typed in TYPED.items() if words in question.text), "")

    def _move(self, asked: str) -> None:
        node = next((node for joint, node in NODES.items() if joint in asked), None)
        counts = next((counts for words, counts in HELD.items() if words in asked), None)
        if node is not None and "Bend the" in asked:
            self._bench.drives[node].counts += BENT
        elif node is not None and counts is not None:
            self._bench.drives[node].counts = counts


def go(file: Path, bench: FakeBench, person: Forgetful) -> str:
    draft = Draft(file)
    draft.put("can.main", "interface", "virtual")
    run(commission(draft, bench, Library([SHIPPED / "joint_drive.eds"]), SerialPorts(), []), person)
    assert unfinished(draft) == ()
    return text(draft, "Ada", "now")


def bench() -> FakeBench:
    return FakeBench(node_7=FakeDrive(serial_number=7), node_11=FakeDrive(serial_number=11))


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.nightly)])
def test_stopped_at_any_question_it_goes_on_to_the_same_file(tmp_path: Path, every: int) -> None:
    whole = Forgetful(robot := bench())
    expected = go(tmp_path / "whole.toml", robot, whole)
    assert "[joint.left_hip]" in expected
    for number in range(1, whole.asked + 1, every):
        file, robot = tmp_path / f"{number}.toml", bench()
        with pytest.raises(EOFError):
            go(file, robot, Forgetful(robot, away_at=number))
        assert go(file, robot, Forgetful(robot)) == expected, f"stopped at question {number}"
