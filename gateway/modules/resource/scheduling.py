"""Scheduling of the control loop's processes and threads: policy, waiting, page faults, disk (procfs)."""

import re
from collections.abc import Sequence
from pathlib import Path

from gateway.modules.resource.tasks import Look, Tasks
from gateway.streaming.rates import Rates
from gateway.wire.resource import ControlProcess, ThreadUse

_MINOR, _MAJOR = 7, 9  # faults in /proc/<pid>/stat, counted from the state
_SWITCHES = re.compile(r"(voluntary|nonvoluntary)_ctxt_switches:\s+(\d+)")
_IO = re.compile(r"^(read_bytes|write_bytes): (\d+)$", re.MULTILINE)


class Scheduling:
    """One asker's view of some processes; `root` is where procfs is mounted."""

    def __init__(self, processes: Sequence[str], root: str = "/proc") -> None:
        self._processes = processes
        self._root = root
        self._rate = Rates()

    def look(self, now_ns: int) -> list[ControlProcess]:
        """Those that are there now; rates are since the last look."""
        tasks = Tasks(self._root)
        try:
            tasks.meet()
            self._rate.look(now_ns)
            look = tasks.look()
            named = tasks.named(self._processes)
            return [self._process(tasks, look, pid, name) for pid, name in sorted(named.items())]
        finally:
            tasks.close()

    def _process(self, tasks: Tasks, look: Look, pid: int, name: str) -> ControlProcess:
        faults = _text(self._root, pid, "stat").rpartition(") ")[2].split()
        disk = dict(_IO.findall(_text(self._root, pid, "io")))
        counters = {
            "minor": faults[_MINOR] if faults else None,
            "major": faults[_MAJOR] if faults else None,
            "read": disk.get("read_bytes"),
            "write": disk.get("write_bytes"),
        }
        rates = {
            key: self._rate.rounded((pid, key), None if value is None else int(value))
            for key, value in counters.items()
        }
        threads = [self._thread(tasks, look, pid, tid) for tid in tasks.threads(pid)]
        return ControlProcess(
            pid,
            name,
            rates["minor"],
            rates["major"],
            rates["read"],
            rates["write"],
            [one for one in threads if one is not None],
        )

    def _thread(self, tasks: Tasks, look: Look, pid: int, tid: int) -> ThreadUse | None:
        spent, schedule = look.get((pid, tid)), tasks.schedule((pid, tid))
        if spent is None or schedule is None:
            return None
        switches = dict(_SWITCHES.findall(_text(self._root, pid, f"task/{tid}/status")))
        return ThreadUse(
            tid,
            tasks.name(pid, tid),
            self._rate.percent((tid, "ran"), spent.ran_ns),
            self._rate.percent((tid, "waited"), spent.waited_ns),
            schedule.policy,
            schedule.priority,
            schedule.core,
            self._rate.rounded((tid, "voluntary"), int(switches.get("voluntary", 0))),
            self._rate.rounded((tid, "forced"), int(switches.get("nonvoluntary", 0))),
        )


def _text(root: str, pid: int, name: str) -> str:
    """Empty where it has ended, or its owner hides it."""
    try:
        return Path(root, str(pid), name).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
