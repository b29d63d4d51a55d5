"""CAN buses of `robot.describe`, as far as the gateway sees them anyway while it has them open."""

from msgspec import Struct

from gateway.wire.finding import FindingInfo
from gateway.wire.method import Method, Params
from gateway.wire.role import Role

CLOSED = "closed"  # a bus's state that is not open
EXTENDED, REMOTE = 1 << 31, 1 << 30  # of an identifier: it has 29 bits; it is a remote request


class NodeInfo(Struct, frozen=True):
    """One CANopen node: how it answers, and what is missing of its PDOs; counters are since it is watched.

    Round trips are of the last minute. `late` answers came when nobody waited for them any more.
    """

    node_id: int
    components: list[str]  # that live on it
    sdo_p50_ms: float | None
    sdo_max_ms: float | None
    sdo_transfers: int
    sdo_timeouts: int
    sdo_late: int
    pdos_missing_percent: float | None  # of those that bring the position at a steady pace; None: not known
    findings: list[FindingInfo] = []


class TalkInfo(Struct, frozen=True):
    """Frames of one kind and node within the last second, by CiA 301's pre-defined connection set.

    Of its identifiers those with the most frames are named; bit 31 is set in one of 29 bits, bit 30 in a
    remote request, as in SocketCAN.
    """

    kind: str
    node_id: int | None  # None: they belong to no node
    frames_per_s: float
    identifiers: list[int] = []


class BusInfo(Struct, frozen=True):
    """One bus. Load and frames are of the last second; the counters are since the gateway watches it.

    Where an interface filters for us and does not count, only the frames that came and left are known.
    """

    name: str
    state: str  # of our CAN controller: error active, error warning, error passive, bus off; closed
    bitrate: int | None
    load_percent: float | None  # None: not known yet, or the file tells no bitrate
    frames_per_s: float | None
    error_frames: int
    bus_offs: int
    opened: int  # times
    dropped: int  # frames that were lost on their way to us since it opened
    nodes: list[NodeInfo]
    problem: str | None = None  # why it is not open, or what its controller or its link says
    findings: list[FindingInfo] = []
    talks: list[TalkInfo] = []  # the most first; of frames that came to the gateway
    strangers: list[int] = []  # node ids that were heard and that no table has


class Buses(Struct, frozen=True):
    """Result of `bus.snapshot`."""

    stamp_ns: int
    buses: list[BusInfo]


def identifier_text(identifier: int) -> str:
    """Return an identifier as it is written: one of 29 bits with eight digits."""
    plain = f"0x{identifier & ~(EXTENDED | REMOTE):0{8 if identifier & EXTENDED else 3}X}"
    return f"{plain} (remote request)" if identifier & REMOTE else plain


BUS_SNAPSHOT = Method("bus.snapshot", Params, Buses, module="component", role=Role.VIEWER)
METHODS = (BUS_SNAPSHOT,)
