"""The end of a simulated serial line without a pseudo-terminal: for tests in simulated time."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Listener:
    """Takes what arrives."""

    baudrate: int
    write: Callable[[bytes], None]
    plugged: bool = True

    def plug(self, plugged: bool) -> None:
        self.plugged = plugged
