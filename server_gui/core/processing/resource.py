"""The robot's computer over time: its greatest consumers, and memory leaks."""

import collections
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import UNSET

from gateway.wire.resource import ProcessUse, ResourceSnapshot
from server_gui.core.processing.history import COARSE_S, Floats, History
from server_gui.core.processing.process_names import short_name
from server_gui.core.processing.trend import Slope, theil_sen

PROCESSES = 256  # that are followed at a time; the longest unseen goes
TOP_S = 60.0  # the window of the top consumers
PERCENTAGES = 120  # of CPU that are kept of each process
LEAK_MINUTES = 120  # of a process's memory that are judged
LEAK_FEWEST = 20  # minutes before anything is said, after the first ones
WARM_UP_MINUTES = 5  # programs grow while they start
LEAK_BYTES_PER_HOUR = 1 << 20  # a slope that is surely more than this is a leak
LEAK_BYTES = 2 << 20  # and so much must have been gained

SERIES = (
    "cpu_percent",
    "memory_used",
    "memory_available",
    "swap_used",
    "gateway_cpu_percent",
    "gateway_rss",
)

DEVICES = ("disk_read", "disk_written", "received", "sent", "hottest")  # B/s; °C


@dataclass(frozen=True, slots=True)
class Consumer:
    """One process over the last minute: mean of its CPU (percent of one core), newest memory (bytes)."""

    pid: int
    name: str
    cpu_percent: float | None
    memory_bytes: int
    label: str = ""  # what people call it


@dataclass(frozen=True, slots=True)
class Leak:
    """A process whose memory surely grows: `slope` in bytes per hour with its 95 % interval."""

    pid: int
    name: str
    slope: Slope
    memory_bytes: int
    hours: float  # that were looked at

    @property
    def text(self) -> str:
        """For people."""
        mib = 1 << 20
        return (
            f"{self.name} ({self.pid}) grows by {self.slope.value / mib:.1f} MiB an hour "
            f"(95 % sure: {self.slope.low / mib:.1f} to {self.slope.high / mib:.1f}), "
            f"seen over {self.hours:.1f} h, now {self.memory_bytes / mib:.0f} MiB"
        )


class ResourceProcessing:
    """Takes one look after another at a robot's computer; memory is bounded whatever runs there."""

    def __init__(self) -> None:
        self.history = History(SERIES)
        self.devices = History(DEVICES)  # of looks that were asked for them
        self._looks: collections.deque[float] = collections.deque(maxlen=PERCENTAGES)  # at processes, s
        self._processes: collections.OrderedDict[tuple[int, str], _Process] = collections.OrderedDict()
        self._now_s = 0.0

    def take(self, snapshot: ResourceSnapshot) -> None:
        """Take one look."""
        self._now_s = snapshot.stamp_ns / 1e9
        cpu, memory, gateway = snapshot.cpu, snapshot.memory, snapshot.gateway
        self.history.append(
            self._now_s,
            (
                cpu.percent,
                memory.used,
                memory.available,
                memory.swap_used,
                gateway.cpu_percent,
                gateway.rss_bytes,
            ),
        )
        self._take_devices(snapshot)
        if snapshot.processes is not UNSET:
            if self._looks and self._now_s < self._looks[-1]:
                self._looks.clear()  # the robot's clock has begun anew
            self._looks.append(self._now_s)
            for process in snapshot.processes:
                self._seen(process)

    def top(self, limit: int = 8, by: str = "cpu") -> list[Consumer]:
        """Return the greatest consumers of the last minute, by `cpu` or `memory`.

        Raises:
            ValueError: `by` is neither.

        """
        if by not in ("cpu", "memory"):
            raise ValueError(f"processes are sorted by cpu or memory, not by {by!r}")
        seen = [process.consumer() for process in self._processes.values() if process.is_here(self._now_s)]
        if by == "cpu":
            return sorted(seen, key=lambda one: -(one.cpu_percent or 0.0))[:limit]
        return sorted(seen, key=lambda one: -one.memory_bytes)[:limit]

    def over_time(self, consumers: Sequence[Consumer]) -> tuple[Floats, list[Floats]]:
        """Return times (s) of the last looks at processes, and the CPU of each, NaN if unknown."""
        times = np.array(self._looks, np.float64)
        return times, [self._processes[one.pid, one.name].percentages(self._looks) for one in consumers]

    def _take_devices(self, snapshot: ResourceSnapshot) -> None:
        disk, network, thermal = snapshot.disk, snapshot.network, snapshot.thermal
        if disk is UNSET or network is UNSET or thermal is UNSET:
            return
        hottest = max((value for value in thermal.values() if value is not None), default=None)
        disks = disk.read_bytes_per_s, disk.write_bytes_per_s
        networks = network.received_bytes_per_s, network.sent_bytes_per_s
        self.devices.append(self._now_s, (*disks, *networks, hottest))

    def leaks(self) -> list[Leak]:
        """Return the processes that surely leak, the fastest first."""
        found = [process.leak() for process in self._processes.values() if process.is_here(self._now_s)]
        return sorted((leak for leak in found if leak is not None), key=lambda leak: -leak.slope.value)

    def _seen(self, use: ProcessUse) -> None:
        key = use.pid, use.name
        process = self._processes.get(key)
        if process is None:
            if len(self._processes) >= PROCESSES:
                self._processes.popitem(last=False)
            process = self._processes[key] = _Process(use)
        self._processes.move_to_end(key)
        process.take(self._now_s, use)


