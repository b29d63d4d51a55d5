"""The computer: CPU, memory, processes, and what made its control loop late."""

from typing import Annotated, Literal

from msgspec import UNSET, Meta, Struct, UnsetType, field

from gateway.wire.method import Method, Params
from gateway.wire.role import Role

Include = Literal["disk", "network", "thermal", "kernel", "cmdline", "control"]


class ResourceSnapshotParams(Params, frozen=True):
    """`resource.snapshot`; by default the processes come in order of CPU, highest first."""

    processes: bool = True
    include: list[Include] = field(default_factory=list)
    sort: Literal["cpu", "memory", "name", "pid"] = "cpu"
    descending: bool | None = None  # None: highest first for cpu and memory, lowest first for name and pid
    limit: Annotated[int, Meta(ge=0)] | None = None


class CpuUse(Struct, frozen=True):
    """Percent of all cores together and of each, since this connection's last request.

    `load` is the mean run queue over 1, 5 and 15 minutes.
    """

    percent: float | None
    per_core: list[float | None]
    load: list[float]


class MemoryUse(Struct, frozen=True):
    """Bytes."""

    total: int
    available: int
    used: int
    swap_used: int


class ProcessUse(Struct, frozen=True, gc=False):  # there are many of them
    """One process; `name` is the kernel's, `cpu_percent` of one core, `memory_bytes` its resident set."""

    pid: int
    name: str
    cpu_percent: float | None
    memory_bytes: int
    cmdline: str | UnsetType = UNSET


class GatewayUse(Struct, frozen=True):
    """The gateway's own use; `cpu_percent` is of one core."""

    cpu_percent: float | None
    rss_bytes: int


class DiskUse(Struct, frozen=True):
    """Bytes per second over all disks since this connection's last request."""

    read_bytes_per_s: float | None
    write_bytes_per_s: float | None


class NetworkUse(Struct, frozen=True):
    """Bytes per second over all interfaces since this connection's last request."""

    received_bytes_per_s: float | None
    sent_bytes_per_s: float | None


class Throttling(Struct, frozen=True):
    """Throttling of the cores, as far as the system reports it."""

    events: int | None  # times that a core was too hot since boot, summed over the cores
    cooling: dict[str, float]  # cooling device of the processor → share of the most that it can hold back
    frequency: list[float | None]  # of each group of cores that share one: share of its highest


class KernelFacts(Struct, frozen=True):
    """The operating system's kernel, and its clocks; `None` is not known."""

    system: str
    release: str
    version: str
    preempt_rt: bool | None
    clocksource: str | None = None  # what the monotonic clock counts by
    monotonic_resolution_ns: int | None = None
    utc_synchronised: bool | None = None


class ThreadUse(Struct, frozen=True):
    """One thread of a control process; percentages are of one core.

    `wait_percent` is the time it was ready to run while others ran. `priority` is 1 to 99 of a real-time
    policy, else its nice value.
    """

    tid: int
    name: str
    cpu_percent: float | None
    wait_percent: float | None
    policy: str  # other, batch, idle, fifo, rr, deadline
    priority: int
    core: int  # that it last ran on
    switches_per_s: float | None  # because it waited for something
    forced_switches_per_s: float | None  # because another was to run


class ControlProcess(Struct, frozen=True):
    """One process of `[control_loop]`; what its owner hides from us is `None`."""

    pid: int
    name: str
    minor_faults_per_s: float | None
    major_faults_per_s: float | None  # that had to wait for a disk
    read_bytes_per_s: float | None  # from disks
    write_bytes_per_s: float | None
    threads: list[ThreadUse]


class ResourceSnapshot(Struct, frozen=True):
    """Result of `resource.snapshot`; what was not asked for is not there."""

    stamp_ns: int
    cpu: CpuUse
    memory: MemoryUse
    gateway: GatewayUse
    processes: list[ProcessUse] | UnsetType = UNSET
    disk: DiskUse | UnsetType = UNSET
    network: NetworkUse | UnsetType = UNSET
    thermal: dict[str, float | None] | UnsetType = UNSET  # sensor → °C
    throttling: Throttling | UnsetType = UNSET  # comes with `thermal`
    kernel: KernelFacts | UnsetType = UNSET
    control: list[ControlProcess] | UnsetType = UNSET


class RanInstead(Struct, frozen=True):
    """A process that ran on a core of the control loop while that was late, and its busiest thread."""

    pid: int
    name: str
    thread: str
    ran_ms: float  # all its threads
    core: int
    policy: str
    priority: int


class Overrun(Struct, frozen=True):
    """A frame of the control loop that came too late, and what the computer did since the one before.

    `reason` is others_ran (it was ready, and others ran), own_work (it ran longer than it usually does) or
    asleep (it waited for a device, a lock or its timer).
    """

    stamp_ns: int
    late_ms: float
    reason: str
    ran_ms: float  # the control loop itself
    waited_ms: float  # it was ready to run
    instead: list[RanInstead]  # the longest first, but last those that the control loop may run ahead of


class Overruns(Struct, frozen=True):
    """Result of `resource.overruns`: since this connection asked last; watched as long as it lasts."""

    watching_since_ns: int
    control: dict[str, str]  # the control loop's processes that are there: process id → name
    cycles: int  # since it is watched
    missed: int
    overruns: list[Overrun]


RESOURCE_SNAPSHOT = Method(
    "resource.snapshot",
    ResourceSnapshotParams,
    ResourceSnapshot,
    module="resource",
    in_turn=True,
    role=Role.VIEWER,
)
RESOURCE_OVERRUNS = Method("resource.overruns", Params, Overruns, module="blame", role=Role.VIEWER)
METHODS = (RESOURCE_SNAPSHOT, RESOURCE_OVERRUNS)
