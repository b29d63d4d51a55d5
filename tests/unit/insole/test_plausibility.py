"""Plausibility: no false alarm in half an hour of a normal wearer, and each seeded fault named.

The wearer is the simulator's; frames go through the real parsers and components, only the port is left out.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from drivers.imu.device import Imu
from drivers.imu.settings import ImuSettings
from drivers.imu.witmotion import WitmotionParser
from drivers.insole.cobs import InsoleCobsParser
from drivers.insole.device import Insole, pair
from drivers.insole.settings import InsoleSettings
from drivers.samples import State
from hil_sim.gait.generator import Activity, Generator
from hil_sim.gait.walk import Shape
from hil_sim.gait.wearer import Foot, Trunk, Wearer
from hil_sim.sensors.imu import Imu as SimulatedImu
from hil_sim.sensors.insole import Insole as SimulatedInsole
from hil_sim.sensors.insole import encode

SHAPE = Shape(step_length=0.40, cycle_time=1.2, toe_height=0.06, trunk_angle=0.15)
CALIBRATED, RIGHT = 2, 1

Counts = list[int]
CellFault = Callable[[Counts, Counts, float], Counts]  # counts, the frame before, time → counts


def _nothing(counts: Counts, _before: Counts, _now_s: float) -> Counts:
    return counts


@dataclass
class Seeded:
    """What is wrong with the robot."""

    left: CellFault = _nothing
    swapped: bool = False
    trunk: Callable[[Trunk], Trunk] = lambda trunk: trunk
    imu_bytes: Callable[[bytes, float], bytes] = lambda data, _: data
    axes: tuple[str, str, str] | None = None


def fresh(component: Insole | Imu, now_ns: int) -> bool:
    """Whether the component's samples come, whatever they say."""
    return component._freshness.state(now_ns)[0] is State.OK


class Robot:
    """A wearer, two insoles and an IMU in simulated time, from bytes to quality."""

    def __init__(self, fault: Seeded, rate_hz: int = 50) -> None:
        self.fault = fault
        self.step_s = 1 / rate_hz
        self.now_s = 100.0
        self.generator = Generator(SHAPE)
        self.wearer = Wearer(self.generator)
        sources = [random.Random(f"{side}") for side in ("left", "right", "trunk")]
        self.sent = [SimulatedInsole(False, sources[0]), SimulatedInsole(True, sources[1])]
        self.sent_imu = SimulatedImu(sources[2])
        settings = InsoleSettings(port="-")
        self.insoles = [Insole("left_insole", settings), Insole("right_insole", settings)]
        pair(self.insoles)
        self.hips = [0.0, 0.0]
        self._hips_before = [leg.hip for leg in self.generator.legs()]
        self.insoles[0].hip_velocity = lambda _: self.hips[0]
        self.insoles[1].hip_velocity = lambda _: self.hips[1]
        self.imu = Imu("trunk", ImuSettings(port="-", axes=fault.axes))  # type: ignore[arg-type]
        self.parsers = [InsoleCobsParser(), InsoleCobsParser()]
        self.imu_parser = WitmotionParser()
        self._counts = [[0] * 16, [0] * 16]
        self._sequence = 0

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
        self._sequence += 1
        feet = self.wearer.feet(self.now_s)
        for side, foot in enumerate(feet[::-1] if self.fault.swapped else feet):
            for frame in self.parsers[side].feed(self._insole_frame(side, foot)):
                self.insoles[side].received(frame, now_ns)
        trunk = self.fault.trunk(self.wearer.trunk())
        data = self.fault.imu_bytes(self.sent_imu.frames(trunk, self.step_s), self.now_s)
        for sample in self.imu_parser.feed(data):
            self.imu.received(sample, now_ns)

    def _insole_frame(self, side: int, foot: Foot) -> bytes:
        if self.fault.swapped:
            foot = replace(foot, cop_y=-foot.cop_y)
        counts = [self.sent[side]._measure(pressure) for pressure in self.sent[side].pressures(foot)]
        if side == 0:
            counts = self.fault.left(counts, self._counts[side], self.now_s)
        self._counts[side] = counts
        flags = CALIBRATED | (RIGHT if side else 0)
        return encode(flags, self._sequence, int(self.now_s * 1e6), [min(c, 65535) for c in counts])


