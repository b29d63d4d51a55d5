"""The whole machine: the same seed gives the same bytes; what the sensors say fits together."""

import hashlib

from hil_sim.bus.can_bus import Frame
from hil_sim.exoskeleton import Exoskeleton, Scenario
from tests.unit.hil_sim.listener import Listener


def record(seed: int, seconds: float, slice_s: float) -> dict[str, str]:
    """Digests of everything the robot said, run in slices of simulated time."""
    robot = Exoskeleton(Scenario.WALK, seed)
    digests = {name: hashlib.sha256() for name in ("bus", *robot.sensors.lines)}
    for name, line in robot.sensors.lines.items():
        line.port = Listener(line.baudrate, digests[name].update)

    def hear(frame: Frame, _sender: object) -> None:
        digests["bus"].update(f"{robot.clock.now_ns} {frame.cob_id:03X} {frame.data.hex()}\n".encode())

    robot.bus.attach("listener", hear)
    robot.power_on()
    for index in range(1, round(seconds / slice_s) + 1):
        robot.clock.run_until(round(index * slice_s * 1e9))
    return {name: digest.hexdigest() for name, digest in digests.items()}


def test_the_same_seed_gives_the_same_bytes_however_time_is_sliced() -> None:
    assert record(seed=1, seconds=1.2, slice_s=0.4) == record(seed=1, seconds=1.2, slice_s=0.008)


def test_another_seed_gives_other_strides_and_other_noise() -> None:
    one, two = record(1, 2.0, 0.5), record(2, 2.0, 0.5)
    assert all(one[name] != two[name] for name in ("bus", "left_insole", "right_insole", "trunk"))


def test_the_bus_carries_the_robot_with_room_to_spare() -> None:
    robot = Exoskeleton()
    robot.power_on()
    robot.clock.run_until(2_009_000_000)  # between two SYNCs
    assert 0.15 < robot.bus.busy_ns / 2e9 < 0.35
    assert robot.bus.pending == 0
