"""The sensors that a robot wears: two insoles and a trunk IMU, in the languages that were chosen."""

import random
from dataclasses import dataclass
from typing import Protocol

import eds
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock
from hil_sim.gait.wearer import Foot, Trunk
from hil_sim.node.node import Node
from hil_sim.sensors import cia410, insole_cobs, insole_csv, insole_frame
from hil_sim.sensors.bno08x_rvc import BNO08X_RVC
from hil_sim.sensors.cia410 import Inclinometer
from hil_sim.sensors.faults import ImuFaults, InsoleFaults, LineFaults
from hil_sim.sensors.line import SerialLine
from hil_sim.sensors.serial_sensor import M, SerialFormat, SerialSensor
from hil_sim.sensors.sole import Cell, Pressures, Sole
from hil_sim.sensors.trunk_imu import Motion, TrunkImu
from hil_sim.sensors.vectornav import VECTORNAV, VECTORNAV_BINARY
from hil_sim.sensors.witmotion import WITMOTION
from hil_sim.sensors.witmotion_can import WitmotionCan
from hil_sim.sensors.xsens import XSENS

FEET = ("left_insole", "right_insole")
TRUNK = "trunk"
PERIOD_NS = 10 * MILLISECOND_NS  # 100 Hz

SERIAL_IMUS: dict[str, SerialFormat[Motion]] = {
    "witmotion": WITMOTION,
    "bno08x-rvc": BNO08X_RVC,
    "xsens": XSENS,
    "vectornav": VECTORNAV,
    "vectornav-binary": VECTORNAV_BINARY,
}
IMUS = (*SERIAL_IMUS, "witmotion-can", "cia410")
INSOLES: dict[str, tuple[SerialFormat[Pressures], tuple[Cell, ...]]] = {
    "insole-cobs": (insole_cobs.INSOLE_COBS, insole_cobs.CELLS),
    "insole-csv": (insole_csv.INSOLE_CSV, insole_csv.CELLS),
    "insole-frame": (insole_frame.INSOLE_FRAME, insole_frame.CELLS),
}


@dataclass(frozen=True, slots=True)
class SensorChoice:
    """Which languages they speak: one of `IMUS` and one of `INSOLES`."""

    imu: str = "witmotion"
    insole: str = "insole-cobs"


class TrunkSensor(Protocol):
    """What tells the trunk's motion, over whatever line."""

    def tell(self, measured: Motion, now_ns: int, /) -> None: ...


class SensorSuite:
    """Both insoles and the IMU; what is wrong with each is set in `faults`, by name.

    `lines` are the serial ones by the sensors' names: an IMU on the CAN bus has none. `pressures` (left,
    right) and `motion` are what was measured last; there is nothing before the first cycle.
    """

    pressures: tuple[Pressures, Pressures]
    motion: Motion

    def __init__(self, choice: SensorChoice, clock: Clock, bus: CanBus, seed: int) -> None:
        self.choice = choice
        self.insole_faults = {name: InsoleFaults() for name in FEET}
        self.imu_faults = ImuFaults()
        self.faults: dict[str, LineFaults] = {**self.insole_faults, TRUNK: self.imu_faults}
        self.lines: dict[str, SerialLine] = {}
        self._clock = clock
        self._last_ns = clock.now_ns - PERIOD_NS
        self._soles = [self._sole(choice.insole, name, seed) for name in FEET]
        self._senders = [self._serial(INSOLES[choice.insole][0], name, seed) for name in FEET]
        self._imu = TrunkImu(self.imu_faults, random.Random(f"{seed} {TRUNK}"))
        self._trunk = self._trunk_sensor(choice.imu, bus, seed)

    @property
    def nodes(self) -> list[Node]:
        """Those that are CANopen devices."""
        return [self._trunk] if isinstance(self._trunk, Node) else []

    def measure(self, left: Foot, right: Foot, trunk: Trunk) -> None:
        """One cycle of every sensor, a time after the last one."""
        now_ns = self._clock.now_ns
        period_s, self._last_ns = (now_ns - self._last_ns) / SECOND_NS, now_ns
        left_sole, right_sole = self._soles
        self.pressures = left_sole.measure(left, right, period_s), right_sole.measure(right, left, period_s)
        for sender, pressures in zip(self._senders, self.pressures, strict=True):
            sender.tell(pressures, now_ns)
        self.motion = self._imu.measure(trunk, period_s)
        self._trunk.tell(self.motion, now_ns)

    def _sole(self, language: str, name: str, seed: int) -> Sole:
        noise = random.Random(f"{seed} {name}")
        return Sole(INSOLES[language][1], name == FEET[1], self.insole_faults[name], noise)

    def _serial(self, language: SerialFormat[M], name: str, seed: int) -> SerialSensor[M]:
        sensor = SerialSensor(language, self.faults[name], random.Random(f"{seed} {name} line"))
        self.lines[name] = sensor.line
        return sensor

    def _trunk_sensor(self, language: str, bus: CanBus, seed: int) -> TrunkSensor:
        if language in SERIAL_IMUS:
            return self._serial(SERIAL_IMUS[language], TRUNK, seed)
        if language == "witmotion-can":
            return WitmotionCan(bus, self.faults[TRUNK])
        description = eds.load(eds.locate(cia410.EDS, None), cia410.NODE_ID)
        return Inclinometer(self._clock, bus, TRUNK, description, self.faults[TRUNK])
