"""Gateway and simulator, each a process of its own, on a real bus; and simulators beside each other."""

import re
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import can
import pytest

from gateway.client import Address, LinkSettings, Robot
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import CONTROLLER, JOINTS
from hil_sim.robot import SimulatedRobot
from tests.scenario.processes import Bench
from tests.socketcan.link import NAME, needs_vcan, set_up
from tests.support.waiting import until

DOWN = f"{NAME} is down; run: sudo ip link set {NAME} up"
LEFT = [name for name in JOINTS if name.startswith("left")]
RIGHT = [name for name in JOINTS if name.startswith("right")]

pytestmark = [needs_vcan, pytest.mark.usefixtures("link_is_up")]

# A computer as slow as User Mode Linux keeps up with a robot in slow motion, and needs patience with it.
SLOW_MOTION = "0.1"
PATIENCE = """bus = "main"
sdo_timeout_s = 20
heartbeat_timeout_s = 20
stale_after_s = 20
lost_after_s = 60
"""


class BusBench(Bench):
    """The same on the interface."""

    simulator_options = ("--bus", f"socketcan:{NAME}", "--speed", SLOW_MOTION, "--scenario", "stand")

    def start_simulator(self) -> None:
        super().start_simulator()
        text = self.config.read_text(encoding="utf-8")
        text = re.sub(r'^bus = "main".*\n', PATIENCE, text, flags=re.MULTILINE)
        self.config.write_text(text, encoding="utf-8")

    def is_whole(self) -> bool:
        """Whether what is on the bus is; to serial sensors slow motion looks like a clock that is wrong."""
        states = self.states()
        return all(states[name] == "ok" for name in (*JOINTS, CONTROLLER))

    def problems(self) -> dict[str, str | None]:
        quality = self.ask("component.snapshot")["quality"]
        return {name: found["problem"] for name, found in quality.items()}

    def said(self) -> str:
        """What the simulator has said on the way."""
        self.simulator.check()
        return self.simulator.last_words()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[BusBench]:
    with ExitStack() as processes:
        bench = BusBench(tmp_path, processes)
        bench.until_whole()
        yield bench


def test_a_robot_on_a_real_bus_is_seen_tuned_and_stopped_and_comes_back_with_its_link(
    bench: BusBench,
) -> None:
    with Robot(Address(port=bench.port), LinkSettings(silence_s=60.0)) as robot:
        assert robot.write({"gait.step_length": 0.42}).after == {"gait.step_length": 0.42}
        set_up(False)
        until(lambda: DOWN in str(bench.problems()["left_hip"]), bench.problems)
        until(lambda: f"gwrms sim: {DOWN}" in bench.said(), bench.said)
        set_up(True)
        until(lambda: f"gwrms sim: {NAME} carries frames again" in bench.said(), bench.said)
        bench.until_whole()
        assert robot.read("gait.step_length").values["gait.step_length"].value == pytest.approx(0.42)
        until(lambda: set(robot.stop("the test is over").drives.values()) == {"confirmed"})


@pytest.mark.parametrize(
    ("interface", "words"),
    [(NAME, DOWN), ("lo", "lo is no CAN interface"), ("vcan9", "ip link add vcan9 type vcan")],
)
def test_an_interface_that_cannot_be_used_is_refused_in_words(
    interface: str, words: str, tmp_path: Path
) -> None:
    set_up(False)
    with pytest.raises(SimulatorError, match=words):
        SimulatedRobot(tmp_path, interface=interface).open()


def test_simulators_beside_each_other_share_the_bus_and_its_node_ids(
    tmp_path: Path, peer: can.BusABC
) -> None:
    right = SimulatedRobot(tmp_path / "right", interface=NAME, without=[*LEFT, CONTROLLER])
    left = SimulatedRobot(tmp_path / "left", interface=NAME, without=[*RIGHT, CONTROLLER])
    both = SimulatedRobot(tmp_path / "both", interface=NAME)
    with right, left:
        until(lambda: answering(peer) == list(JOINTS.values()))
        with pytest.raises(SimulatorError, match=f"another device on {NAME} has node id "):
            both.open()
    assert [described(robot) for robot in (right, left)] == [RIGHT, LEFT]


def answering(peer: can.BusABC) -> list[int]:
    """The node ids of all answers to one SDO request a joint: its device type."""
    answers = []
    peer.set_filters([{"can_id": 0x580, "can_mask": 0x780, "extended": False}])
    for node in JOINTS.values():
        request = bytes.fromhex("40 00 10 00 00 00 00 00")
        peer.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
    while (message := peer.recv(timeout=1.0)) is not None:
        answers.append(message.arbitration_id & 0x7F)
    return sorted(answers)


def described(robot: SimulatedRobot) -> list[str]:
    """The joints in its robot.toml."""
    return list(tomllib.loads(robot.config.read_text(encoding="utf-8"))["joint"])
