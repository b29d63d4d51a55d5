"""The counters of other POSIX systems than Linux, by psutil."""

import os
from collections.abc import Collection

import psutil

from gateway.modules.resource.counters import CoreTimes, ProcessTimes
from gateway.wire.messages import MemoryUse

_ATTRIBUTES = ("name", "cpu_times", "memory_info", "create_time")


class Portable:
    """The counters by psutil; it runs on Linux too, at ten times the price."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, float], ProcessTimes] = {}
        self._own = psutil.Process()

    def processes(self) -> Collection[ProcessTimes]:
        known, self._known = self._known, {}
        for process in psutil.process_iter(_ATTRIBUTES):
            name, cpu, memory, started = (process.info[attribute] for attribute in _ATTRIBUTES)
            if cpu is None or memory is None:
                continue
            key = process.pid, started
            times = known.get(key) or ProcessTimes(process.pid, "", 0.0, 0)
            times.name = os.fsencode(name or "").decode(errors="replace")
            times.cpu_s, times.memory_bytes = cpu.user + cpu.system, memory.rss
            self._known[key] = times
        return self._known.values()

    def cores(self) -> list[CoreTimes]:
        cores = []
        for times in psutil.cpu_times(percpu=True):
            total_s = sum(times) - getattr(times, "guest", 0.0) - getattr(times, "guest_nice", 0.0)
            cores.append(CoreTimes(total_s - times.idle - getattr(times, "iowait", 0.0), total_s))
        return cores

    def memory(self) -> MemoryUse:
        memory = psutil.virtual_memory()
        return MemoryUse(
            memory.total, memory.available, memory.total - memory.available, psutil.swap_memory().used
        )

    def own_rss_bytes(self) -> int:
        return int(self._own.memory_info().rss)

    def command_line(self, pid: int) -> list[str]:
        try:
            return psutil.Process(pid).cmdline()
        except psutil.Error:
            return []

    def close(self) -> None:
        """Nothing is held."""
