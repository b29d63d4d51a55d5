"""Any choice of sensors gives a robot's file that a gateway can build every component from."""

import tomllib
from pathlib import Path

import pytest

from gateway import config
from gateway.modules.component.assembly import assemble
from hil_sim.cli import sim
from hil_sim.robot import SimulatedRobot
from hil_sim.sensors.suite import IMUS, INSOLES, SensorChoice

CHOICES = [
    *(SensorChoice(imu=imu) for imu in IMUS),
    *(SensorChoice(insole=insole) for insole in INSOLES),
]


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: f"{choice.imu} {choice.insole}")
def test_the_written_file_describes_the_chosen_sensors(choice: SensorChoice, tmp_path: Path) -> None:
    with SimulatedRobot(tmp_path, virtual_channel=str(tmp_path), sensors=choice) as robot:
        found = config.load(robot.config)
        built = assemble(found)
    assert built.absent == {}
    assert {"left_insole", "right_insole", "trunk"} <= set(built.components)
    assert {insole.format for insole in found.insole.values()} == {choice.insole}
    trunk = tomllib.loads(robot.config.read_text(encoding="utf-8"))["imu"]["trunk"]
    assert choice.imu.startswith(trunk["format"])


def test_a_language_that_nobody_speaks_is_wrong_usage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert sim.main(["--dir", str(tmp_path), "--imu", "morse"]) == 2
    assert "bno08x-rvc" in capsys.readouterr().err
