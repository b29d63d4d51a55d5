"""The sensors that a robot wears: two insoles and a trunk IMU, in the languages that were chosen."""

import importlib
import pkgutil
import random
from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType

from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock
from hil_sim.gait.wearer import Foot, Trunk
from hil_sim.node.node import Node
from hil_sim.sensors import imus, insoles
from hil_sim.sensors.faults import ImuFaults, InsoleFaults, LineFaults
from hil_sim.sensors.line import SerialLine
from hil_sim.sensors.serial_sensor import M, SerialFormat, SerialSensor
from hil_sim.sensors.sole import Cell, Pressures, Sole
from hil_sim.sensors.trunk_imu import BusImu, Motion, TrunkImu, TrunkSensor

FEET = ("left_insole", "right_insole")
TRUNK = "trunk"
PERIOD_NS = 10 * MILLISECOND_NS  # 100 Hz


def _files(package: ModuleType) -> Iterator[tuple[str, ModuleType]]:
    """Yield the package's modules by the names of their devices."""
    for found in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        yield found.name.rpartition(".")[2].replace("_", "-"), importlib.import_module(found.name)


_IMUS: dict[str, SerialFormat[Motion] | BusImu] = {
    name: one for _, file in _files(imus) for name, one in file.IMUS.items()
}
SERIAL_IMUS = {name: one for name, one in _IMUS.items() if isinstance(one, SerialFormat)}
BUS_IMUS = {name: one for name, one in _IMUS.items() if isinstance(one, BusImu)}
IMUS = (*SERIAL_IMUS, *BUS_IMUS)
INSOLES: dict[str, tuple[SerialFormat[Pressures], tuple[Cell, ...]]] = {
    name: (file.INSOLE, file.CELLS) for name, file in _files(insoles)
}


@dataclass(frozen=True, slots=True)
class SensorChoice:
    """Formats of the sensors: one of `IMUS` and one of `INSOLES`."""

    imu: str = "witmotion"
    insole: str = "insole-cobs"


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
        return BUS_IMUS[language].make(self._clock, bus, TRUNK, self.faults[TRUNK])
