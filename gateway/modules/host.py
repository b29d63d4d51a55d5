"""Measures the computer with psutil: counters now, and percentages between two looks of the same asker."""

import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil
from msgspec import UNSET

from gateway.messages import (
    CpuUse,
    DiskUse,
    GatewayUse,
    KernelFacts,
    MemoryUse,
    NetworkUse,
    ProcessUse,
    ResourceSnapshot,
    ResourceSnapshotParams,
)


@dataclass(frozen=True, slots=True)
class ProcessTimes:
    """One process as counters; `started` tells it from a later one with the same pid."""

    pid: int
    started: float
    name: str
    cpu_s: float
    memory_bytes: int


@dataclass(frozen=True, slots=True)
class CpuTimes:
    """One core's seconds since boot."""

    busy_s: float
    total_s: float


def scan_processes() -> list[ProcessTimes]:
    """Every process that can be seen; those that end meanwhile are left out."""
    found = []
    for process in psutil.process_iter(["name", "cpu_times", "memory_info", "create_time"]):
        info = process.info
        if info["cpu_times"] is None or info["memory_info"] is None:
            continue
        cpu_s = info["cpu_times"].user + info["cpu_times"].system
        name = info["name"] or ""
        found.append(ProcessTimes(process.pid, info["create_time"], name, cpu_s, info["memory_info"].rss))
    return found


def core_times() -> list[CpuTimes]:
    """Each core's times; waiting for a disk is idle, and a guest's time is in the user's already."""
    cores = []
    for times in psutil.cpu_times(percpu=True):
        total_s = sum(times) - getattr(times, "guest", 0.0) - getattr(times, "guest_nice", 0.0)
        cores.append(CpuTimes(total_s - times.idle - getattr(times, "iowait", 0.0), total_s))
    return cores


class Host:
    """The computer; whoever asks has a meter of their own."""

    def __init__(self) -> None:
        self.own = psutil.Process()

    def meter(self) -> "Meter":
        return Meter(self)