@pytest.mark.timeout(300)
def test_half_an_hour_of_a_normal_wearer_raises_no_alarm() -> None:
    robot = Robot(Seeded())
    said: list[str] = []
    for _ in range(3):
        said += robot.live(Activity.WALK, 300)
        robot.step_s = 1 / 20
        said += robot.live(Activity.STAND, 150)
        said += robot.live(Activity.SIT, 120)
        said += robot.live(Activity.STAND, 30)
        robot.step_s = 1 / 50
    assert said == []
    assert robot.insoles[0].check.landings > 500


def stuck(counts: Counts, before: Counts, now_s: float) -> Counts:
    return [*counts[:9], 731, *counts[10:]]


def dead(counts: Counts, before: Counts, now_s: float) -> Counts:
    return [*counts[:9], 0, *counts[10:]]


def frozen(counts: Counts, before: Counts, now_s: float) -> Counts:
    return before if sum(before) > 4000 else counts


def unplugged(counts: Counts, before: Counts, now_s: float) -> Counts:
    return [0] * 16


def loose(counts: Counts, before: Counts, now_s: float) -> Counts:
    return [*counts[:3], 0 if int(now_s * 50) % 2 else 3000, *counts[4:]]


def ten_times(counts: Counts, before: Counts, now_s: float) -> Counts:
    return [count * 10 for count in counts]


def a_tenth(counts: Counts, before: Counts, now_s: float) -> Counts:
    return [round(count / 10) for count in counts]


def words(data: bytes, kind: int, change: Callable[[int], int]) -> bytes:
    """The frames in `data` with the three values of one kind changed."""
    out = b""
    for at in range(0, len(data), 11):
        frame = bytearray(data[at : at + 11])
        if frame[1] == kind:
            for place in (2, 4, 6):
                value = change(int.from_bytes(frame[place : place + 2], "little", signed=True))
                frame[place : place + 2] = max(-32768, min(32767, value)).to_bytes(2, "little", signed=True)
            frame[10] = sum(frame[:10]) & 0xFF
        out += bytes(frame)
    return out


def hang(data: bytes, now_s: float) -> bytes:
    return words(data, 0x51, lambda _: 700)


def heavy(data: bytes, now_s: float) -> bytes:
    return words(data, 0x51, lambda value: value * 10)


def light(data: bytes, now_s: float) -> bytes:
    return words(data, 0x51, lambda value: value // 10)


def spinning(data: bytes, now_s: float) -> bytes:
    return words(data, 0x52, lambda value: 32767 if int(now_s * 50) % 40 == 0 else value)


def backwards(data: bytes, now_s: float) -> bytes:
    """Angles and quaternion of the opposite sense, as an axis order taken from another driver gives."""
    return words(words(data, 0x53, lambda value: -value), 0x59, lambda value: value)[:33]


CASES: dict[str, tuple[Seeded, str]] = {
    "left and right insole swapped": (Seeded(swapped=True), "left and right are swapped"),
    "stuck cell": (Seeded(left=stuck), "cell 9 is stuck"),
    "dead cell": (Seeded(left=dead), "cell 9 felt nothing"),
    "insole frozen": (Seeded(left=frozen), "same values again and again"),
    "insole unplugged and still sending": (Seeded(left=unplugged), "does not feel the steps"),
    "loose cell": (Seeded(left=loose), "cell 3 jumps"),
    "insole ten times too high": (Seeded(left=ten_times), "scale is off"),
    "insole ten times too low": (Seeded(left=a_tenth), "scale is off"),
    "sign of the tilt": (Seeded(imu_bytes=backwards), "tilt and gravity disagree"),
    "IMU upside down": (Seeded(axes=("x", "-y", "-z")), "upside down"),
    "IMU hangs": (Seeded(imu_bytes=hang), "same acceleration"),
    "acceleration ten times too high": (Seeded(imu_bytes=heavy), "scale is off"),
    "acceleration ten times too low": (Seeded(imu_bytes=light), "scale is off"),
    "impossible rates": (Seeded(imu_bytes=spinning), "faster than"),
}


@pytest.mark.parametrize("name", CASES)
def test_seeded_fault_and_nothing_else_is_named_within_a_minute_of_walking(name: str) -> None:
    fault, expected = CASES[name]
    said = Robot(fault).live(Activity.WALK, 60)
    assert any(expected in problem for problem in said), said
    assert [problem for problem in said if expected not in problem] == []
