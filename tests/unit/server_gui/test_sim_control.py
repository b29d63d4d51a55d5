"""The simulator's control socket, as the demo speaks to it: faults by name, mended, a start, a refusal."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server_gui.processes.children import Child
from server_gui.processes.demo_robot import DemoRobot
from server_gui.processes.sim_control import SimControl, SimulatorRefuses
from server_gui.processes.simulated import RobotPart
from tests.support.waiting import until


@pytest.fixture(scope="module")
def control(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimControl]:
    folder = tmp_path_factory.mktemp("robot")
    with Child("simulator", ["sim", "--dir", str(folder)]) as child:
        child.wait_ready(lambda line: line or None, 60.0, lambda: None)
        yield SimControl(folder)


def test_faults_are_listed_by_name_made_and_mended(control: SimControl) -> None:
    assert "left_knee" in control.listed().faults["node_lost"].on
    control.break_("sensor_unplugged", "left_insole")
    listed = control.listed()
    assert [(one.name, one.on) for one in listed.active] == [("sensor_unplugged", "left_insole")]
    assert listed.faults["sensor_unplugged"].active == ("left_insole",)
    control.mend()
    assert control.listed().active == ()
    control.walk()


def test_what_the_simulator_refuses_is_said_in_its_words(control: SimControl) -> None:
    with pytest.raises(SimulatorRefuses, match="there is no fault 'node_gone'"):
        control.break_("node_gone", "left_knee")


def test_a_simulator_that_is_gone_is_named(tmp_path: Path) -> None:
    with pytest.raises(SimulatorRefuses, match="the simulator does not answer"):
        SimControl(tmp_path).listed()
    with pytest.raises(SimulatorRefuses, match="the simulator does not answer"):
        SimControl(tmp_path / "nowhere").listed()


def test_a_robot_of_ours_says_which_of_its_parts_are_ready_and_lets_go_of_both(tmp_path: Path) -> None:
    with DemoRobot("stand", tmp_path) as own:
        until(lambda: own.address is not None or own.problem)
        own.check()
        assert own.ready == (RobotPart.SIMULATOR, RobotPart.GATEWAY)
        assert SimControl(tmp_path).listed().active == ()
    assert not own.is_running
    with pytest.raises(SimulatorRefuses):
        SimControl(tmp_path).listed()


def test_a_robot_of_ours_that_cannot_start_says_why(tmp_path: Path) -> None:
    with DemoRobot("hover", tmp_path) as own:
        until(lambda: not own.is_running)
        assert "invalid choice: 'hover'" in own.problem
