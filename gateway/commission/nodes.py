"""The steps of the bus: what is on it, whose EDS each drive is, its heartbeat, how its position comes."""

from collections.abc import Mapping
from pathlib import Path

import eds
from drivers.errors import DriverError
from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library
from drivers.scan.scan import ScanResult
from eds import EdsError
from eds.shipped import SHIPPED
from gateway.commission.axes import POSITION, Axis, answered, axes_of, number
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Say, Talk, agree, choose, press, word
from gateway.commission.draft import Draft

HEARTBEAT_TIME = 0x1017
HEARTBEAT_MS = 100
ALL, AGAIN = "all", "again"
OBSERVER, MASTER = "observer", "master"


def table(node: int) -> str:
    return f"node.{node}"


def scanned(bench: Bench) -> Talk[tuple[ScanResult, dict[int, NodeAnswers]]]:
    """All that answers; asked again until there is a drive."""
    while True:
        yield Say("Listening, then asking all 127 node ids what they are …")
        try:
            found = bench.nodes()
        except DriverError as error:
            yield from press(f"{error}.")
            continue
        for node, told in sorted(found.told.items()):
            yield Say(_line(node, told))
        if found.not_asked:
            others = ", ".join(map(str, sorted(found.not_asked)))
            yield Say(
                f"Not asked, because somebody else asks them: {others}. End that program to commission them."
            )
        answered = {node: told for node, told in found.told.items() if isinstance(told, NodeAnswers)}
        if axes := axes_of(answered):
            drives = f"{len(axes)} drive" + "s" * (len(axes) > 1)
            if (yield from choose(f"{drives}. Are these all?", (ALL, AGAIN), ALL)) == ALL:
                return found, answered
            continue
        yield from press(
            "No drive has answered. Check power, CAN-H and CAN-L, both terminators, and the bit rate "
            "(gwrms scan tells what comes)."
        )


def _line(node: int, told: NodeAnswers | str) -> str:
    if isinstance(told, str):
        return f"  node {node}: {told}"
    serial = "" if told.serial_number is None else f", serial number {told.serial_number}"
    axes = f", {len(told.axes)} axes" if len(told.axes) > 1 else ""
    return f"  node {node}: {told.name or 'without a name'}{serial}{axes}"


def role(draft: Draft, found: ScanResult) -> Talk[None]:
    """Ask for the bus's master; an observed master takes precedence over an earlier choice."""
    reasons = list(found.traffic.master())
    if reasons and draft.value("gateway", "role") != OBSERVER:
        draft.put("gateway", "role", OBSERVER, f"another controller leads the bus: {', '.join(reasons)}")
        return
    if draft.has("gateway", "role"):
        return
    choice = yield from choose(
        "Nobody leads this bus now. observer: a controller will; master: this is a bench, where GWRMS "
        "starts the nodes. Neither enables a drive.",
        (OBSERVER, MASTER),
        OBSERVER,
    )
    draft.put("gateway", "role", choice, "nobody was heard to lead the bus; chosen")


def same_devices(draft: Draft, told: Mapping[int, NodeAnswers]) -> Talk[None]:
    """Forget the findings of a node that is another device now (1018h), with its joints."""
    for node, one in sorted(told.items()):
        identity = [one.vendor_id, one.product_code, one.serial_number]
        kept = draft.value(table(node), "identity", identity)
        if one.problem is not None or (kept == identity and draft.has(table(node), "identity")):
            continue
        if kept != identity:
            yield Say(f"Node {node} is another device than it was (1018h): all of it is asked again.")
            draft.forget_node(node)
        draft.put(table(node), "identity", identity)


