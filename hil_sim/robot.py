"""The simulated robot with its doors open: bus by hub, interface or channel, sensors on pseudo-terminals."""

import tomllib
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from hil_sim import robot_file
from hil_sim.bus.load import LoadWatch
from hil_sim.bus.socketcan import SocketCanBridge
from hil_sim.control_socket import ControlSocket
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.faults.injector import Faults
from hil_sim.gait.walks import ORDINARY
from hil_sim.loop import Loop
from hil_sim.mistakes import computer, registry
from hil_sim.mistakes.mistake import written
from hil_sim.mounting import Mounting
from hil_sim.node.lss import UNCONFIGURED
from hil_sim.operator import Operator
from hil_sim.sensors.serial_port import SerialPort
from hil_sim.sensors.suite import SensorChoice
from hil_sim.sensors.tables import companions
from hil_sim.simulation_host import SimulationHost
from hil_sim.truth import TruthFile


class SimulatedRobot(SimulationHost):
    """A robot in a folder, to be run by its caller's thread (`run`) or, in a `with` block, by one of its own.

        with SimulatedRobot(tmp_path, virtual_channel="bench") as robot:
            bus = can.Bus(interface="virtual", channel="bench")

    The wearer is subject `person`, who walks as `walk` says, in a robot that may assist one side alone; the
    ground truth is written to `truth`; `drives` names the files of joints with other drives than ours. With
    `interface` the bus is that CAN interface of Linux; the nodes named in `without` are not simulated, the
    drives of those in `unconfigured` have no node id yet; `mountings` says how joints are built in. `guard`
    is that table of robot.toml. `mistakes` are made by their names; with them, or an empty list, the files of
    the robot's computer are written to `computer` in the folder. `say` is told when the interface goes and
    comes back, and when the bus is overloaded. `faults` and `operator` belong to the thread that runs it;
    others use the control socket in the folder. For the rest see `SimulationHost`.
    """

    def __init__(
        self,
        folder: Path,
        scenario: Scenario = Scenario.WALK,
        seed: int = 0,
        virtual_channel: str | None = None,
        speed: float | None = 1.0,
        epoch_s: float = 0.0,
        sensors: SensorChoice | None = None,
        person: int = 0,
        truth: Path | None = None,
        drives: Mapping[str, Path] | None = None,
        interface: str | None = None,
        say: Callable[[str], object] = lambda _: None,
        without: Collection[str] = (),
        guard: Mapping[str, Any] | None = None,
        unconfigured: Collection[str] = (),
        mountings: Mapping[str, Mounting] | None = None,
        mistakes: Collection[str] | None = None,
        walk: str = ORDINARY,
        assists: str | None = None,
    ) -> None:
        self.exoskeleton = Exoskeleton(
            scenario, seed, sensors, person, drives, without, unconfigured, mountings, walk, assists
        )
        super().__init__(folder, self.exoskeleton.bus, virtual_channel, speed, epoch_s)
        self.faults = Faults(self.exoskeleton, self.folder.path, seed)
        self.operator = Operator(self.exoskeleton, self.faults)
        self._truth = truth
        self._interface = interface
        self._say = say
        self._guard = guard
        self._mistakes = None if mistakes is None else registry.chosen(mistakes)
        for mistake in self._mistakes or ():
            if mistake.act is not None:
                mistake.act(self.exoskeleton)

    def _config_text(self, bus: str) -> str:
        text = robot_file.text(self.folder.path, bus, self.exoskeleton, self._guard)
        lines = [line for mistake in self._mistakes or () for line in mistake.lines]
        return written(text, lines, str(self.folder.path))

    def _companions(self) -> Mapping[str, str]:
        return companions(self.exoskeleton.sensors.choice)

    def _check_guard(self) -> None:
        """Check that an existing file is the requested one; raises `SimulatorError`."""
        if self._guard is None or self.config_is_ours:
            return
        if tomllib.loads(self.config.read_text(encoding="utf-8")).get("guard") != self._guard:
            raise SimulatorError(
                f"{self.config} is there already, and its [guard] is not the scenario's; "
                "delete it, or choose another folder"
            )

    def _check_mistakes(self) -> None:
        """Refuse mistakes that need lines in an existing file; raises `SimulatorError`."""
        if not self.config_is_ours and any(mistake.lines for mistake in self._mistakes or ()):
            raise SimulatorError(f"{self.config} is there already: delete it, or choose another folder")

    def _open_bus(self, loop: Loop, closing: ExitStack) -> str:
        if self._interface is None:
            return super()._open_bus(loop, closing)
        nodes = {
            node.node_id: node.name for node in self.exoskeleton.nodes if node.factory_node_id != UNCONFIGURED
        }
        bridge = SocketCanBridge(loop, self.exoskeleton.bus, self._interface, nodes, self._say)
        closing.callback(bridge.close)
        return robot_file.socketcan_bus(self._interface)

    def _furnish(self, loop: Loop, closing: ExitStack) -> None:
        self._check_guard()
        self._check_mistakes()
        for drive in self.exoskeleton.simulated_drives:
            drive.storage.memory = self.folder.memory(drive)
        for name, line in self.exoskeleton.sensors.lines.items():
            line.port = SerialPort(self.folder.link(name), line.baudrate)
            closing.callback(line.port.close)
        if self._mistakes is not None:
            ports = [self.folder.link(name) for name in self.exoskeleton.sensors.lines]
            computer.write(self.folder.path, ports, self._mistakes)
        if self._truth is not None:
            closing.callback(TruthFile(self._truth, self.exoskeleton).close)
        closing.callback(ControlSocket(loop, self.folder.path, self.operator.obey).close)
        closing.callback(self.faults.clear)
        LoadWatch(self.exoskeleton.bus, self._say)
        self.exoskeleton.power_on()
