"""The simulated robot that the window starts when somebody asks for it, and ends when the window closes."""

import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

from gateway.client import Address
from server_gui.processes.children import ChildFailed
from server_gui.processes.simulated import simulated_robot

LOOK_S: Final = 0.5  # between looks whether both still run


class GaveUp(Exception):
    """The window closed while the robot was starting."""


class OwnRobot:
    """`ready` and `failed` are called in a thread of its own, which `close` ends and joins."""

    def __init__(self, ready: Callable[[Address], None], failed: Callable[[str], None]) -> None:
        self._ready = ready
        self._failed = failed
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin; once at a time."""
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self._run, name="simulated robot")
            self._thread.start()

    def close(self) -> None:
        """End simulator and gateway. Idempotent."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        with tempfile.TemporaryDirectory(prefix="gwrms-gui-") as folder:
            try:
                with simulated_robot(Path(folder), "walk", self._give_up) as (address, check):
                    self._ready(address)
                    while not self._closing.wait(LOOK_S):
                        check()
            except GaveUp:
                pass
            except ChildFailed as error:
                self._failed(str(error))

    def _give_up(self) -> None:
        if self._closing.is_set():
            raise GaveUp
