"""The host of a simulated or replayed robot: its folder, loop, bus socket and thread."""

import threading
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from hil_sim import robot_file
from hil_sim.bus.can_bus import CanBus
from hil_sim.bus.hub import Hub
from hil_sim.folder import Folder
from hil_sim.kept_file import disagreements
from hil_sim.loop import Loop


class SimulationHost:
    """Houses a robot in `folder`, to be run by its caller's thread (`run`) or, in a `with` block, by its own.

    With `virtual_channel` the bus is reached in the same process, otherwise through the hub on `port`.
    `speed` is simulated over real time, `None` as fast as it goes.

    Raises `hil_sim.errors.SimulatorError` where the folder or the port is taken.
    """

    def __init__(
        self, folder: Path, bus: CanBus, virtual_channel: str | None, speed: float | None, epoch_s: float
    ) -> None:
        self.folder = Folder(folder)
        self.port: int | None = None
        self.config_is_ours = True
        self.disagreements: list[str] = []  # of an existing robot.toml with what is simulated
        self._bus = bus
        self._virtual_channel = virtual_channel
        self._speed = speed
        self._epoch_s = epoch_s
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
        """The loop that runs it, between `open` and `close`."""
        if self._loop is None:
            raise RuntimeError("open() comes first")
        return self._loop

    # -- what a robot adds -----------------------------------------------------------------------------

    def _config_text(self, bus: str) -> str:
        """Return the text of a first robot.toml; `bus` is the table of its bus."""
        raise NotImplementedError

    def _companions(self) -> Mapping[str, str]:
        """Return the files that robot.toml names, by name."""
        return {}

    def _furnish(self, loop: Loop, closing: ExitStack) -> None:
        """Open the other doors and switch the robot on."""
        raise NotImplementedError

    # -- life ------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Open every door and switch the robot on; all or nothing."""
        with ExitStack() as closing:
            self.folder.open()
            closing.callback(self.folder.close)
            loop = Loop(self._bus.clock, self._speed)
            closing.callback(loop.close)
            table = self._open_bus(loop, closing)
            text = self._config_text(table)
            self.config_is_ours = self.folder.write_config(text, self._companions())
            self.disagreements = [] if self.config_is_ours else disagreements(self.config, text)
            self._furnish(loop, closing)
            self._closing = closing.pop_all()
            self._loop = loop

    def _open_bus(self, loop: Loop, closing: ExitStack) -> str:
        """Open the bus; return its table in robot.toml."""
        if self._virtual_channel is not None:
            from hil_sim.bus.virtual import VirtualBridge  # python-can is heavy, and the hub does without

            closing.callback(VirtualBridge(self._bus, self._virtual_channel).close)
            return robot_file.virtual_bus(self._virtual_channel)
        hub = Hub(loop, self._bus, self.folder.hub_port(), self._epoch_s)
        closing.callback(hub.close)
        self.port = hub.port
        self.folder.remember_port(hub.port)
        return robot_file.hub_bus(hub.port)

    def run(self, seconds: float | None = None) -> None:
        """Run in this thread until `stop`, or for so many simulated seconds."""
        loop = self.loop
        end_ns = None if seconds is None else self._bus.clock.now_ns + round(seconds * 1e9)
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
