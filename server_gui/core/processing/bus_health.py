"""Health of a robot's CAN buses: alarms, warnings, and the load of each sender."""

import re
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from typing import Final

from gateway.client import ConnectionState
from gateway.wire.bus import CLOSED, BusInfo, NodeInfo
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.follow.missing_pdos import told_percent, told_words
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.bus_senders import fewer, talking

ACTIVE: Final = "error active"
OFF: Final = "bus off"
FULL_PERCENT: Final = 95.0  # of its time: hardly a frame more has room
TAKEN: Final = "of its time is taken"
BUSY_PERCENT, NO_MORE_PERCENT = 80.0, 70.0  # as the gateway finds it: from, until
OLD_S: Final = 5.0  # what was seen before is not known now
UNKNOWN: Final = "bus not known"
NO_ANSWER: Final = "no SDO"  # in the words for a node that does not answer
FEW: Final = 2  # nodes that are named one by one, also where all of them are meant
GROWS: Final = re.compile(r", \d+ requests in a row")  # a count of one look, which the bus's page alone has
NUMBER: Final = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])")


class BusHealthLevel(Enum):
    """Severity; unknown is none of the others."""

    GOOD = "ok"
    UNKNOWN = "not known"
    WARNING = "warning"
    ALARM = "alarm"


ORDER: Final = tuple(BusHealthLevel)
Rated = tuple[BusHealthLevel, str, str]  # how bad, what, and what to check


def seen(robot: Robot) -> tuple[BusInfo, ...] | None:
    """Return the buses as they are now; None where that is not known."""
    linked = robot.link.state is ConnectionState.CONNECTED
    if robot.buses is None or robot.buses_at_ns is None or not linked:
        return None
    old = now_ns() - robot.buses_at_ns > OLD_S * 1e9
    return None if old else robot.buses


def level(bus: BusInfo) -> BusHealthLevel:
    """Return how bad a bus is."""
    if bus.state in (CLOSED, OFF) or _nobody_answers(bus) or (bus.load_percent or 0.0) >= FULL_PERCENT:
        return BusHealthLevel.ALARM
    if bus.state != ACTIVE or (bus.load_percent or 0.0) >= BUSY_PERCENT or bus.findings or bus.problem:
        return BusHealthLevel.WARNING
    of_nodes = max((node_level(node) for node in bus.nodes), key=ORDER.index, default=BusHealthLevel.GOOD)
    return (
        BusHealthLevel.UNKNOWN if of_nodes is BusHealthLevel.GOOD and bus.load_percent is None else of_nodes
    )


def node_level(node: NodeInfo) -> BusHealthLevel:
    """Return how bad a node is."""
    return BusHealthLevel.WARNING if node.findings or _misses(node) else BusHealthLevel.GOOD


def load_text(bus: BusInfo) -> str:
    """Return the share of a bus's time that is taken."""
    return "–" if bus.load_percent is None else f"{min(bus.load_percent, 100.0):.0f} %"


def errors_text(bus: BusInfo) -> str:
    """Return its error counters in words."""
    count = "1 error" if bus.error_frames == 1 else f"{bus.error_frames} errors"
    return count if not bus.bus_offs else f"{count}, {bus.bus_offs} × bus off"


def worst(robot: Robot) -> tuple[BusHealthLevel, tuple[str, ...]]:
    """Return the worst bus in one line, the fullest wording first."""
    buses = seen(robot)
    if buses is None:
        return BusHealthLevel.UNKNOWN, (UNKNOWN, "CAN –")
    if not buses:
        return BusHealthLevel.UNKNOWN, ("no CAN bus", "no bus")
    bus = max(buses, key=lambda one: (ORDER.index(level(one)), one.load_percent or 0.0))
    load = f"CAN {bus.name} {load_text(bus)}"
    if bus.load_percent is None and level(bus) is BusHealthLevel.UNKNOWN:
        return BusHealthLevel.UNKNOWN, (f"CAN {bus.name} –", "CAN –")
    most = next(iter(talking(bus)), None)
    who = "" if most is None else f" · {most.said}"
    if (why := reason(bus)) is not None:
        why = tuple(one.removesuffix(f": {load_text(bus)} {TAKEN}") for one in why)
        said = [f"{load}, {errors_text(bus)}: {why[0]}{who}", *(f"{load}: {one}" for one in why)]
        return level(bus), (*said, f"CAN {load_text(bus)}: {why[-1]}")
    said = [f"{load}, {errors_text(bus)}{who}", f"{load}, {errors_text(bus)}"]
    return level(bus), tuple(dict.fromkeys((*said, f"CAN {load_text(bus)}, {errors_text(bus)}")))


def trouble(bus: BusInfo) -> tuple[str, str] | None:
    """Return a bus's problems, and what to check if that is known; None if there are none."""
    return joined(rated(bus))


def joined(found: Iterable[Rated]) -> tuple[str, str] | None:
    """Return what is wrong, and what to check, in one; None of nothing."""
    told = list(found)
    said = _joined(GROWS.sub("", words) for _, words, _ in told)
    return (said, _joined(check for _, _, check in told)) if told else None


def of_load(one: Rated) -> bool:
    """Return whether it is the load of a bus: it begins and ends by itself."""
    return one[1].endswith(TAKEN)


