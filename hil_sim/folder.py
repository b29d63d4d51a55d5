"""The simulator's folder: one simulator at a time, and what must stay the same from start to start."""

import fcntl
from collections.abc import Mapping
from pathlib import Path
from typing import IO

from hil_sim.errors import SimulatorError
from hil_sim.node.memory import FileMemory
from hil_sim.node.node import Node


class Folder:
    """`--dir`: robot.toml, what the drives have stored, the sensors' links, the hub's port and the lock.

    The lock ends with the process, however that ends.
    """

    def __init__(self, path: Path) -> None:
        self.path = path.resolve()
        self.config = self.path / "robot.toml"
        self._port_file = self.path / "hub.port"
        self._lock: IO[str] | None = None

    def open(self) -> None:
        """Make the folder and take the lock; raises `SimulatorError` where another simulator has it."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            lock = (self.path / "sim.lock").open("a+", encoding="ascii")
        except OSError as error:
            raise SimulatorError(
                f"the folder {self.path} cannot be used: {error.strerror}; choose another --dir"
            ) from error
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            lock.close()
            raise SimulatorError(
                f"another simulator is running in {self.path}; stop it first, or choose another --dir"
            ) from error
        self._lock = lock

    def close(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def hub_port(self) -> int:
        """Return the port of the last start, 0 at the first."""
        try:
            return int(self._port_file.read_text(encoding="ascii"))
        except (FileNotFoundError, ValueError):
            return 0

    def remember_port(self, port: int) -> None:
        if port != self.hub_port():
            self._port_file.write_text(f"{port}\n", encoding="ascii")

    def write_config(self, text: str, companions: Mapping[str, str]) -> bool:
        """Write robot.toml, and what it names beside it, unless there is one: whoever edited it keeps that.

        Says whether the files were written.
        """
        try:
            with self.config.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            return False
        for name, content in companions.items():
            (self.path / name).write_text(content, encoding="utf-8")
        return True

    def memory(self, node: Node) -> FileMemory:
        """Return the memory of a device, which keeps stored values until the next start."""
        return FileMemory(self.path / "stored" / f"{node.name}.json", node.description.path.name)

    def link(self, sensor: str) -> Path:
        """Return the stable path of a serial sensor."""
        return self.path / sensor
