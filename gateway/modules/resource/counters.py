"""The computer's counters, however they are read: by `procfs` on Linux, by `portable` elsewhere."""

from collections.abc import Collection
from typing import NamedTuple, Protocol

from gateway.wire.resource import MemoryUse


class ProcessTimes:
    """One process; each look at it gives the same object, and a later process with its pid another one."""

    __slots__ = ("cpu_s", "memory_bytes", "name", "pid")

    def __init__(self, pid: int, name: str, cpu_s: float, memory_bytes: int) -> None:
        self.pid = pid
        self.name = name
        self.cpu_s = cpu_s  # of all its threads, since it began
        self.memory_bytes = memory_bytes  # resident set


class CoreTimes(NamedTuple):
    """One core's seconds since boot; waiting for a disk is idle, and a guest's time is in the user's."""

    busy_s: float
    total_s: float


class Counters(Protocol):
    """One way of reading them. It belongs to one thread, and holds descriptors until `close`."""

    def processes(self) -> Collection[ProcessTimes]:
        """Every process that can be seen, kernel threads too; those that end meanwhile are left out."""

    def cores(self) -> list[CoreTimes]:
        """Return each core that is online."""

    def memory(self) -> MemoryUse:
        """Return the memory of the whole computer."""

    def own_rss_bytes(self) -> int:
        """Return the resident memory of this process."""

    def command_line(self, pid: int) -> list[str]:
        """Return its words, none where there is none to be seen."""

    def close(self) -> None:
        """Give every descriptor back."""
