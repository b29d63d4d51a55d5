"""The simulated robot that the desk starts in a thread, and ends with itself; how far its start is."""

import contextlib
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Final, Self

from gateway.client import Address
from server_gui.processes.children import ChildFailed
from server_gui.processes.simulated import RobotPart, simulated_robot

Running = tuple[Address, Callable[[], None]]  # where it listens, and how to check that all is well
LOOK_S: Final = 0.5  # between looks whether both still run


class GaveUp(Exception):
    """The desk closed while the robot was starting."""


class DemoRobot:
    """`start` begins, `close` ends it and joins its thread; what it says may be read by any thread.

    Without `folder` its files are in a temporary one.
    """

    name = "simulated robot"  # of its thread

    def __init__(self, scenario: str = "walk", folder: Path | None = None) -> None:
        self.scenario = scenario
        self.folder = folder  # from the start on where its files are, the control socket among them
        self.ready: tuple[RobotPart, ...] = ()
        self.address: Address | None = None  # of its gateway, once that listens
        self.problem = ""  # why it does not run, or runs no more
        self._wanted = folder
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    @property
    def is_running(self) -> bool:
        """Whether it was started and has not ended."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> None:
        """Begin; once at a time."""
        if not self.is_running:
            self.ready, self.address, self.problem = (), None, ""
            self._thread = threading.Thread(target=self._run, name=self.name)
            self._thread.start()

    def close(self) -> None:
        """End simulator and gateway. Idempotent."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()

    def check(self) -> None:
        """Check the processes; raises `ChildFailed` if one has ended, or never became ready."""
        if self.problem:
            raise ChildFailed(self.problem)

    def _run(self) -> None:
        try:
            with self._folder() as self.folder, self._running(self.folder) as (self.address, check):
                while not self._closing.wait(LOOK_S):
                    check()
        except GaveUp:
            pass
        except (ChildFailed, OSError) as error:
            self.problem = str(error)

    def _running(self, folder: Path) -> AbstractContextManager[Running]:
        return simulated_robot(folder, self.scenario, self._give_up, self._ready)

    @contextlib.contextmanager
    def _folder(self) -> Iterator[Path]:
        if self._wanted is not None:
            yield self._wanted
            return
        with tempfile.TemporaryDirectory(prefix="gwrms-gui-", ignore_cleanup_errors=True) as made:
            yield Path(made)

    def _ready(self, part: RobotPart) -> None:
        self.ready = (*self.ready, part)

    def _give_up(self) -> None:
        if self._closing.is_set():
            raise GaveUp