class Meter:
    """One asker's view: remembers its last look, so that percentages are since then."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._looked_ns: int | None = None
        self._scanned_ns: int | None = None
        self._cores: list[CpuTimes] = []
        self._processes: Mapping[tuple[int, float], float] = {}
        self._own_cpu_s = 0.0
        self._rates: dict[str, tuple[int, int]] = {}  # counter → when, value

    def snapshot(self, params: ResourceSnapshotParams) -> ResourceSnapshot:
        """Everything that `params` ask for, measured now."""
        now_ns = time.monotonic_ns()
        elapsed_s = None if self._looked_ns is None else (now_ns - self._looked_ns) / 1e9
        self._looked_ns = now_ns
        include = set(params.include)
        return ResourceSnapshot(
            stamp_ns=now_ns,
            cpu=self._cpu(),
            memory=_memory(),
            gateway=self._gateway(elapsed_s),
            processes=self._table(params, now_ns) if params.processes else UNSET,
            disk=self._disk(now_ns) if "disk" in include else UNSET,
            network=self._network(now_ns) if "network" in include else UNSET,
            thermal=_thermal() if "thermal" in include else UNSET,
            kernel=_kernel() if "kernel" in include else UNSET,
        )

    def _cpu(self) -> CpuUse:
        cores, before = core_times(), self._cores
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
        times = self._host.own.cpu_times()
        cpu_s, before_s = times.user + times.system, self._own_cpu_s
        self._own_cpu_s = cpu_s
        percent = None if elapsed_s is None else _percent(cpu_s - before_s, elapsed_s, most=None)
        return GatewayUse(percent, self._host.own.memory_info().rss)

    def _table(self, params: ResourceSnapshotParams, now_ns: int) -> list[ProcessUse]:
        elapsed_s = None if self._scanned_ns is None else (now_ns - self._scanned_ns) / 1e9
        before = self._processes
        scanned = scan_processes()
        self._scanned_ns = now_ns
        self._processes = {(one.pid, one.started): one.cpu_s for one in scanned}
        rows = []
        for one in scanned:
            before_s = before.get((one.pid, one.started))
            known = elapsed_s is not None and before_s is not None
            percent = _percent(one.cpu_s - (before_s or 0.0), elapsed_s or 0.0, most=None) if known else None
            rows.append(ProcessUse(one.pid, one.name, percent, one.memory_bytes))
        rows = _sorted(rows, params)[: params.limit]
        return [_with_cmdline(row) for row in rows] if "cmdline" in params.include else rows

    def _disk(self, now_ns: int) -> DiskUse:
        counters = psutil.disk_io_counters()
        if counters is None:
            return DiskUse(None, None)
        return DiskUse(
            self._rate("read", counters.read_bytes, now_ns), self._rate("write", counters.write_bytes, now_ns)
        )

    def _network(self, now_ns: int) -> NetworkUse:
        counters = psutil.net_io_counters()
        return NetworkUse(
            self._rate("received", counters.bytes_recv, now_ns),
            self._rate("sent", counters.bytes_sent, now_ns),
        )

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
_ORDERS: Mapping[str, tuple[Callable[[ProcessUse], float | str], bool]] = {
    "cpu": (lambda row: -1.0 if row.cpu_percent is None else row.cpu_percent, True),
    "memory": (lambda row: row.memory_bytes, True),
    "name": (lambda row: row.name.lower(), False),
    "pid": (lambda row: row.pid, False),
}


def _sorted(rows: list[ProcessUse], params: ResourceSnapshotParams) -> list[ProcessUse]:
    key, highest_first = _ORDERS[params.sort]
    descending = highest_first if params.descending is None else params.descending
    return sorted(rows, key=lambda row: key(row), reverse=descending)


def _with_cmdline(row: ProcessUse) -> ProcessUse:
    try:
        words = psutil.Process(row.pid).cmdline()
    except psutil.Error:
        words = []
    return ProcessUse(row.pid, row.name, row.cpu_percent, row.memory_bytes, redact(words))


# Words of a command line after which a secret stands, or in which one is.
_SECRET = (
    "password",
    "passwd",
    "secret",
    "token",
    "credential",
    "apikey",
    "api-key",
    "api_key",
    "access-key",
)


def redact(words: list[str]) -> str:
    """A command line without the values of options that name a secret, and without passwords in URLs."""
    shown: list[str] = []
    hide_next = False
    for word in words:
        option, equals, _value = word.partition("=")
        secret = any(name in option.lower() for name in _SECRET)
        if hide_next:
            word = "***"
        elif secret and equals:
            word = f"{option}=***"
        elif "://" in word and "@" in word:
            scheme, _, rest = word.partition("://")
            word = f"{scheme}://***@{rest.rpartition('@')[2]}"
        hide_next = secret and not equals and option.startswith("-")
        shown.append(word)
    return " ".join(shown)


def _memory() -> MemoryUse:
    memory, swap = psutil.virtual_memory(), psutil.swap_memory()
    return MemoryUse(memory.total, memory.available, memory.used, swap.used)


def _thermal() -> dict[str, float | None]:
    read = getattr(psutil, "sensors_temperatures", None)  # not on every system
    if read is None:
        return {}
    return {
        f"{chip}.{sensor.label or number}": sensor.current
        for chip, sensors in read().items()
        for number, sensor in enumerate(sensors)
    }


def _kernel() -> KernelFacts:
    facts = platform.uname()
    realtime = Path("/sys/kernel/realtime")
    preempt_rt: bool | None = None
    if facts.system == "Linux":
        preempt_rt = "PREEMPT_RT" in facts.version or (
            realtime.exists() and realtime.read_text().strip() == "1"
        )
    return KernelFacts(facts.system, facts.release, facts.version, preempt_rt)
