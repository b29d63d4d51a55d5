"""Simulated sensors on their terminals and bus, our drivers at the other end, and what is true in between."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from drivers.component import Component
from drivers.samples import ComponentState, Sample
from gateway import config
from gateway.modules.component.assembly import assemble
from hil_sim import robot_file
from hil_sim.bus.can_bus import CanBus
from hil_sim.bus.virtual import VirtualBridge
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.gait.wearer import Foot, Trunk
from hil_sim.sensors.serial_port import SerialPort
from hil_sim.sensors.suite import FEET, PERIOD_NS, TRUNK, SensorChoice, SensorSuite
from hil_sim.sensors.tables import companions, tables
from tests.support.waiting import until

STEP_NS = PERIOD_NS + MILLISECOND_NS  # what is sent each period has arrived by then


class Wearer:
    """Somebody who sways, turns and shifts from foot to foot, further than anybody walks."""

    def trunk(self, t: float) -> Trunk:
        return Trunk(
            roll=0.4 * math.sin(3 * t),
            pitch=0.2 + 0.5 * math.sin(2 * t),
            yaw=0.3 * math.sin(t),
            acceleration=(math.sin(5 * t), math.cos(4 * t), 2 * math.sin(6 * t)),
        )

    def feet(self, t: float) -> tuple[Foot, Foot]:
        swing = math.sin(2 * t)
        return Foot(450 + 350 * swing, 0.11 + 0.08 * swing, 0.005), Foot(450 - 350 * swing, 0.12, -0.004)


class Bench:
    """The sensors in a folder; simulated time moves only by `step`."""

    def __init__(self, folder: Path, choice: SensorChoice) -> None:
        self.config = folder / "robot.toml"
        self.clock = Clock()
        bus = CanBus(self.clock)
        self.suite = SensorSuite(choice, self.clock, bus, seed=1)
        self._bridge = VirtualBridge(bus, str(folder))
        self._ports = {
            name: SerialPort(folder / name, line.baudrate) for name, line in self.suite.lines.items()
        }
        for name, line in self.suite.lines.items():
            line.port = self._ports[name]
        self._wearer = Wearer()
        self.trunk = self.trunk_before = self._wearer.trunk(0.0)
        self.feet = self._wearer.feet(0.0)
        self._describe(folder, choice)

    def _describe(self, folder: Path, choice: SensorChoice) -> None:
        bus = robot_file.virtual_bus(str(folder))
        self.config.write_text(f'[robot]\nname = "x"\n{bus}{tables(choice, folder)}', encoding="utf-8")
        for name, content in companions(choice).items():
            (folder / name).write_text(content, encoding="utf-8")

    def step(self) -> None:
        """Measure, and let what is sent arrive."""
        now_s = self.clock.now_s
        self.trunk_before, self.trunk, self.feet = (
            self.trunk,
            self._wearer.trunk(now_s),
            self._wearer.feet(now_s),
        )
        self.suite.measure(*self.feet, self.trunk)
        self.clock.run_until(self.clock.now_ns + STEP_NS)

    @property
    def fetched(self) -> bool:
        """Whether the drivers have read all that was sent."""
        return all(port._waiting() == 0 for port in self._ports.values())

    def close(self) -> None:
        self._bridge.close()
        for port in self._ports.values():
            port.close()


class Watched:
    """A component, and the newest value of each of its channels however old."""

    def __init__(self, component: Component) -> None:
        self.component = component
        self.values: dict[str, float | None] = {}
        component.latest.subscribe(self._note)

    def _note(self, sample: Sample) -> None:
        quantities = (self.component.channels[index].quantity for index in sample.indices)
        self.values |= zip(quantities, sample.values, strict=True)

    @property
    def live(self) -> bool:
        return self.component.quality(time.monotonic_ns()).state in (ComponentState.OK, ComponentState.FAULT)

    @property
    def problem(self) -> str:
        return self.component.quality(time.monotonic_ns()).problem or ""

    def counter(self, name: str) -> int:
        return self.component.quality(time.monotonic_ns()).counters[name]

    def of(self, *quantities: str) -> list[float]:
        """The values that have ever come of these."""
        return [value for quantity in quantities if (value := self.values.get(quantity)) is not None]


@contextmanager
def driven(folder: Path, choice: SensorChoice) -> Iterator[tuple[Bench, dict[str, Watched]]]:
    """A bench, and its sensors' components, which are up and have had their first values."""
    bench = Bench(folder, choice)
    robot = assemble(config.load(bench.config))
    watched = {name: Watched(robot.components[name]) for name in (*FEET, TRUNK)}
    try:
        for one in watched.values():
            one.component.start()
        steps_until(bench, lambda: all(one.live and one.values for one in watched.values()))
        yield bench, watched
    finally:
        for one in watched.values():
            one.component.stop()
        bench.close()


def steps_until(bench: Bench, condition: Callable[[], bool]) -> None:
    """Step until `condition` holds."""
    until(condition, step=bench.step)
