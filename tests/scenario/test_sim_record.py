"""What `gwrms sim-record` writes is what a real gateway reports of the same robot, channel by channel."""

import bisect
import math
import time
from collections import defaultdict
from pathlib import Path

from gateway.config import load
from hil_sim.channels import UNITS, Values, reported
from hil_sim.exoskeleton import Scenario
from hil_sim.robot import SimulatedRobot
from tests.unit.gateway.harness import Client, serving

ROWS = 250  # of each channel
RESOLUTION = {"rad": 1.5e-4, "rad/s": 1e-6, "N": 1e-6, "m": 1e-6, "m/s²": 1e-6}  # a tilt goes round
AROUND_NS = 1_000_000_000  # the way through bus and terminal of a busy computer

Heard = dict[str, list[tuple[int, float | None]]]


def heard_of(client: Client) -> Heard:
    """Every sample of the recorded channels, with its own stamp."""
    client.call("stream.start", modules=["component"], rate_hz=0, channels=list(UNITS))
    heard: Heard = defaultdict(list)
    while set(heard) != set(UNITS) or min(map(len, heard.values())) < ROWS:
        data = client.data()
        for name, values in data["columns"].items():
            heard[name] += zip(data["stamp_ns"], values, strict=True)
    return heard


def among(recorded: list[float | None], value: float | None, unit: str) -> bool:
    """Whether a value is one of those recorded around then: with their noise, no two are the same."""
    if value is None:
        return None in recorded
    numbers = (number for number in recorded if number is not None)
    return any(math.isclose(value, number, rel_tol=1e-9, abs_tol=RESOLUTION[unit]) for number in numbers)


def test_a_real_gateway_reports_what_is_recorded(tmp_path: Path) -> None:
    robot = SimulatedRobot(
        tmp_path, Scenario.WALK, seed=3, virtual_channel=f"record {tmp_path.name}", person=2
    )
    recorded: list[tuple[int, Values]] = []
    robot.exoskeleton.measured.append(
        lambda: recorded.append((time.monotonic_ns(), reported(robot.exoskeleton)))
    )
    with robot, serving(load(robot.config)) as address, Client(address) as client:
        heard = heard_of(client)
    stamps = [stamp_ns for stamp_ns, _ in recorded]
    for column, (name, unit) in enumerate(UNITS.items()):
        found = []
        for stamp_ns, value in heard[name]:
            first = bisect.bisect_left(stamps, stamp_ns - AROUND_NS)
            last = bisect.bisect_right(stamps, stamp_ns + AROUND_NS)
            found.append(among([values[column] for _, values in recorded[first:last]], value, unit))
        assert all(found), (name, sum(found), len(found))
    moved = {name: [value for _, value in pairs if value is not None] for name, pairs in heard.items()}
    assert all(len(set(values)) > 20 for values in moved.values()), "everything moves while somebody walks"
