"""Threads of this computer: run time, waiting time and scheduling policy, from Linux's procfs.

A look is one read a thread, of descriptors that stay open (proc(5); sched-stats.rst in the kernel's own
documentation): a quarter of a millisecond for 130 threads.
"""

import fcntl
import os
import resource
from collections.abc import Iterator, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

from gateway.modules.resource.procfs import SELECTABLE

MOST = 4096  # descriptors, and no more than a quarter of those that the process may have
WORDS = 4  # of a command line, that may name its program: `nice -n 5 ./exo_control`
URGENT = 100  # above every real-time priority
_LINE_BYTES = 64
TICK_NS = 1_000_000_000 // os.sysconf("SC_CLK_TCK")
_STARTTIME, _CORE, _RT_PRIORITY, _POLICY, _NICE = 19, 36, 37, 38, 16  # counted from the state
_POLICIES = {0: "other", 1: "fifo", 2: "rr", 3: "batch", 5: "idle", 6: "deadline"}  # sched(7)

Id = tuple[int, int]  # process, thread


class Spent(NamedTuple):
    """Run and waiting time of a thread since its start."""

    ran_ns: int
    waited_ns: int  # ready to run, while others did


Look = dict[Id, Spent]


class Schedule(NamedTuple):
    """Scheduling of a thread; `priority` is 1 to 99 of a real-time policy, else its nice value."""

    policy: str
    priority: int
    core: int  # that it last ran on
    started_ns: int  # since boot

    @property
    def urgency(self) -> int:
        """Urgency of a thread: a deadline, a real-time priority, or 0; the lower waits for the higher."""
        if self.policy == "deadline":
            return URGENT
        return self.priority if self.policy in ("fifo", "rr") else 0


class Tasks:
    """Every thread that can be seen; `root` is where procfs is mounted."""

    def __init__(self, root: str = "/proc") -> None:
        self._root = root
        self._open: dict[Id, int] = {}
        soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        limit = SELECTABLE + MOST if soft == resource.RLIM_INFINITY else soft
        self._lowest = min(SELECTABLE, limit // 2)
        self._most = min(MOST, limit // 4)

    def meet(self) -> list[Id]:
        """Find threads that are new, which are returned, and forget those that have ended."""
        there = set(self._there())
        for gone in self._open.keys() - there:
            os.close(self._open.pop(gone))
        new = sorted(there - self._open.keys())[: self._most - len(self._open)]
        for task in new:
            with suppress(OSError):
                self._open[task] = self._descriptor(self._file(task, "schedstat"))
        return new

    def look(self) -> Look:
        """Return the processor and waiting time of each known thread so far."""
        found: Look = {}
        for task, descriptor in self._open.items():
            with suppress(OSError):  # it has ended
                ran, waited = os.pread(descriptor, _LINE_BYTES, 0).split()[:2]
                found[task] = Spent(int(ran), int(waited))
        return found

    def named(self, globs: Sequence[str]) -> dict[int, str]:
        """Return processes by what they are called, or by their program.

        The first words of their command lines.
        """
        pids = {pid for pid, _ in self._open}
        named = {pid: self.name(pid) for pid in pids}
        return {
            pid: name
            for pid, name in named.items()
            if any(fnmatchcase(word, glob) for glob in globs for word in (name, *self._program(pid)))
        }

    def threads(self, pid: int) -> list[int]:
        return sorted(tid for owner, tid in self._open if owner == pid)

    def name(self, pid: int, tid: int | None = None) -> str:
        """Return the kernel's own name of it; empty where it has ended."""
        text = self._read((pid, pid if tid is None else tid), "comm")
        return (text or b"").rstrip(b"\n").decode(errors="replace")

    def schedule(self, task: Id) -> Schedule | None:
        """`None` where it has ended."""
        text = self._read(task, "stat")
        if text is None:
            return None
        fields = text.rpartition(b") ")[2].split()
        policy = _POLICIES.get(int(fields[_POLICY]), "unknown")
        priority = int(fields[_RT_PRIORITY]) or int(fields[_NICE])
        return Schedule(policy, priority, int(fields[_CORE]), int(fields[_STARTTIME]) * TICK_NS)

    def cores(self, pid: int) -> set[int]:
        """Return those that a process may run on; none where it has ended."""
        text = (self._read((pid, pid), "status") or b"").decode(errors="replace")
        listed = text.partition("Cpus_allowed_list:")[2].partition("\n")[0].strip()
        ends = [one.partition("-") for one in listed.split(",") if one]
        return {core for low, _, high in ends for core in range(int(low), int(high or low) + 1)}

    def close(self) -> None:
        """Give every descriptor back."""
        while self._open:
            os.close(self._open.popitem()[1])

    def _there(self) -> Iterator[Id]:
        for name in os.listdir(self._root):  # noqa: PTH208 - a Path for each costs more than all else
            if name.isdecimal():
                with suppress(OSError):
                    for tid in os.listdir(f"{self._root}/{name}/task"):  # noqa: PTH208
                        yield int(name), int(tid)

    def _file(self, task: Id, name: str) -> str:
        return f"{self._root}/{task[0]}/task/{task[1]}/{name}"

    def _read(self, task: Id, name: str) -> bytes | None:
        try:
            return Path(self._file(task, name)).read_bytes()
        except OSError:
            return None

    def _program(self, pid: int) -> list[str]:
        try:
            words = Path(self._root, str(pid), "cmdline").read_bytes().split(b"\0")[:WORDS]
        except OSError:
            return []
        return [word.decode(errors="replace").rpartition("/")[2] for word in words]

    def _descriptor(self, path: str) -> int:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            return fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, self._lowest)
        finally:
            os.close(descriptor)
