"""A gateway on this computer for a robot's file: started when asked for, ended with the window."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from server_gui.processes.children import Child
from server_gui.processes.demo_robot import DemoRobot, Running
from server_gui.processes.simulated import START_S, RobotPart, address_in


class FileGateway(DemoRobot):
    """Gateway for an existing robot: nothing is simulated."""

    name: Final = "gateway"

    def __init__(self, file: Path) -> None:
        super().__init__(folder=file.parent)
        self.is_followed = False
        self._file = file

    @contextlib.contextmanager
    def _running(self, _folder: Path) -> Iterator[Running]:
        with Child(RobotPart.GATEWAY.value, ["gateway", str(self._file), "--port", "0"]) as gateway:
            yield gateway.wait_ready(address_in, START_S, self._give_up), gateway.check
