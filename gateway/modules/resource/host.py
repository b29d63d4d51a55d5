"""The computer as each asker sees it: counters now, and percentages since the same asker's last look."""

import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence, Set
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from msgspec import UNSET
from msgspec.structs import replace

from gateway.modules.resource.counters import CoreTimes, Counters, ProcessTimes
from gateway.wire.resource import (
    ControlProcess,
    CpuUse,
    DiskUse,
    GatewayUse,
    NetworkUse,
    ProcessUse,
    ResourceSnapshot,
    ResourceSnapshotParams,
)

if TYPE_CHECKING:
    from gateway.modules.resource.scheduling import Scheduling


class Host:
    """The computer; whoever asks has a meter of their own. `control` are the names of `[control_loop]`."""

    def __init__(self, control: Sequence[str] = ()) -> None:
        self._counters = _counters()
        self._control = control

    def meter(self) -> "Meter":
        return Meter(self._counters, self._control)

    def own_rss_bytes(self) -> int:
        return self._counters.own_rss_bytes()

    def close(self) -> None:
        """Give back what is held for the next look; its meters must not be used again."""
        self._counters.close()


def _counters() -> Counters:
    """Return the counters of this system; the other way's needs are not even imported."""
    if sys.platform == "linux":
        from gateway.modules.resource.procfs import Procfs

        return Procfs()
    from gateway.modules.resource.portable import Portable

    return Portable()