class _Process:
    """History of one process: a minute of CPU, two hours of memory, a median a minute."""

    def __init__(self, first: ProcessUse) -> None:
        self._pid, self._name, self._label = first.pid, first.name, short_name(first)
        self._cpu: collections.deque[tuple[float, float]] = collections.deque(maxlen=PERCENTAGES)
        self._minutes: collections.deque[tuple[float, float]] = collections.deque(maxlen=LEAK_MINUTES)
        self._minute: list[int] = []
        self._minute_s = 0.0
        self._begun = 0  # minutes since it was first seen
        self._judged: tuple[int, Leak | None] = (0, None)  # after so many minutes
        self._memory = 0
        self._seen_s = 0.0

    def take(self, now_s: float, use: ProcessUse) -> None:
        self._seen_s, self._memory = now_s, use.memory_bytes
        if use.cpu_percent is not None:
            self._cpu.append((now_s, use.cpu_percent))
        if self._minute and now_s - self._minute_s >= COARSE_S:
            self._end_minute()
        if not self._minute:
            self._minute_s = now_s
        self._minute.append(use.memory_bytes)

    def _end_minute(self) -> None:
        self._begun += 1
        if self._begun > WARM_UP_MINUTES:
            self._minutes.append((self._minute_s, statistics.median(self._minute)))
        self._minute.clear()

    def percentages(self, times: Iterable[float]) -> Floats:
        """Return its CPU at these looks."""
        known = dict(self._cpu)
        return np.array([known.get(at_s, np.nan) for at_s in times], np.float64)

    def is_here(self, now_s: float) -> bool:
        return 0.0 <= now_s - self._seen_s <= TOP_S

    def consumer(self) -> Consumer:
        recent = [percent for at_s, percent in self._cpu if self._seen_s - at_s <= TOP_S]
        cpu = statistics.fmean(recent) if recent else None
        return Consumer(self._pid, self._name, cpu, self._memory, self._label)

    def leak(self) -> Leak | None:
        """Judged anew once a minute."""
        if self._judged[0] != self._begun:
            self._judged = self._begun, self._judge()
        return self._judged[1]

    def _judge(self) -> Leak | None:
        slope = leaking(self._minutes) if len(self._minutes) >= LEAK_FEWEST else None
        if slope is None:
            return None
        hours = (self._minutes[-1][0] - self._minutes[0][0]) / 3600.0
        return Leak(self._pid, self._name, slope, self._memory, hours)


def leaking(memory: Sequence[tuple[float, float]]) -> Slope | None:
    """Return the slope (bytes an hour) of memory that surely grows, of times (s) and bytes; else None.

    The 95 % interval of the Theil–Sen slope must lie above `LEAK_BYTES_PER_HOUR` over the whole and over the
    later half, so that one step up, as of a cache that is filled, is no leak.
    """
    data = np.array(memory, np.float64)
    hours, size = data[:, 0] / 3600.0, data[:, 1]
    half = len(data) // 2
    slopes = theil_sen(hours, size), theil_sen(hours[half:], size[half:])
    gained = slopes[0] is not None and slopes[0].value * (hours[-1] - hours[0]) >= LEAK_BYTES
    sure = all(slope is not None and slope.low > LEAK_BYTES_PER_HOUR for slope in slopes)
    return slopes[0] if gained and sure else None
