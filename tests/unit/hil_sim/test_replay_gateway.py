"""From a simulated walk to files, from the files to a gateway: the same values at the same times."""

import math
import statistics
from bisect import bisect
from pathlib import Path

from gateway.config import load
from hil_sim.replay.robot import ReplayedRobot
from tests.support.waiting import until
from tests.unit.gateway.harness import Client, serving
from tests.unit.hil_sim.outside import is_frame
from tests.unit.hil_sim.recording import Recording, record

COUNTS_PER_RADIAN = 409_600 / math.tau
TPDO_OF_KNEE = 0x182
SAMPLES = 150
A_LITTLE_N = 60.0  # of forces that swing between 0 and 900 N

Series = list[tuple[int, float]]


def test_a_gateway_sees_the_recorded_walk_again(tmp_path: Path) -> None:
    walk = record(tmp_path)
    found_n: list[float] = []

    def at_the_same_times() -> bool:
        """A computer that is too busy plays late, and not every line as late as the other."""
        found_n.append(statistics.median(errors(walk)))
        return found_n[-1] < A_LITTLE_N

    until(at_the_same_times, lambda: found_n)


def errors(walk: Recording) -> list[float]:
    """How far each force is from what was true when the position was recorded that came with it."""
    position, force = watched(walk)
    recorded = [message for message in walk.messages if is_frame(message, TPDO_OF_KNEE)]
    counts = [int.from_bytes(message.data[2:6], "little", signed=True) for message in recorded]
    at = place_of([round(value * COUNTS_PER_RADIAN) for _, value in position], counts * 3)

    def recorded_s(stamp_ns: int) -> float:
        """When that was recorded which the gateway stamped so."""
        number = bisect([stamp for stamp, _ in position], stamp_ns) - 1
        return recorded[(at + number) % len(recorded)].timestamp

    truth = {round(row["simulated_ns"] / 1e7): row["left_foot.force"] for row in walk.truth}
    found = [abs(newton - truth[round(recorded_s(stamp_ns) * 100)]) for stamp_ns, newton in force]
    assert len(found) > SAMPLES / 2
    return found


def watched(walk: Recording) -> tuple[Series, Series]:
    """The knee's position and the left foot's force as a gateway streams them while the walk is played."""
    position: Series = []
    force: Series = []
    columns = {"left_knee.position": position, "left_insole.force": force}
    robot = ReplayedRobot(walk.folder, [walk.log], walk.captures, loop=True, virtual_channel=str(walk.folder))
    with robot, serving(load(robot.config)) as address, Client(address) as client:
        client.call("stream.start", modules=["component"], rate_hz=0, channels=list(columns))

        def take() -> None:
            data = client.data()
            assert data["dropped"] == 0
            for name, series in columns.items():
                values = data["columns"].get(name, [])
                series += [
                    pair for pair in zip(data["stamp_ns"], values, strict=False) if pair[1] is not None
                ]

        def found() -> str:
            return f"only {len(position)} positions, {len(force)} forces"

        until(lambda: min(len(position), len(force)) >= SAMPLES, found, step=take)
    begins, ends = position[0][0], position[-1][0]
    return position, [pair for pair in force if begins <= pair[0] <= ends]


def place_of(part: list[int], whole: list[int]) -> int:
    """Where `part` stands in `whole`, value after value."""
    places = [at for at in range(len(whole) - len(part) + 1) if whole[at : at + len(part)] == part]
    assert places, "the gateway saw positions that were not recorded in this order"
    return places[0]
