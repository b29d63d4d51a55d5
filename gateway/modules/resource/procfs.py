"""Linux's counters: one read a process and look, of a descriptor that stays open while the process lives.

The files are described in proc(5). A kept descriptor belongs to one process: read after its end it raises
ESRCH, whoever has the pid by then.
"""

import errno
import fcntl
import os
import resource
from collections.abc import Collection
from contextlib import ExitStack, suppress
from pathlib import Path

from gateway.modules.resource.counters import CoreTimes, ProcessTimes
from gateway.wire.messages import MemoryUse

KEPT_MOST = 4096  # descriptors, and no more than half of those that the process may have
SELECTABLE = 1024  # select(2), which serial drivers wait in, takes lower numbers only: ours leave them free

_STAT_BYTES = 1024  # all that we take from a process's line stands within
_FILE_BYTES = 64 * 1024
_CMDLINE_BYTES = 4096  # a longer command line is cut
_UTIME, _STIME, _STARTTIME, _RSS = 11, 12, 19, 21  # counted from the state, which follows the name
_TICK_S = 1 / os.sysconf("SC_CLK_TCK")
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
_FULL = (errno.EMFILE, errno.ENFILE)


class _Process(ProcessTimes):
    """A process, the line that it was last read from, and the descriptor to read the next."""

    __slots__ = ("descriptor", "started_ticks", "stat")

    def __init__(self, pid: int, stat: bytes) -> None:
        super().__init__(pid, "", 0.0, 0)
        self.descriptor: int | None = None
        self.update(stat)

    def update(self, stat: bytes) -> None:
        head, _, tail = stat.rpartition(b") ")  # the name may hold blanks and parentheses, what follows never
        fields = tail.split(b" ", _RSS + 1)
        self.stat = stat
        self.name = head.partition(b" (")[2].decode(errors="replace")
        self.cpu_s = (int(fields[_UTIME]) + int(fields[_STIME])) * _TICK_S
        self.memory_bytes = int(fields[_RSS]) * _PAGE_BYTES
        self.started_ticks = int(fields[_STARTTIME])


class Procfs:
    """The counters of Linux; `root` is where procfs is mounted."""

    def __init__(self, root: str = "/proc") -> None:
        self._root = root
        self._known: dict[str, _Process] = {}
        soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        limit = soft if soft != resource.RLIM_INFINITY else SELECTABLE + KEPT_MOST
        self._lowest = min(SELECTABLE, limit // 2)
        self._keep_most = min(KEPT_MOST, limit - self._lowest)
        self._kept: set[_Process] = set()
        with ExitStack() as opened:
            self._stat = _open(f"{root}/stat", opened)
            self._meminfo = _open(f"{root}/meminfo", opened)
            self._own = _open(f"{root}/self/statm", opened)
            self._opened = opened.pop_all()

    def processes(self) -> Collection[ProcessTimes]:
        """Threads are in their process; with `hidepid`, others' processes are not seen.

        Raises:
            OSError: no descriptor is left to look with.

        """
        known, seen = self._known, dict[str, _Process]()
        for name in os.listdir(self._root):  # noqa: PTH208 - a Path for each process costs more than all else
            process = known.get(name)
            if process is not None and process.descriptor is not None:
                try:
                    stat = os.pread(process.descriptor, _STAT_BYTES, 0)
                except ProcessLookupError:
                    process = None
                else:
                    if stat != process.stat:
                        process.update(stat)
                    seen[name] = process
                    continue
            if name.isdecimal() and (process := self._meet(name, process)) is not None:
                seen[name] = process
        self._known = seen
        for name, process in known.items():
            if seen.get(name) is not process:
                self._release(process)
        return seen.values()

    def cores(self) -> list[CoreTimes]:
        cores = []
        for line in os.pread(self._stat, _FILE_BYTES, 0).splitlines()[1:]:  # the first is all together
            if not line.startswith(b"cpu"):
                break
            ticks = [int(field) for field in line.split()[1:9]]  # a guest's are in the user's
            total, idle = sum(ticks), ticks[3] + ticks[4]
            cores.append(CoreTimes((total - idle) * _TICK_S, total * _TICK_S))
        return cores

    def memory(self) -> MemoryUse:
        meminfo = os.pread(self._meminfo, _FILE_BYTES, 0)
        total, available = _bytes(meminfo, b"MemTotal:"), _bytes(meminfo, b"MemAvailable:")
        swap_used = _bytes(meminfo, b"SwapTotal:") - _bytes(meminfo, b"SwapFree:")
        return MemoryUse(total, available, total - available, swap_used)

    def own_rss_bytes(self) -> int:
        return int(os.pread(self._own, _STAT_BYTES, 0).split()[1]) * _PAGE_BYTES

    def command_line(self, pid: int) -> list[str]:
        try:
            with Path(f"{self._root}/{pid}/cmdline").open("rb", buffering=0) as file:
                words = file.read(_CMDLINE_BYTES)
        except OSError:
            return []
        return [word.decode(errors="replace") for word in words.rstrip(b"\0").split(b"\0")] if words else []

    def close(self) -> None:
        self._release(*self._kept)
        self._opened.close()

    def _meet(self, name: str, process: _Process | None) -> _Process | None:
        """Open a process's line, and keep it open as far as there is room; `process` had its pid before."""
        try:
            descriptor = self._descriptor(f"{self._root}/{name}/stat")
        except OSError as error:
            if error.errno in _FULL:
                raise
            return None  # it has ended, or is not ours to see
        try:
            stat = os.pread(descriptor, _STAT_BYTES, 0)
            met = _Process(int(name), stat)
            if process is not None and process.started_ticks == met.started_ticks:
                process.update(stat)
                met = process
            self._keep(met, descriptor)
            return met
        except ProcessLookupError:
            return None
        finally:
            os.close(descriptor)

    def _keep(self, process: _Process, descriptor: int) -> None:
        if len(self._kept) < self._keep_most:
            with suppress(OSError):  # others have the high numbers: it is opened anew each time
                process.descriptor = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, self._lowest)
                self._kept.add(process)

    def _descriptor(self, path: str) -> int:
        try:
            return os.open(path, os.O_RDONLY)
        except OSError as error:
            if error.errno not in _FULL or not self._kept:
                raise
        self._release(*self._kept)  # others need them more: from now on, one at a time
        self._keep_most = 0
        return os.open(path, os.O_RDONLY)

    def _release(self, *processes: _Process) -> None:
        for process in processes:
            if process.descriptor is not None:
                os.close(process.descriptor)
                process.descriptor = None
                self._kept.discard(process)


def _open(path: str, opened: ExitStack) -> int:
    descriptor = os.open(path, os.O_RDONLY)
    opened.callback(os.close, descriptor)
    return descriptor


def _bytes(meminfo: bytes, key: bytes) -> int:
    at = meminfo.index(key) + len(key)
    return int(meminfo[at : meminfo.index(b"kB", at)]) * 1024
