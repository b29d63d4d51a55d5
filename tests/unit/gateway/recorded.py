"""A procfs that a test writes: processes with their threads' counters, as proc(5) describes the files."""

from dataclasses import dataclass, field
from pathlib import Path

TICK_S = 0.01


@dataclass
class Thread:
    """One thread; times are in nanoseconds, `started_s` is since boot."""

    tid: int
    name: str
    ran_ns: int = 0
    waited_ns: int = 0
    policy: int = 0  # sched(7): 0 other, 1 fifo
    rt_priority: int = 0
    nice: int = 0
    core: int = 0
    started_s: float = 1.0
    voluntary: int = 0
    forced: int = 0


@dataclass
class Process:
    """One process; its first thread has its own number."""

    threads: list[Thread]
    cmdline: str = ""
    cores: str = "0-1"
    faults: tuple[int, int] = (0, 0)
    disk: tuple[int, int] | None = None  # None: hidden by its owner

    @property
    def pid(self) -> int:
        return self.threads[0].tid


def single(pid: int, name: str, **facts: int | float) -> Process:
    """A process with one thread."""
    return Process([Thread(pid, name, **facts)])  # type: ignore[arg-type]


@dataclass
class Recorded:
    """The files."""

    root: Path
    processes: list[Process] = field(default_factory=list)

    def write(self) -> None:
        """Bring the files to what the processes are now."""
        for process in self.processes:
            folder = self.root / str(process.pid)
            for thread in process.threads:
                task = folder / "task" / str(thread.tid)
                task.mkdir(parents=True, exist_ok=True)
                (task / "schedstat").write_text(f"{thread.ran_ns} {thread.waited_ns} 7\n")
                (task / "comm").write_text(f"{thread.name}\n")
                (task / "stat").write_text(_stat(process, thread))
                (task / "status").write_text(
                    f"Name:\t{thread.name}\nCpus_allowed_list:\t{process.cores}\n"
                    f"voluntary_ctxt_switches:\t{thread.voluntary}\n"
                    f"nonvoluntary_ctxt_switches:\t{thread.forced}\n"
                )
            (folder / "stat").write_text(_stat(process, process.threads[0]))
            (folder / "cmdline").write_bytes(process.cmdline.encode().replace(b" ", b"\0"))
            if process.disk is not None:
                read, written = process.disk
                (folder / "io").write_text(f"rchar: 1\nread_bytes: {read}\nwrite_bytes: {written}\n")


def _stat(process: Process, thread: Thread) -> str:
    fields = ["0"] * 50  # counted from the state, as proc(5) counts from 3
    fields[0] = "S"
    fields[7], fields[9] = map(str, process.faults)
    fields[16], fields[19] = str(thread.nice), str(round(thread.started_s / TICK_S))
    fields[36], fields[37], fields[38] = str(thread.core), str(thread.rt_priority), str(thread.policy)
    return f"{thread.tid} ({thread.name}) {' '.join(fields)}\n"
