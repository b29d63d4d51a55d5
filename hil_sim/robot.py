"""The simulated robot with its doors open: bus by hub or virtual channel, sensors on pseudo-terminals."""

import threading
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from hil_sim import robot_file
from hil_sim.bus.hub import Hub
from hil_sim.bus.virtual import VirtualBridge
from hil_sim.control_socket import ControlSocket
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.faults.injector import Faults
from hil_sim.folder import Folder
from hil_sim.loop import Loop
from hil_sim.operator import Operator
from hil_sim.sensors.serial_port import SerialPort
from hil_sim.sensors.suite import SensorChoice
from hil_sim.truth import TruthFile


class SimulatedRobot:
    """A robot in a folder, to be run by its caller's thread (`run`) or, in a `with` block, by one of its own.

        with SimulatedRobot(tmp_path, virtual_channel="bench") as robot:
            bus = can.Bus(interface="virtual", channel="bench")

    With `virtual_channel` the bus is reached in the same process, otherwise through the hub on `port`.
    `speed` is simulated over real time, `None` as fast as it goes. The wearer is subject `person`; the ground
    truth is written to `truth`; `drives` names the files of joints with other drives than ours. `faults` and
    `operator` belong to the thread that runs it; others use the control socket in the folder.

    Raises `hil_sim.errors.SimulatorError` where the folder or the port is taken.
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
    ) -> None:
        self.exoskeleton = Exoskeleton(scenario, seed, sensors, person, drives)
        self.folder = Folder(folder)
        self.faults = Faults(self.exoskeleton, self.folder.path, seed)
        self.operator = Operator(self.exoskeleton, self.faults)
        self.port: int | None = None
        self.config_is_ours = True
        self._virtual_channel = virtual_channel
        self._speed = speed
        self._epoch_s = epoch_s
        self._truth = truth
        self._thread: threading.Thread | None = None
        self._closing = ExitStack()
        self._loop: Loop | None = None
        self._stopping = False

    @property
    def config(self) -> Path:
        """robot.toml, ready for a gateway (with a virtual channel: for one in this process)."""
        return self.folder.config

    @property
    def loop(self) -> Loop:
        """What runs it, between `open` and `close`."""
        if self._loop is None:
            raise RuntimeError("open() comes first")
        return self._loop

    def open(self) -> None:
        """Open every door and switch the robot on; all or nothing."""
        with ExitStack() as closing:
            self.folder.open()
            closing.callback(self.folder.close)
            loop = Loop(self.exoskeleton.clock, self._speed)
            closing.callback(loop.close)
            for drive in self.exoskeleton.drives.values():
                drive.storage.memory = self.folder.memory(drive)
            self._open_bus(loop, closing)
            self._open_sensors(closing)
            if self._truth is not None:
                closing.callback(TruthFile(self._truth, self.exoskeleton).close)
            closing.callback(ControlSocket(loop, self.folder.path, self.operator.obey).close)
            closing.callback(self.faults.clear)
            self.exoskeleton.power_on()
            self._closing = closing.pop_all()
            self._loop = loop

    def _open_bus(self, loop: Loop, closing: ExitStack) -> None:
        if self._virtual_channel is not None:
            closing.callback(VirtualBridge(self.exoskeleton.bus, self._virtual_channel).close)
            self._write_config(robot_file.virtual_bus(self._virtual_channel))
            return
        hub = Hub(loop, self.exoskeleton.bus, self.folder.hub_port(), self._epoch_s)
        closing.callback(hub.close)
        self.port = hub.port
        self.folder.remember_port(hub.port)
        self._write_config(robot_file.hub_bus(hub.port))

    def _write_config(self, bus: str) -> None:
        self.config_is_ours = self.folder.write_config(bus, self.exoskeleton)

    def _open_sensors(self, closing: ExitStack) -> None:
        for name, line in self.exoskeleton.sensors.lines.items():
            line.port = SerialPort(self.folder.link(name), line.baudrate)
            closing.callback(line.port.close)

    def run(self, seconds: float | None = None) -> None:
        """Run in this thread until `stop`, or for so many simulated seconds."""
        loop = self.loop
        end_ns = None if seconds is None else self.exoskeleton.clock.now_ns + round(seconds * 1e9)
        if not self._stopping:
            loop.run(end_ns)

    def stop(self) -> None:
        """End `run` soon, or before it began; from any thread or signal handler."""
        self._stopping = True
        if self._loop is not None:
            self._loop.stop()

    def close(self) -> None:
        """Stop, and close every door; idempotent."""
        self.stop()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._loop = None
        self._closing.close()

    def __enter__(self) -> Self:
        self.open()
        self._thread = threading.Thread(target=self.run, name="simulated robot")
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
