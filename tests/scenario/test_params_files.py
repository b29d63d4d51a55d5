"""Configurations as files, and what drives keep over a reset, on the simulated robot."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from eds import dcf
from gateway.config import load
from gateway.main import main
from hil_sim.robot import SimulatedRobot
from tests.support.waiting import until
from tests.unit.gateway.harness import Client, serving

OFFER = '[joint.left_knee]\nparameters = "eds"\nrelease = ["position_control_*", "profile_*"]\n'
GAIN = "left_knee.position_gain"
TORQUE = "left_knee.max_torque"


class Served:
    """The commands and a client, on one gateway."""

    def __init__(self, robot: SimulatedRobot, address: tuple[str, int], client: Client) -> None:
        self.robot = robot
        self.client = client
        self._address = f"{address[0]}:{address[1]}"

    def run(self, *arguments: str) -> int:
        return main([*arguments, "--robot", self._address])

    def value(self, name: str) -> Any:
        return self.client.call("parameter.read", names=[name])["values"][name]["value"]

    def stop(self) -> None:
        """Every drive at rest, so that what is not live can be written."""
        self.client.call("robot.stop", reason="test")
        until(lambda: not self._moving(), "switched off")

    def _moving(self) -> bool:
        values = self.client.call("component.snapshot", channels=["*.state"])["values"]
        return any(state is None or state >= 4 for state in values.values())


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.chdir(tmp_path)
    with SimulatedRobot(tmp_path, virtual_channel=f"files {tmp_path.name}") as robot:
        text = robot.config.read_text(encoding="utf-8").replace("[joint.left_knee]\n", OFFER)
        robot.config.write_text(text, encoding="utf-8")
        with serving(load(robot.config)) as address, Client(address) as client:
            made = Served(robot, address, client)
            until(lambda: None not in _values(client), "every parameter can be read")
            yield made


def _values(client: Client) -> list[Any]:
    return [one["value"] for one in client.call("parameter.read")["values"].values()]


@pytest.mark.parametrize("file", ["all.toml", "knee.dcf"])
def test_save_same_change_different_apply_same(served: Served, file: str) -> None:
    one = ("--component", "left_knee")
    served.stop()
    assert served.run("params", "save", file, *one) == 0
    assert served.run("params", "compare", file, *one) == 0
    assert served.run("set", f"{GAIN}=2500", f"{TORQUE}=60", "left_knee.profile_velocity=2") == 0
    assert served.run("params", "compare", file, *one) == 1
    assert served.run("params", "apply", file, *one, "--yes") == 0
    assert served.run("params", "compare", file, *one) == 0
    assert (served.value(GAIN), served.value(TORQUE)) == (3000, 80)


def test_a_dcf_holds_all_of_a_drive_and_a_walking_robot_takes_what_is_live_alone(served: Served) -> None:
    assert served.run("params", "save", "knee.dcf", "--component", "left_knee") == 0
    values = dcf.read(Path("knee.dcf"), 2).values
    assert len(values) > 80
    assert (values[0x6072, 0], values[0x1017, 0], values[0x2030, 1]) == (2000, 100, 3000)
    assert values[0x1400, 1] == 0x202  # as the drive has it, not as the EDS has it for any node
    assert not {(0x6040, 0), (0x607A, 0), (0x6060, 0), (0x1010, 1)} & values.keys()
    assert served.run("params", "save", "a.toml", "gait.*", "left_knee.*") == 0
    text = Path("a.toml").read_text()
    Path("a.toml").write_text(text.replace('gait.step_length" = 0.4', 'gait.step_length" = 0.45'))
    assert served.run("params", "apply", "a.toml", "--yes") == 0
    assert served.value("gait.step_length") == 0.45
    both = text.replace('gait.step_length" = 0.4', 'gait.step_length" = 0.35').replace(" = 3000", " = 2900")
    Path("a.toml").write_text(both)
    assert served.run("params", "apply", "a.toml", "--yes") == 1
    assert (served.value("gait.step_length"), served.value(GAIN)) == (0.45, 3000)


def test_what_is_stored_outlives_a_power_cut_and_what_is_restored_is_the_default(served: Served) -> None:
    assert served.run("store", "left_knee") == 1  # it walks
    served.stop()
    assert served.run("set", f"{TORQUE}=60") == 0
    assert _torque_after_power_cut(served) == 80
    assert served.run("set", f"{TORQUE}=60") == 0
    assert served.run("store", "left_knee") == 0
    assert _torque_after_power_cut(served) == 60
    assert served.run("restore", "left_knee", "--yes") == 0
    assert served.value(TORQUE) == 60  # until its next reset
    assert _torque_after_power_cut(served) == 80


def _torque_after_power_cut(served: Served) -> Any:
    drive = served.robot.exoskeleton.drives["left_knee"]
    boots = served.client.call("component.snapshot")["quality"]["left_knee"]["boots"]
    drive.power_off()
    drive.power_on()

    def is_back() -> bool:
        quality = served.client.call("component.snapshot")["quality"]["left_knee"]
        return bool(quality["boots"] > boots and quality["state"] == "ok")

    until(is_back, "the knee is there again")
    return served.value(TORQUE)
