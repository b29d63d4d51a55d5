"""Messages on the cost of monitoring."""

from msgspec import Struct

from gateway.wire.method import Method, Params
from gateway.wire.role import Role


class BudgetInfo(Struct, frozen=True):
    """The gateway's CPU budget, of a core; beyond it, its streams send one row of `shed`."""

    max_cpu_percent: float
    shed: int


class StreamCost(Struct, frozen=True):
    """One stream of a client; `rate_hz` 0 is every source's own samples."""

    stream: int
    rate_hz: float
    channels: int
    rows_per_s: float | None
    dropped: int  # since it began
    shed: int  # it sends one row of so many


class ClientCost(Struct, frozen=True):
    """Cost of one client; `cpu_percent` is of one core, with its part of the shared cost."""

    who: str
    cpu_percent: float | None
    requests_per_s: float | None
    sent_bytes_per_s: float | None
    received_bytes_per_s: float | None
    waiting_bytes: int  # for a client that is slow
    streams: list[StreamCost]


class BusCost(Struct, frozen=True):
    """The gateway's load on one bus; the answer to each SDO request is a frame of the same length.

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


GATEWAY_COST = Method("gateway.cost", Params, GatewayCost, role=Role.VIEWER)
METHODS = (GATEWAY_COST,)
