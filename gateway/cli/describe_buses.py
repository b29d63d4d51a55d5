"""The part of `gwrms describe` that tells of buses, emergency messages, and what was found."""

import textwrap
from collections.abc import Iterator, Mapping
from typing import Final

from drivers.bus.boot_diagnosis import OVERLOAD_PERCENT
from drivers.bus.health import BUSY
from drivers.bus.traffic import NAMED, OTHER
from drivers.error_codes import error_check
from gateway.amounts import NONE, percent
from gateway.cli.text import PAGE, table
from gateway.wire.bus import BusInfo, NodeInfo, TalkInfo, identifier_text
from gateway.wire.component import ComponentInfo
from gateway.wire.finding import FindingInfo
from gateway.wire.robot import Description

TOLD: Final = 5  # kinds of frames of a busy bus, each of a node
TO_NODES: Final = ("RPDO", "SDO request")  # somebody sends these to the node


def chapters(robot: Description) -> Iterator[str]:
    """Tables of what there is; none of what there is not."""
    if robot.buses:
        yield table(
            ("BUS", "STATE", "LOAD", "FRAMES/S", "ERROR FRAMES", "BUS OFF", "LOST", "PROBLEM"),
            [_bus(bus) for bus in robot.buses],
            right=range(2, 7),
        )
        yield from (_traffic(bus) for bus in robot.buses if bus.talks and _is_busy(bus))
        yield table(
            ("NODE", "COMPONENTS", "SDO p50", "SDO max", "SENT", "UNANSWERED", "LATE", "PDOs MISSING"),
            [_node(bus, node) for bus in robot.buses for node in bus.nodes],
            right=range(2, 8),
        )
        yield from (_strangers(bus) for bus in robot.buses if bus.strangers)
    now_ns = robot.clock.monotonic_ns
    emcys = [row for part in robot.components for row in _emcy(part, now_ns)]
    if emcys:
        yield table(("COMPONENT", "LAST EMCY", "AGE", "CHECK"), emcys, right=(2,))
    found = [(where, _age(now_ns - one.since_ns), one.words, one.check) for where, one in _findings(robot)]
    if found:
        yield table(("FOUND AT", "FOR", "WHAT", "CHECK"), found, right=(1,))


def _bus(bus: BusInfo) -> tuple[str, ...]:
    frames = NONE if bus.frames_per_s is None else f"{bus.frames_per_s:.0f}"
    counted = (bus.error_frames, bus.bus_offs, bus.dropped)
    return (
        bus.name,
        bus.state,
        percent(bus.load_percent),
        frames,
        *map(str, counted),
        bus.problem or _overload(bus),
    )


def _overload(bus: BusInfo) -> str:
    """Return what its nodes then lack because of it: nothing that they send has its time."""
    load = bus.load_percent
    if load is None or load < OVERLOAD_PERCENT:
        return ""
    return (
        f"the bus is overloaded: {load:.0f} % of its time is taken, and what its nodes lack may come of that"
    )


def _is_busy(bus: BusInfo) -> bool:
    return (bus.load_percent or 0.0) >= BUSY


def _traffic(bus: BusInfo) -> str:
    """Return what takes a bus's time, the most first, with its identifiers and whose it is."""
    names = {node.node_id: ", ".join(node.components) for node in bus.nodes}
    told = [f"{_talk(talk, names)}: {talk.frames_per_s:.0f} frames/s" for talk in bus.talks[:TOLD]]
    more = len(bus.talks) - len(told)
    text = f"on {bus.name}: {'; '.join(told)}" + (f"; and {more} more" if more else "")
    return textwrap.fill(text, PAGE, subsequent_indent="  ") + "\n"


def _talk(talk: TalkInfo, names: Mapping[int, str]) -> str:
    """Return `TPDO of left_knee 0x182, 0x282`."""
    if talk.node_id is None:
        whose = "no known node" if talk.kind == OTHER else talk.kind
    else:
        to_or_of = "to" if talk.kind in TO_NODES else "of"
        whose = f"{talk.kind} {to_or_of} {names.get(talk.node_id) or f'node {talk.node_id}'}"
    more = [] if len(talk.identifiers) < NAMED else ["…"]
    return f"{whose} {', '.join([*map(identifier_text, talk.identifiers), *more])}".rstrip()


def _strangers(bus: BusInfo) -> str:
    nodes = ", ".join(map(str, bus.strangers))
    return (
        f"no table of the file has what is heard on {bus.name} as node {nodes}: "
        "give it one, or correct a node_id; gwrms scan says what it is\n"
    )


def _node(bus: BusInfo, node: NodeInfo) -> tuple[str, ...]:
    return (
        f"{bus.name} {node.node_id}",
        ", ".join(node.components),
        _ms(node.sdo_p50_ms),
        _ms(node.sdo_max_ms),
        str(node.sdo_transfers),
        str(node.sdo_timeouts),
        str(node.sdo_late),
        percent(node.pdos_missing_percent),
    )


def _emcy(part: ComponentInfo, now_ns: int) -> Iterator[tuple[str, ...]]:
    if part.emcy:
        ended = error_check(part.emcy.code) if part.emcy.active else "taken back"
        yield part.name, part.emcy.words, _age(now_ns - part.emcy.stamp_ns), ended


def _findings(robot: Description) -> Iterator[tuple[str, FindingInfo]]:
    """Yield each once: what is wrong with a node is told of it, and not again of each component on it."""
    told: set[FindingInfo] = set()
    for bus in robot.buses:
        yield from ((bus.name, one) for one in bus.findings)
        for node in bus.nodes:
            names = ", ".join(node.components)
            yield from ((f"{bus.name} node {node.node_id} ({names})", one) for one in node.findings)
            told.update(node.findings)
    for part in robot.components:
        yield from ((part.name, one) for one in part.findings or () if one not in told)


def _age(age_ns: int) -> str:
    return f"{max(0, age_ns) / 1e9:.0f} s"


def _ms(milliseconds: float | None) -> str:
    return NONE if milliseconds is None else f"{milliseconds:.1f} ms"