class Meter:
    """One asker's view: remembers its last look, so that percentages are since then."""

    def __init__(self, counters: Counters, control: Sequence[str] = ()) -> None:
        self._counters = counters
        self._control = control
        self._scheduling: Scheduling | None = None
        self._looked_ns: int | None = None
        self._scanned_ns = 0
        self._cores: list[CoreTimes] = []
        self._processes: dict[ProcessTimes, float] = {}
        self._own_cpu_s = 0.0
        self._rates: dict[str, tuple[int, int]] = {}  # counter → when, value

    def snapshot(self, params: ResourceSnapshotParams) -> ResourceSnapshot:
        """Everything that `params` ask for, measured now."""
        now_ns = time.monotonic_ns()
        elapsed_s = None if self._looked_ns is None else (now_ns - self._looked_ns) / 1e9
        self._looked_ns = now_ns
        snapshot = ResourceSnapshot(
            stamp_ns=now_ns,
            cpu=self._cpu(),
            memory=self._counters.memory(),
            gateway=self._gateway(elapsed_s),
            processes=self._table(params, now_ns) if params.processes else UNSET,
        )
        named = set(params.include) - {"cmdline"}
        return replace(snapshot, **self._extras(named, now_ns)) if named else snapshot

    def _cpu(self) -> CpuUse:
        cores, before = self._counters.cores(), self._cores
        self._cores = cores
        load = list(os.getloadavg())
        if len(before) != len(cores):
            return CpuUse(None, [None] * len(cores), load)
        pairs = list(zip(before, cores, strict=True))
        busy_s = sum(new.busy_s - old.busy_s for old, new in pairs)
        total_s = sum(new.total_s - old.total_s for old, new in pairs)
        each = [_percent(new.busy_s - old.busy_s, new.total_s - old.total_s) for old, new in pairs]
        return CpuUse(_percent(busy_s, total_s), each, load)

    def _gateway(self, elapsed_s: float | None) -> GatewayUse:
        cpu_s, before_s = time.process_time(), self._own_cpu_s
        self._own_cpu_s = cpu_s
        percent = None if elapsed_s is None else _percent(cpu_s - before_s, elapsed_s, most=None)
        return GatewayUse(percent, self._counters.own_rss_bytes())

    def _table(self, params: ResourceSnapshotParams, now_ns: int) -> list[ProcessUse]:
        """Return the hot loop: thousands of processes may pass here, and most of them have done nothing."""
        elapsed_ns, self._scanned_ns = now_ns - self._scanned_ns, now_ns
        before = self._processes if elapsed_ns > 0 else {}
        percent_per_s = 100e9 / max(1, elapsed_ns)
        now: dict[ProcessTimes, float] = {}
        rows = []
        percent: float | None
        for process in self._counters.processes():
            now[process] = cpu_s = process.cpu_s
            before_s = before.get(process)
            if before_s == cpu_s:
                percent = 0.0
            elif before_s is None:
                percent = None
            else:
                percent = max(0.0, round((cpu_s - before_s) * percent_per_s, 2))
            rows.append(ProcessUse(process.pid, process.name, percent, process.memory_bytes))
        self._processes = now
        rows = _sorted(rows, params)[: params.limit]
        return [self._with_cmdline(row) for row in rows] if "cmdline" in params.include else rows

    def _with_cmdline(self, row: ProcessUse) -> ProcessUse:
        from gateway.modules.resource.redact import (
            redact,  # its patterns, for who asks for command lines only
        )

        words = self._counters.command_line(row.pid)
        return ProcessUse(row.pid, row.name, row.cpu_percent, row.memory_bytes, redact(words))

    def _extras(self, named: Set[str], now_ns: int) -> dict[str, Any]:
        found: dict[str, Any] = {}
        if "control" in named:
            found["control"] = self._control_processes(now_ns)
        if named <= {"control"}:
            return found
        from gateway.modules.resource import extras  # on Linux, psutil is needed only there

        if "disk" in named:
            found["disk"] = DiskUse(*self._rates_of(("read", "write"), extras.disk(), now_ns))
        if "network" in named:
            found["network"] = NetworkUse(*self._rates_of(("received", "sent"), extras.network(), now_ns))
        if "thermal" in named:
            found |= {"thermal": extras.thermal(), "throttling": extras.throttling()}
        if "kernel" in named:
            found["kernel"] = extras.kernel()
        return found

    def _control_processes(self, now_ns: int) -> list[ControlProcess]:
        if self._scheduling is None:
            from gateway.modules.resource.scheduling import Scheduling

            self._scheduling = Scheduling(self._control)
        return self._scheduling.look(now_ns)

    def _rates_of(
        self, names: tuple[str, str], values: tuple[int, int] | None, now_ns: int
    ) -> list[float | None]:
        if values is None:
            return [None, None]
        return [self._rate(name, value, now_ns) for name, value in zip(names, values, strict=True)]

    def _rate(self, counter: str, value: int, now_ns: int) -> float | None:
        before = self._rates.get(counter)
        self._rates[counter] = (now_ns, value)
        if before is None or now_ns <= before[0] or value < before[1]:
            return None
        return (value - before[1]) * 1e9 / (now_ns - before[0])


def _percent(part: float, of: float, most: float | None = 100.0) -> float | None:
    if of <= 0:
        return None
    percent = max(0.0, 100.0 * part / of)
    return round(percent if most is None else min(percent, most), 2)


# How each order reads a row, and whether it shows the highest first by itself.
_ORDERS: Mapping[str, tuple[Callable[[ProcessUse], Any], bool]] = {
    "cpu": (attrgetter("cpu_percent"), True),
    "memory": (attrgetter("memory_bytes"), True),
    "name": (lambda row: row.name.lower(), False),
    "pid": (attrgetter("pid"), False),
}


def _sorted(rows: list[ProcessUse], params: ResourceSnapshotParams) -> list[ProcessUse]:
    """In the order asked for; rows whose CPU is not known yet count as the lowest, and go by their memory.

    In a first look these are all: those that come first are programs then, not threads of the kernel.
    """
    key, highest_first = _ORDERS[params.sort]
    descending = highest_first if params.descending is None else params.descending
    if params.sort != "cpu":
        return sorted(rows, key=key, reverse=descending)
    known = sorted((row for row in rows if row.cpu_percent is not None), key=key, reverse=descending)
    unknown = sorted(
        (row for row in rows if row.cpu_percent is None),
        key=lambda row: row.memory_bytes,
        reverse=descending,
    )
    return known + unknown if descending else unknown + known
