"""The robot itself: its name, its clock, its components and the state of stop and guard."""

from typing import Annotated

from msgspec import Meta, Struct

from gateway.wire.bus import BusInfo
from gateway.wire.component import ChannelInfo, ComponentInfo
from gateway.wire.control import RecordsInfo
from gateway.wire.cost import BudgetInfo
from gateway.wire.framing import PROTOCOL
from gateway.wire.limits import NAME_LENGTH
from gateway.wire.method import Method, Params
from gateway.wire.parameter import ParameterInfo, TrialInfo
from gateway.wire.role import Role
from gateway.wire.stop import StopInfo

ClientName = Annotated[str, Meta(max_length=NAME_LENGTH)]


class HelloParams(Params, frozen=True):
    """`hello`."""

    client: ClientName
    protocol: int = PROTOCOL
    token: str | None = None


class Hello(Struct, frozen=True):
    """Result of `hello`."""

    protocol: int
    robot: str
    role: str  # of the client: viewer, operator, maintainer
    boot_id: str
    version: str | None = None  # of the gateway's software; None: from before gateways told it
    identity: str | None = None  # whose key or account it is; None: the robot has no keys
    refused: dict[str, str] = {}  # method → why this client may not ask for it
    listens: str | None = None  # HOST:PORT of its TCP port; None: from before gateways told it

    @property
    def who(self) -> str:
        """The client's identity and role there, in words."""
        return f"{self.identity or 'whoever is on its computer'}, as {self.role}"


class Clock(Struct, frozen=True):
    """Result of `clock.read`: one instant on both clocks."""

    monotonic_ns: int
    utc_ns: int
    boot_id: str


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
    quantities: list[str] = []  # of which `low` and `high` are the limits, where these are all that it judges
    low: float | None = None  # SI
    high: float | None = None


class GuardInfo(Struct, frozen=True):
    """The always-on watch; `arming` says of each joint whether it stops when the gateway dies, or why not."""

    configured: bool = False
    problem: str | None = None  # why it does not run
    heartbeat_ms: int | None = None
    rules: list[GuardRuleInfo] = []
    arming: dict[str, str] = {}
    alarms: int = 0  # since it began


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
    buses: list[BusInfo] = []
    file: str | None = None  # digest of what the robot's file said when the gateway read it


HELLO = Method("hello", HelloParams, Hello, role=Role.VIEWER)
CLOCK_READ = Method("clock.read", Params, Clock, role=Role.VIEWER)
ROBOT_DESCRIBE = Method("robot.describe", Params, Description, role=Role.VIEWER)
METHODS = (HELLO, CLOCK_READ, ROBOT_DESCRIBE)