def findings(bus: BusInfo) -> list[tuple[str, str]]:
    """Return each thing that is wrong with a bus, and what to check; what several nodes have, once."""
    return [(words, check) for _, words, check in rated(bus)]


def rated(bus: BusInfo) -> list[Rated]:
    """Return each thing that is wrong with a bus: how bad that is by itself, and what to check."""
    if level(bus) in (BusHealthLevel.GOOD, BusHealthLevel.UNKNOWN):
        return []
    load, full = bus.load_percent or 0.0, []
    is_known = bus.load_percent is not None  # else what the gateway found a moment ago is all there is
    own = [one for one in bus.findings if not (is_known and one.words.endswith(TAKEN))]
    if len(own) < len(bus.findings) or load >= BUSY_PERCENT:
        said = "it is full" if load >= FULL_PERCENT else "it is busy"
        said += f", until below {NO_MORE_PERCENT:.0f} %" if is_known and load < BUSY_PERCENT else ""
        full = [(f"{said}: {load_text(bus)} {TAKEN}", fewer(bus))]
    warning, alarm = BusHealthLevel.WARNING, BusHealthLevel.ALARM
    of_state, of_load = (
        alarm if bad else warning for bad in (bus.state in (CLOSED, OFF), load >= FULL_PERCENT)
    )
    gathered = _gathered(bus.nodes)
    told = [
        (of_state, bus.problem or "", ""),
        (of_state, bus.state if bus.state != ACTIVE else "", ""),
        *((of_load, *one) for one in full),
        *((warning, one.words, one.check) for one in own),
        *((alarm if _nobody_answers(bus) and NO_ANSWER in one[0] else warning, *one) for one in gathered),
    ]
    return [one for one in told if one[1]]


def reason(bus: BusInfo) -> tuple[str, ...] | None:
    """Return why a bus is not as it should be, the fullest wording first; None: it is."""
    said = trouble(bus)
    if said is None:
        return None
    load = bus.load_percent or 0.0
    short = {
        "no answer": any(map(_is_silent, bus.nodes)),
        "PDOs missing": any(_misses(node) for node in bus.nodes),
        "findings": bool(bus.findings),
        "not read in time": any("stood still" in one.words for one in bus.findings),
        "errors": any("error" in one.words for one in bus.findings),
        "busy": any(map(of_load, rated(bus))),
        "full": load >= FULL_PERCENT,
        bus.state: bus.state != ACTIVE,
        "it fails": bus.problem is not None,
    }
    first = said[0].partition("; ")[0]
    return first, next((word for word, so in reversed(short.items()) if so), "a node is in trouble")


def _joined(texts: Iterable[str]) -> str:
    return "; ".join(dict.fromkeys(filter(None, texts)))


def _is_silent(node: NodeInfo) -> bool:
    return any(NO_ANSWER in one.words for one in node.findings)


def _nobody_answers(bus: BusInfo) -> bool:
    """Return whether several nodes are asked, and all are silent: then it is the bus."""
    asked = [node for node in bus.nodes if node.sdo_transfers or node.sdo_timeouts or node.findings]
    return len(asked) > 1 and all(map(_is_silent, asked))


def _misses(node: NodeInfo) -> bool:
    return told_percent(node) > 0.0


def _gathered(nodes: Sequence[NodeInfo]) -> Iterator[tuple[str, str]]:
    """Yield the nodes' findings, equal ones in one: `all 6 nodes: 3–4 % of their PDOs are missing`."""
    same: dict[tuple[str, str], list[tuple[NodeInfo, str]]] = {}
    for node in nodes:
        said = [(one.words, one.check) for one in node.findings]
        if not said and _misses(node):
            said = [told_words(node)]
        for words, check in said:
            same.setdefault((NUMBER.sub("#", words), check), []).append((node, words))
    for (_, check), found in same.items():
        said_of = [words if len(found) == 1 else _of_several(words) for _, words in found]
        yield f"{_whose([node for node, _ in found], nodes)}: {_spread(said_of)}", check


def _of_several(words: str) -> str:
    """Return what is said of one node for several."""
    return re.sub(r"^it answers\b", "they answer", words.replace(" its ", " their "))


def _whose(found: Sequence[NodeInfo], nodes: Sequence[NodeInfo]) -> str:
    """Those nodes by their names; many of them by the fewer that are not among them, or by their number."""
    others = [node for node in nodes if node not in found]
    if not others and len(found) > FEW:
        return f"all {len(nodes)} nodes"
    if len(found) <= FEW + 1:
        return ", ".join(map(_who, found))
    if len(others) <= FEW:
        return f"all nodes but {', '.join(map(_who, others))}"
    return f"{', '.join(map(_who, found[:FEW]))} and {len(found) - FEW} more nodes"


def _spread(texts: Sequence[str]) -> str:
    """Texts that differ in their numbers as one, with the least and the most of each: `3–4 % are missing`."""
    numbers = zip(*(NUMBER.findall(text) for text in texts), strict=True)
    ends = [(min(each, key=float), max(each, key=float)) for each in numbers]
    spans = iter([low if low == high else f"{low}–{high}" for low, high in ends])
    return NUMBER.sub(lambda _: next(spans), texts[0])


def _who(node: NodeInfo) -> str:
    return ", ".join(name.replace("_", " ") for name in node.components) or f"node {node.node_id}"
