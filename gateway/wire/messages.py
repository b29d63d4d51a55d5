"""What each method of the wire takes and gives, as typed structs; the names are a contract.

Parameters forbid unknown fields. Results may grow: a reader ignores fields it does not know.
"""

from typing import Annotated, Any, Final, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

from gateway.connections.limits import NAME_LENGTH
from gateway.wire.framing import PROTOCOL

Globs = list[str]
ClientName = Annotated[str, Meta(max_length=NAME_LENGTH)]
Number = int | float
Seconds = Annotated[float, Meta(gt=0, le=300)]
ModuleName = Literal["component", "status", "resource"]
Include = Literal["disk", "network", "thermal", "kernel", "cmdline", "control"]


class Params(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of a method; as it stands, of one that takes none."""


class HelloParams(Params, frozen=True):
    """`hello`."""

    client: ClientName
    protocol: int = PROTOCOL
    token: str | None = None


class ResourceSnapshotParams(Params, frozen=True):
    """`resource.snapshot`; by default the processes come in order of CPU, highest first."""

    processes: bool = True
    include: list[Include] = []
    sort: Literal["cpu", "memory", "name", "pid"] = "cpu"
    descending: bool | None = None  # None: highest first for cpu and memory, lowest first for name and pid
    limit: Annotated[int, Meta(ge=0)] | None = None


class SnapshotParams(Params, frozen=True):
    """`component.snapshot`; `channels` are globs such as `left_*.position`, none means all."""

    channels: Globs | None = None


class StreamStartParams(Params, frozen=True):
    """`stream.start`; `rate_hz` 0 sends every source's own samples."""

    modules: Annotated[list[ModuleName], Meta(min_length=1)]
    rate_hz: Annotated[float, Meta(ge=0, le=1000)]
    channels: Globs | None = None


class StreamStopParams(Params, frozen=True):
    """`stream.stop`."""

    stream: int


class AcquireParams(Params, frozen=True):
    """`control.acquire`."""

    ttl_s: Seconds


class ReleaseParams(Params, frozen=True):
    """`control.release`; a lease belongs to its connection, naming it is a check."""

    lease: str | None = None


class ParameterParams(Params, frozen=True):
    """`parameter.list` and `parameter.read`: names, addresses such as `left_knee.0x6072:0`, and globs.

    No names means every parameter but those that are `read_only`.
    """

    names: Globs | None = None


class ParameterWriteParams(Params, frozen=True):
    """`parameter.write`: values in the parameter's own unit."""

    changes: Annotated[dict[str, Number], Meta(min_length=1)]
    trial_s: Seconds | None = None


class WriteNumberParams(Params, frozen=True):
    """`parameter.confirm` and `parameter.revert`: the number that the trial's write was answered with."""

    write: int


class ComponentParams(Params, frozen=True):
    """`parameter.store` and `parameter.restore`."""

    component: str


class EnableParams(Params, frozen=True):
    """`robot.enable`; `joints` are globs, none means all."""

    joints: Globs | None = None


class TailParams(Params, frozen=True):
    """`journal.tail`."""

    n: Annotated[int, Meta(ge=1, le=1000)] = 20


class StopParams(Struct, frozen=True):
    """`robot.stop`; takes whatever it is given, because a stop is never refused for its form."""

    reason: Any = ""


class Done(Struct, frozen=True):
    """The result of a method that has nothing to tell."""


class Hello(Struct, frozen=True):
    """Result of `hello`."""

    protocol: int
    robot: str
    role: str
    boot_id: str
    version: str | None = None  # of the gateway's software; None: from before gateways told it


class Clock(Struct, frozen=True):
    """Result of `clock.read`: one instant on both clocks."""

    monotonic_ns: int
    utc_ns: int
    boot_id: str


class LayoutInfo(Struct, frozen=True):
    """Where an insole's cells are as it is worn: [x, y, area] of `cell_0`, `cell_1` …, in m and m².

    x is forward from the rear edge of the heel, y to the left from the foot's centre line.
    """

    name: str
    cells: list[tuple[float, float, float]]


class ComponentInfo(Struct, frozen=True):
    """One component of `robot.describe`; `problem` says in words what is wrong."""

    name: str
    kind: str
    state: str
    problem: str | None = None
    device: dict[str, str | int] | UnsetType = UNSET  # what its EDS says, where it is on which bus
    layout: LayoutInfo | UnsetType = UNSET  # of an insole


class ChannelInfo(Struct, frozen=True):
    """One channel of `robot.describe`; `enum` gives a state's numbers their words."""

    name: str
    unit: str
    component: str
    quantity: str
    enum: dict[str, str] | UnsetType = UNSET


class ParameterInfo(Struct, frozen=True):
    """One parameter of `robot.describe`; `states` are the drive states it may be written in, `None` any.

    The device's number is the value divided by `scale`, as the CiA 301 data type `type`. `read_only` says in
    a word why it cannot be written; a write is refused in full words.
    """

    name: str
    unit: str
    min: Number | None
    max: Number | None
    max_step: float | None
    live: bool
    states: list[str] | None
    component: str
    object: str
    access: str
    store: bool
    problem: str | None = None
    read_only: str | None = None
    type: str = ""
    scale: float = 1.0
    default: Number | None = None  # where the EDS gives one


class TrialInfo(Struct, frozen=True):
    """A write that is on trial, or still to be taken back."""

    write: int
    who: str
    values: dict[str, Number]  # what was written
    before: dict[str, Number]  # what it reverts to
    left_s: float | None  # until it reverts by itself; None: it is being taken back
    problem: str | None = None  # why it could not be taken back yet


class RecordsInfo(Struct, frozen=True):
    """Where the journal is kept, and why it cannot be written."""

    folder: str
    problem: str | None = None


class DriveReaction(Struct, frozen=True):
    """What one drive does by itself: option codes as the drive holds them, `None` where they are unknown."""

    quick_stop_option: int | None = None  # 605Ah
    abort_connection_option: int | None = None  # 6007h
    armed: bool = False  # whether it stops by itself when the gateway dies
    quick_stop: str | None = None  # the first in words
    abort_connection: str | None = None  # the second in words


class StopInfo(Struct, frozen=True):
    """How a stop acts on this robot, and whether one is held now."""

    held: bool
    reason: str | None
    since_ns: int | None
    stopped_again: dict[str, int]  # drive → how often somebody enabled it while the stop was held
    drives: dict[str, DriveReaction]
    fallbacks: list[str] = []  # what follows, in words, where a drive does not confirm its quick stop
    controllers: dict[str, str | None] = {}  # that a stop goes to as well; why it cannot, `None` where it can
    problem: str | None = None  # why the held stop will not outlive this gateway


class GuardRuleInfo(Struct, frozen=True):
    """One rule of the guard: `state` is the worst of its inputs', `problems` says which it cannot see."""

    name: str
    watch: str
    limit: str  # what makes it trip, in words
    on: list[str]
    actions: list[str]
    blind: str  # what it does where it cannot see: alarm or act
    state: str  # watching, cleared, blind, tripped
    since_ns: int
    reason: str | None
    trips: int
    problems: list[str]


class GuardInfo(Struct, frozen=True):
    """The always-on watch; `arming` says of each joint whether it stops when the gateway dies, or why not."""

    configured: bool = False
    problem: str | None = None  # why it does not run
    heartbeat_ms: int | None = None
    rules: list[GuardRuleInfo] = []
    arming: dict[str, str] = {}
    alarms: int = 0  # since it began


class BudgetInfo(Struct, frozen=True):
    """What the gateway may use of a core; beyond it, its streams send one row of `shed`."""

    max_cpu_percent: float
    shed: int


class Description(Struct, frozen=True):
    """Result of `robot.describe`."""

    robot: str
    boot_id: str
    role: str  # of the gateway on the bus
    components: list[ComponentInfo]
    channels: list[ChannelInfo]
    parameters: list[ParameterInfo]
    modules: dict[str, str]  # module → off, starting, running, stopping
    clock: Clock
    stop: StopInfo
    guard: GuardInfo
    trials: list[TrialInfo] = []
    records: RecordsInfo | None = None
    budget: BudgetInfo | None = None
    version: str | None = None  # as in `hello`


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
    """What the gateway itself costs; `cpu_percent` is of one core."""

    cpu_percent: float | None
    rss_bytes: int


class StreamCost(Struct, frozen=True):
    """One stream of a client; `rate_hz` 0 is every source's own samples."""

    stream: int
    rate_hz: float
    channels: int
    rows_per_s: float | None
    dropped: int  # since it began
    shed: int  # it sends one row of so many


class ClientCost(Struct, frozen=True):
    """What one client causes; `cpu_percent` is of one core, and of what clients share it has its part."""

    who: str
    cpu_percent: float | None
    requests_per_s: float | None
    sent_bytes_per_s: float | None
    received_bytes_per_s: float | None
    waiting_bytes: int  # for a client that is slow
    streams: list[StreamCost]


class BusCost(Struct, frozen=True):
    """What the gateway does on one bus; each SDO request that it sends is answered by a frame as long.

    `load_percent` is what its frames and their answers take of the bus, without stuff bits; `None` where the
    bitrate is not known. What it only receives is there without it.
    """

    sent_frames_per_s: float | None
    sent_bytes_per_s: float | None
    received_frames_per_s: float | None
    load_percent: float | None


class GatewayCost(Struct, frozen=True):
    """Result of `gateway.cost`; rates are since this connection's last request, `None` in the first."""

    stamp_ns: int
    cpu_percent: float | None  # of one core, all threads
    rss_bytes: int
    threads: int
    wake_ups_per_s: float | None  # context switches of all threads
    modules: dict[str, str]  # module → off, starting, running, stopping
    buses: dict[str, BusCost]
    clients: list[ClientCost]
    budget: BudgetInfo | None = None


class DiskUse(Struct, frozen=True):
    """Bytes per second over all disks since this connection's last request."""

    read_bytes_per_s: float | None
    write_bytes_per_s: float | None


class NetworkUse(Struct, frozen=True):
    """Bytes per second over all interfaces since this connection's last request."""

    received_bytes_per_s: float | None
    sent_bytes_per_s: float | None


class Throttling(Struct, frozen=True):
    """How far the cores are held back, as far as the system tells."""

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


QualityInfo = dict[str, str | int | float | None]  # state, age_ms, problem, and the component's own counters


class Snapshot(Struct, frozen=True):
    """Result of `component.snapshot` and `status.snapshot`."""

    stamp_ns: int
    values: dict[str, float | None]
    stamps_ns: dict[str, int | None]
    quality: dict[str, QualityInfo]


class StreamStarted(Struct, frozen=True):
    """Result of `stream.start`."""

    stream: int


class StreamData(Struct, frozen=True):
    """Parameters of the notification `stream.data`: row i of every column was taken at `stamp_ns[i]`."""

    stream: int
    seq: int
    dropped: int
    stamp_ns: list[int]
    columns: dict[str, list[float | None]]
    shed: int = 1  # one row of so many was sent, because the gateway keeps to `max_cpu_percent`


class Lease(Struct, frozen=True):
    """Result of `control.acquire`."""

    lease: str
    expires_s: float


class ParameterValue(Struct, frozen=True):
    """One parameter's value; `None` with the reason in `problem` where it is not known."""

    value: Number | None
    unit: str
    min: Number | None
    max: Number | None
    stamp_ns: int | None
    problem: str | None = None


class ParameterValues(Struct, frozen=True):
    """Result of `parameter.list` and `parameter.read`."""

    values: dict[str, ParameterValue]


class Written(Struct, frozen=True):
    """Result of `parameter.write`: values as the device holds them.

    On trial, `trial_s` is the time until it reverts by itself, and `before` is what it reverts to, which may
    name more parameters than were asked for: those of the trials that this one replaces.
    """

    write: int
    before: dict[str, Number]
    after: dict[str, Number]
    trial_s: float | None = None


class Confirmed(Struct, frozen=True):
    """Result of `parameter.confirm`: what stays written."""

    write: int
    values: dict[str, Number]


class Reverted(Struct, frozen=True):
    """Result of `parameter.revert`: in words, what became of each parameter."""

    write: int
    outcome: dict[str, str]


class Stored(Struct, frozen=True):
    """Result of `parameter.store` and `parameter.restore`: in words, what the device has done."""

    component: str
    result: str


StopOutcome = Literal["confirmed", "unconfirmed", "unreachable"]


class Stopped(Struct, frozen=True):
    """Result of `robot.stop`: what is known when all have confirmed, or the time for an answer is over."""

    drives: dict[str, StopOutcome]
    held: bool
    controllers: dict[str, StopOutcome] = {}  # of `[[stop.controller]]`
    fallbacks: dict[str, str] = {}  # drive → what was carried out beyond the quick stop, in words
    problem: str | None = None  # why the stop is not held beyond this gateway


class Reset(Struct, frozen=True):
    """Result of `robot.reset`: each drive's state in words; `problems` says which were not led there."""

    drives: dict[str, str]
    problems: dict[str, str]
    held: bool


class Enabled(Struct, frozen=True):
    """Result of `robot.enable`: each drive's state in words, and which were not led there, and why.

    Where there are problems, every drive that was begun has been stopped again. `modes` are those that the
    drives were enabled in, in words.
    """

    drives: dict[str, str]
    problems: dict[str, str]
    modes: dict[str, str] = {}


class JournalEntries(Struct, frozen=True):
    """Result of `journal.tail`: the newest entries, oldest first; `cut` says why there are not more."""

    entries: list[dict[str, Any]]
    cut: str | None = None


class Method(Struct, frozen=True):
    """What a method takes and gives."""

    params: type[Struct]
    result: type[Struct]


METHODS: Final[dict[str, Method]] = {
    "hello": Method(HelloParams, Hello),
    "clock.read": Method(Params, Clock),
    "robot.describe": Method(Params, Description),
    "robot.stop": Method(StopParams, Stopped),
    "gateway.cost": Method(Params, GatewayCost),
    "resource.snapshot": Method(ResourceSnapshotParams, ResourceSnapshot),
    "resource.overruns": Method(Params, Overruns),
    "component.snapshot": Method(SnapshotParams, Snapshot),
    "status.snapshot": Method(Params, Snapshot),
    "stream.start": Method(StreamStartParams, StreamStarted),
    "stream.stop": Method(StreamStopParams, Done),
    "control.acquire": Method(AcquireParams, Lease),
    "control.release": Method(ReleaseParams, Done),
    "parameter.list": Method(ParameterParams, ParameterValues),
    "parameter.read": Method(ParameterParams, ParameterValues),
    "parameter.write": Method(ParameterWriteParams, Written),
    "parameter.confirm": Method(WriteNumberParams, Confirmed),
    "parameter.revert": Method(WriteNumberParams, Reverted),
    "parameter.store": Method(ComponentParams, Stored),
    "parameter.restore": Method(ComponentParams, Stored),
    "robot.reset": Method(Params, Reset),
    "robot.enable": Method(EnableParams, Enabled),
    "journal.tail": Method(TailParams, JournalEntries),
}
STREAM_DATA: Final = "stream.data"