def file_of(draft: Draft, library: Library, node: int, told: NodeAnswers) -> Talk[None]:
    """Find the EDS for this device."""
    if draft.has(table(node), "eds"):
        return
    proposals = library.proposals(node, told)
    for proposal in proposals[:1]:
        path = Path(proposal.description.path)
        for line in proposal.differs:
            yield Say(f"  {path.name}, but: {line}")
        how = "its vendor and product (1018h) are the device's"
        if not proposal.differs or (yield from agree(f"{_called(node, told)}: is {path.name} its file?")):
            draft.put(table(node), "eds", _named(path, draft), how)
            return
    typed = yield from word(
        f"{_called(node, told)}: which EDS file is for it?",
        check=lambda text: _unreadable(text, draft.file, node),
    )
    draft.put(table(node), "eds", typed, "named by hand")


def _called(node: int, told: NodeAnswers) -> str:
    numbers = f"vendor {told.vendor_id or 0:#x}, product {told.product_code or 0:#x}"
    return f"Node {node} ({told.name or 'without a name'}, {numbers})"


def _named(path: Path, draft: Draft) -> str:
    """Return it as the robot's file names it."""
    if path.parent == SHIPPED:
        return path.name
    folder = draft.file.resolve().parent
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)


def _unreadable(text: str, file: Path, node: int) -> str | None:
    try:
        eds.load(eds.locate(text, file), node)
    except EdsError as error:
        return str(error)
    return None


def heartbeat(draft: Draft, bench: Bench, node: int) -> Talk[None]:
    """Offer a heartbeat to a node that has none."""
    if draft.has(table(node), "heartbeat"):
        return
    period = yield from answered(lambda: number(bench, Axis(node), HEARTBEAT_TIME))
    if period:
        draft.put(table(node), "heartbeat", period, "ms, 1017h")
        return
    if period is None:
        draft.put(table(node), "heartbeat", None, "it has no 1017h: it is asked by SDO whether it lives")
        return
    yes = yield from agree(
        f"Node {node} sends no heartbeat (1017h is 0), so that its loss is noticed late. "
        f"Write 1017h = {HEARTBEAT_MS} ms? It changes nothing else, and is gone with its power unless stored."
    )
    if yes:
        try:
            bench.write(node, HEARTBEAT_TIME, 0, HEARTBEAT_MS.to_bytes(2, "little"))
        except DriverError as error:
            yield Say(f"It was not taken: {error}")
            yes = False
    how = "ms, 1017h was 0 and was written" if yes else "1017h is 0 and stays so"
    draft.put(table(node), "heartbeat", HEARTBEAT_MS if yes else 0, how)


def mapping(draft: Draft, bench: Bench, axis: Axis, told: NodeAnswers, joint: str) -> Talk[None]:
    """Check that its position comes in a PDO; else ask whether the gateway may map it."""
    key = f"joint.{joint}"
    if draft.has(key, "configure_pdos"):
        return
    position = axis.index(POSITION)
    carrying = [
        tpdo for tpdo in told.tpdos if tpdo.enabled and any(one.index == position for one in tpdo.objects)
    ]
    if carrying:
        draft.put(
            key,
            "configure_pdos",
            False,
            f"TPDO{carrying[0].number} brings the position {carrying[0].trigger}",
        )
        return
    yes = yield from agree(
        f"No PDO brings the position of {axis}: it would be asked for by SDO, 20 times a second. May the "
        "gateway map what it reads into disabled PDOs whenever it starts?"
    )
    stored = yes and (yield from _stored(draft, bench, axis))
    how = "mapped and stored in the drive (1010h)" if stored else "no PDO brought the position; chosen"
    draft.put(key, "configure_pdos", yes and not stored, how)


def _stored(draft: Draft, bench: Bench, axis: Axis) -> Talk[bool]:
    """Return whether the drive keeps the mapping by itself from now on."""
    yes = yield from agree(
        "Write it into the drive now instead, and store it there (1010h, with all its present settings)? "
        "Then it holds without the gateway, and after its power was off."
    )
    if not yes:
        return False
    description = eds.load(eds.locate(draft.value(table(axis.node), "eds"), draft.file), axis.node)
    try:
        done = bench.map(axis.node, axis.number, description)
    except DriverError as error:
        yield Say(f"It was not taken, or not stored, and the gateway maps it when it starts: {error}")
        return False
    yield Say(f"{axis}: {done}.")
    return True
