"""Plausibility: no false alarm in half an hour of a normal wearer, and each seeded fault named.

The wearer is the simulator's; frames go through the real parsers and components, only the port is left out.
"""

import random
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from drivers.imu.device import Imu
from drivers.imu.settings import ImuSettings
from drivers.insole.build import pair
from drivers.insole.device import Insole
from drivers.insole.settings import InsoleSettings
from drivers.parsing import Parser
from drivers.samples import ComponentState
from hil_sim.gait.activity import Activity
from hil_sim.gait.generator import Generator
from hil_sim.gait.walk import Shape
from hil_sim.gait.wearer import Foot, Wearer
from hil_sim.sensors.faults import ImuFaults, InsoleFaults, LineFaults
from hil_sim.sensors.imus.witmotion import WITMOTION
from hil_sim.sensors.insoles.insole_cobs import CELLS, INSOLE
from hil_sim.sensors.serial_sensor import SerialSensor
from hil_sim.sensors.sole import Pressures, Sole
from hil_sim.sensors.trunk_imu import Motion, TrunkImu
from tests.unit.hil_sim.listener import Listener

SHAPE = Shape(step_length=0.40, cycle_time=1.2, toe_height=0.06, trunk_angle=0.15)

CellFault = Callable[[list[float], float], list[float]]  # Pa of each cell, time → Pa
MotionFault = Callable[[Motion, float], Motion]


@dataclass
class Seeded:
    """What is wrong with the robot: switches of the simulator, and what is done to what it measures."""

    left: InsoleFaults = field(default_factory=InsoleFaults)
    right: InsoleFaults = field(default_factory=InsoleFaults)
    trunk: ImuFaults = field(default_factory=ImuFaults)
    cells: CellFault = lambda pascal, _: pascal  # of the left foot
    motion: MotionFault = lambda motion, _: motion
    axes: tuple[str, str, str] | None = None


def fresh(component: Insole | Imu, now_ns: int) -> bool:
    """Whether the component's samples come, whatever they say."""
    return component._freshness.state(now_ns)[0] is ComponentState.OK


class Robot:
    """A wearer, two insoles and an IMU in simulated time, from bytes to quality.

    25 frames a second are what is judged of any faster stream.
    """

    def __init__(self, fault: Seeded, rate_hz: int = 25) -> None:
        self.fault = fault
        self.step_s = 1 / rate_hz
        self.now_s = 100.0
        self.generator = Generator(SHAPE)
        self.wearer = Wearer(self.generator)
        settings = InsoleSettings(port="-")
        self.insoles = [Insole("left_insole", settings), Insole("right_insole", settings)]
        pair(self.insoles)
        self.hips = [0.0, 0.0]
        self._hips_before = [leg.hip for leg in self.generator.legs()]
        self.insoles[0].hip_velocity = lambda _: self.hips[0]
        self.insoles[1].hip_velocity = lambda _: self.hips[1]
        self.imu = Imu("trunk", ImuSettings(port="-", axes=fault.axes))  # type: ignore[arg-type]
        feet = enumerate((fault.left, fault.right))
        self.soles = [Sole(CELLS, bool(side), faults, random.Random(side)) for side, faults in feet]
        self.sensor = TrunkImu(fault.trunk, random.Random(2))
        self.senders = [self._connected(insole) for insole in self.insoles]
        self.imu_sender = SerialSensor(WITMOTION, fault.trunk, random.Random(0))
        self.imu_sender.line.port = Listener(115200, self._feeder(self.imu, self.imu.line.parser))

    def _connected(self, insole: Insole) -> SerialSensor[Pressures]:
        sender = SerialSensor(INSOLE, LineFaults(), random.Random(0))
        sender.line.port = Listener(230400, self._feeder(insole, insole.line.parser))
        return sender

    def _feeder(self, component: Insole | Imu, parser: Parser[Any]) -> Callable[[bytes], None]:
        def feed(data: bytes) -> None:
            if frames := parser.feed(data):
                component.received(frames, round(self.now_s * 1e9))

        return feed

    def sample(self, rate_hz: float) -> None:
        """From now on so often: we do less, and nothing is lost."""
        self.step_s = 1 / rate_hz
        for losses in (*(one._losses for one in self.insoles), self.imu._losses):
            losses.restart()

    def live(self, activity: Activity, seconds: float) -> list[str]:
        """Every problem that was said meanwhile, once each."""
        said: set[str] = set()
        for tick in range(round(seconds / self.step_s)):
            self._tick(activity)
            if tick % 50 == 0:
                now_ns = round(self.now_s * 1e9)
                said |= {one.quality(now_ns).problem or "" for one in self.insoles if fresh(one, now_ns)}
                said |= {self.imu.quality(now_ns).problem or ""} if fresh(self.imu, now_ns) else set()
        return sorted(said - {""})

    def _tick(self, activity: Activity) -> None:
        self.now_s += self.step_s
        self.generator.step(self.step_s, activity, SHAPE)
        hips = [leg.hip for leg in self.generator.legs()]
        self.hips = [(a - b) / self.step_s for a, b in zip(hips, self._hips_before, strict=True)]
        self._hips_before = hips
        now_ns = round(self.now_s * 1e9)
        left, right = self.wearer.feet(self.now_s)
        self.senders[0].tell(self._left(left, right), now_ns)
        self.senders[1].tell(self.soles[1].measure(right, left, self.step_s), now_ns)
        motion = self.sensor.measure(self.wearer.trunk(self.now_s), self.step_s)
        self.imu_sender.tell(self.fault.motion(motion, self.now_s), now_ns)

    def _left(self, own: Foot, other: Foot) -> Pressures:
        felt = self.soles[0].measure(own, other, self.step_s)
        return replace(felt, pascal=tuple(self.fault.cells(list(felt.pascal), self.now_s)))


