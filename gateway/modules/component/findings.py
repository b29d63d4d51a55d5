"""The parts of `robot.describe` on buses, findings and the last EMCY."""

from collections.abc import Iterable, Mapping
from typing import cast

from msgspec import UNSET, UnsetType

from drivers.bus.bus import CanBus
from drivers.bus.liveness import NodeLife
from drivers.bus.nmt import HEARTBEAT
from drivers.bus.node import Node
from drivers.component import Component
from drivers.samples import Finding
from gateway.wire.bus import CLOSED, BusInfo, NodeInfo, TalkInfo
from gateway.wire.component import EmcyInfo
from gateway.wire.finding import FindingInfo


def finding_infos(findings: Iterable[Finding]) -> list[FindingInfo]:
    return [FindingInfo(one.since_ns, one.words, one.check) for one in findings]


def bus_infos(buses: Mapping[str, CanBus], now_ns: int) -> list[BusInfo]:
    """Return every bus, as it is now."""
    return [_bus(bus, now_ns) for bus in buses.values()]


def _bus(bus: CanBus, now_ns: int) -> BusInfo:
    health, nodes = bus.health, cast("dict[int, Node]", bus.nodes)  # nobody else puts one there
    return BusInfo(
        name=bus.name,
        state=health.state.value if bus.is_open else CLOSED,
        bitrate=bus.settings.bitrate,
        load_percent=_rounded(health.load_percent),
        frames_per_s=_rounded(health.frames_per_s),
        error_frames=health.error_frames,
        bus_offs=health.bus_offs,
        opened=bus.opened,
        dropped=bus.dropped,
        nodes=[_node(nodes[node_id], now_ns) for node_id in sorted(nodes)],
        problem=bus.trouble,
        findings=finding_infos(bus.findings),
        talks=[
            TalkInfo(one.kind, one.node_id, round(one.frames_per_s, 1), list(one.identifiers))
            for one in bus.traffic.talks
        ],
        strangers=_strangers(bus),
    )


def _strangers(bus: CanBus) -> list[int]:
    """Return nodes whose heartbeat has come although no table has them; ours is nobody's."""
    heard = {can_id - HEARTBEAT for can_id in bus.unclaimed.copy()}
    return sorted(node_id for node_id in heard if 0 < node_id <= 127 and node_id not in bus.nodes)


def _node(node: Node, now_ns: int) -> NodeInfo:
    trips = node.channel.round_trips
    p50_ms, max_ms = trips.median_and_longest_ms(now_ns) or (None, None)
    missing = max((one.missing for one in node.arrivals if one.missing is not None), default=None)
    return NodeInfo(
        node_id=node.node_id,
        components=list(node.names),
        sdo_p50_ms=_rounded(p50_ms),
        sdo_max_ms=_rounded(max_ms),
        sdo_transfers=node.channel.counters.transfers,
        sdo_timeouts=node.channel.counters.timeouts,
        sdo_late=trips.late,
        pdos_missing_percent=None if missing is None else _rounded(100 * missing),
        findings=finding_infos(node.trouble),
    )


def emcy_info(component: Component | None) -> EmcyInfo | UnsetType:
    """Return the last one of a component that is a CANopen device."""
    node: Node | None = getattr(component, "node", None)
    life: NodeLife | None = None if node is None else node.life
    if node is None or life is None or not life.emcy_history:
        return UNSET
    told = [emcy for emcy in tuple(life.emcy_history) if not emcy.resets]
    if not told:
        return UNSET
    last = told[-1]
    words = last.text(node.description.vendor_id)
    return EmcyInfo(last.stamp_ns, last.code, words, active=life.active_emcy is last)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 1)
