"""Time and names for one play: the path asks the computer for neither, so a play is always the same."""

import random
import sys
import time
import uuid
from types import ModuleType
from typing import Any, Final

BEGAN_NS: Final = 1_795_000_000_000_000_000  # November 2026
OURS: Final = ("server_gui.", "ml.")


class Times:
    """Stands for the module `time`; `wall_ns` is what the server that acts now adds to the true time."""

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000_000  # since the computer was switched on
        self.wall_ns = BEGAN_NS

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)

    def time_ns(self) -> int:
        return self.now_ns + self.wall_ns

    def time(self) -> float:
        return self.time_ns() / 1e9

    def monotonic_ns(self) -> int:
        return self.now_ns

    def monotonic(self) -> float:
        return self.now_ns / 1e9

    def sleep(self, wait_s: float) -> None:
        self.now_ns += int(wait_s * 1e9)


class Names:
    """Stands for the module `uuid`."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance

    def __getattr__(self, name: str) -> Any:
        return getattr(uuid, name)

    def uuid4(self) -> uuid.UUID:
        return uuid.UUID(int=self._chance.getrandbits(128), version=4)


class Moment:
    """Stands for the `threading.Event` that a thread waits for: whoever waits lets the time pass."""

    def __init__(self, times: Times) -> None:
        self._times = times
        self._is_set = False

    def set(self) -> None:
        self._is_set = True

    def clear(self) -> None:
        self._is_set = False

    def is_set(self) -> bool:
        return self._is_set

    def wait(self, wait_s: float | None = None) -> bool:
        self._times.sleep(wait_s or 0.0)
        return self._is_set


def ours() -> list[ModuleType]:
    """The modules of the path, as far as they are imported."""
    return [module for name, module in sorted(sys.modules.items()) if name.startswith(OURS)]
