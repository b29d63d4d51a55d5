"""What `gwrms sim-record` writes is what a real gateway reports of the same robot, channel by channel."""

import math
from collections import defaultdict
from pathlib import Path

from gateway.config import load
from hil_sim.channels import UNITS, Values, reported
from hil_sim.exoskeleton import Scenario
from hil_sim.robot import SimulatedRobot
from tests.unit.gateway.harness import Client, serving

ROWS = 60  # of each channel
RESOLUTION = {"rad": 1.5e-4, "rad/s": 1e-6, "N": 1e-6, "m": 1e-6, "m/s²": 1e-6}  # a tilt goes round

Heard = dict[str, list[float | None]]


def heard_of(client: Client) -> Heard:
    """Every sample of the recorded channels."""
    client.call("stream.start", modules=["component"], rate_hz=0, channels=list(UNITS))
    heard: Heard = defaultdict(list)
    while set(heard) != set(UNITS) or min(map(len, heard.values())) < ROWS:
        data = client.data()
        for name, values in data["columns"].items():
            heard[name] += values
    return heard


def same(recorded: float | None, value: float | None, unit: str) -> bool:
    if value is None or recorded is None:
        return value is recorded
    return math.isclose(value, recorded, rel_tol=1e-9, abs_tol=RESOLUTION[unit])


def known(recorded: list[float | None], heard: list[float | None], unit: str) -> int:
    """How many values were recorded, each after the one before.

    In their order, not at their time: on a busy computer it is long before one has come through bus or
    terminal. With their noise no two are the same.
    """
    place = 0
    for count, value in enumerate(heard):
        while place < len(recorded) and not same(recorded[place], value, unit):
            place += 1
        if place == len(recorded):
            return count
    return len(heard)


def test_a_real_gateway_reports_what_is_recorded(tmp_path: Path) -> None:
    robot = SimulatedRobot(
        tmp_path, Scenario.WALK, seed=3, virtual_channel=f"record {tmp_path.name}", person=2
    )
    recorded: list[Values] = []
    robot.exoskeleton.measured.append(lambda: recorded.append(reported(robot.exoskeleton)))
    with robot, serving(load(robot.config)) as address, Client(address) as client:
        heard = heard_of(client)
    for column, (name, unit) in enumerate(UNITS.items()):
        found = known([values[column] for values in recorded], heard[name], unit)
        assert found == len(heard[name]), (name, found, len(heard[name]))
    moved = {name: [value for value in values if value is not None] for name, values in heard.items()}
    assert all(len(set(values)) > 20 for values in moved.values()), "everything moves while somebody walks"