@pytest.mark.parametrize(("rounds", "minutes"), [(1, 1), (3, 10)])
def test_half_an_hour_of_a_normal_wearer_raises_no_alarm(rounds: int, minutes: int) -> None:
    """Half of it is walking."""
    robot = Robot(Seeded())
    said: list[str] = []
    for _ in range(rounds):
        said += robot.live(Activity.WALK, 30 * minutes)
        robot.sample(10)
        said += robot.live(Activity.STAND, 15 * minutes)
        said += robot.live(Activity.SIT, 12 * minutes)
        said += robot.live(Activity.STAND, 3 * minutes)
        robot.sample(25)
    assert said == []
    assert robot.insoles[0].check.landings > 16 * minutes * rounds


def cell(number: int, value: Callable[[float], float]) -> CellFault:
    """One cell says something else, by time."""
    return lambda pascal, now_s: [*pascal[:number], value(now_s), *pascal[number + 1 :]]


def loose(chance: random.Random) -> Callable[[float], float]:
    return lambda _: chance.choice((0.0, 3e5))


def times(factor: float) -> CellFault:
    return lambda pascal, _: [factor * one for one in pascal]


def heavier(factor: float) -> MotionFault:
    def change(motion: Motion, _now_s: float) -> Motion:
        x, y, z = motion.acceleration
        return replace(motion, acceleration=(factor * x, factor * y, factor * z))

    return change


def spinning(motion: Motion, now_s: float) -> Motion:
    return replace(motion, rate=(30.0, 30.0, 30.0)) if int(now_s * 50) % 40 == 0 else motion


def backwards(motion: Motion, _now_s: float) -> Motion:
    """Attitude of the opposite sense, as an axis order taken from another driver gives."""
    (roll, pitch, yaw), (w, x, y, z) = motion.angles, motion.orientation
    return replace(motion, angles=(-roll, -pitch, -yaw), orientation=(w, -x, -y, -z))


def frozen_in_stance() -> Seeded:
    """An insole that hangs at the first moment under load."""
    fault = Seeded()

    def freeze(pascal: list[float], now_s: float) -> list[float]:
        fault.left.frozen = fault.left.frozen or (now_s > 105.0 and sum(pascal) > 5e5)
        return pascal

    fault.cells = freeze
    return fault


CASES: dict[str, tuple[Callable[[], Seeded], str]] = {
    "left and right insole swapped": (
        lambda: Seeded(left=InsoleFaults(swapped=True), right=InsoleFaults(swapped=True)),
        "left and right are swapped",
    ),
    "stuck cell": (lambda: Seeded(left=InsoleFaults(stuck_cell=9)), "cell 9 is stuck"),
    "dead cell": (lambda: Seeded(cells=cell(9, lambda _: 0.0)), "cell 9 felt nothing"),
    "insole frozen": (frozen_in_stance, "same values again and again"),
    "insole unplugged and still sending": (lambda: Seeded(cells=times(0.0)), "does not feel the steps"),
    "loose cell": (
        lambda: Seeded(cells=cell(3, loose(random.Random(1)))),
        "cell 3 jumps",
    ),
    "insole saturated": (lambda: Seeded(left=InsoleFaults(saturated=True)), "cell at the end of its range"),
    "insole ten times too high": (lambda: Seeded(cells=times(10.0)), "scale is off"),
    "insole ten times too low": (lambda: Seeded(cells=times(0.1)), "scale is off"),
    "sign of the tilt": (lambda: Seeded(motion=backwards), "tilt and gravity disagree"),
    "IMU upside down": (lambda: Seeded(axes=("x", "-y", "-z")), "upside down"),
    "IMU hangs": (lambda: Seeded(trunk=ImuFaults(frozen=True)), "same acceleration"),
    "acceleration ten times too high": (lambda: Seeded(motion=heavier(10.0)), "scale is off"),
    "acceleration ten times too low": (lambda: Seeded(motion=heavier(0.1)), "scale is off"),
    "impossible rates": (lambda: Seeded(motion=spinning), "faster than"),
}

SINCE_AND_CHECK = re.compile(r" \(for \d+ s\): (check|correct|restart)")


@pytest.mark.parametrize("name", CASES)
def test_seeded_fault_and_nothing_else_is_named_within_a_minute_of_walking(name: str) -> None:
    fault, expected = CASES[name]
    robot = Robot(fault())
    said: list[str] = []
    while not any(expected in problem for problem in said):
        assert robot.now_s < 160.0, said
        said += robot.live(Activity.WALK, 10)
    said += robot.live(Activity.WALK, 10)
    assert all(SINCE_AND_CHECK.search(problem) for problem in said), said
    assert [problem for problem in said if expected not in problem] == []
