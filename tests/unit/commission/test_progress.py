"""Which step is gone through, which are done and which were passed: also where it is gone on with."""

from pathlib import Path

import pytest

from drivers.scan.products import Library
from eds.shipped import SHIPPED
from gateway.commission.axes import Axis
from gateway.commission.dialogue import Ask, At, run
from gateway.commission.draft import Draft
from gateway.commission.live_values import watched
from gateway.commission.progress import END, CommissionStep, Progress, StepState
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from tests.unit.commission.fake_bench import ON, FakeBench, FakeDrive
from tests.unit.commission.test_going_on import Forgetful, bench


class CalledAway(Forgetful):
    """At the first angle."""

    def ask(self, question: Ask) -> str:
        if "one known" in question.text:
            raise EOFError
        return super().ask(question)


def gone_through(draft: Draft, robot: FakeBench, person: Forgetful) -> tuple[Progress, list[At]]:
    progress, seen = Progress(draft), []

    def at(where: At) -> None:
        progress.at(where)
        seen.append(where)

    draft.put("can.main", "interface", "virtual")
    talk = commission(draft, robot, Library([SHIPPED / "joint_drive.eds"]), SerialPorts(), [])
    try:
        run(talk, person, at)
    except EOFError:
        pass
    else:
        progress.end()
    return progress, seen


def states(progress: Progress, part: str) -> dict[str, StepState]:
    return {step.title: step.state for step in progress.steps() if step.part == part}


def test_every_step_that_is_gone_through_is_in_the_list(tmp_path: Path) -> None:
    progress, seen = gone_through(Draft(tmp_path / "exo.toml"), robot := bench(), Forgetful(robot))
    assert len(progress.steps()) == len(seen) == len(set(seen))
    assert set(states(progress, "left_knee").values()) == {StepState.DONE}
    assert states(progress, END) == {"feet and trunk": StepState.PASSED, "the file": StepState.DONE}


def test_somebody_who_was_called_away_sees_where_it_is(tmp_path: Path) -> None:
    robot = bench()
    progress, _ = gone_through(Draft(tmp_path / "exo.toml"), robot, CalledAway(robot))
    knee = states(progress, "left_knee")
    now = [title for title, state in knee.items() if state is StepState.NOW]
    assert now == ["what counts mean"]
    assert (knee["which drive"], knee["limits"]) == (StepState.DONE, StepState.NEXT)
    assert set(states(progress, "left_hip").values()) == {StepState.NEXT}
    assert set(states(progress, "robot").values()) == {StepState.DONE}


def test_what_was_found_before_is_done_and_a_joint_that_is_left_out_is_passed(tmp_path: Path) -> None:
    draft = Draft(tmp_path / "exo.toml")
    draft.put("robot", "joints", ["left_knee", "left_hip"])
    draft.put("joint.left_hip", "node_id", 11)
    progress = Progress(draft)
    progress.at(At("left_hip", "scale"))
    assert set(states(progress, "left_knee").values()) == {StepState.PASSED}
    assert states(progress, "left_hip")["which drive"] is StepState.DONE
    assert CommissionStep("left_hip", "what counts mean", StepState.NOW) in progress.steps()


@pytest.mark.parametrize(
    ("statusword", "words"),
    [
        (0x0250, "no power"),
        (0x0231, "no power (ready to switch on)"),
        (ON, "UNDER POWER (operation enabled)"),
        (0x006D, "power not known"),
    ],
)
def test_live_power_is_never_called_off_unless_it_is(statusword: int, words: str) -> None:
    robot = FakeBench(node_7=FakeDrive(counts=700, statusword=statusword))
    told = watched(robot, [Axis(7)], {Axis(7): 100}, lambda counts: counts / 1000)
    assert [(one.value, one.unit) for one in told] == [(40.1, "°"), (600, "counts moved"), (words, "")]
