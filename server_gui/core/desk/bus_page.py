"""The page Bus in words: a row a sender, worst first, and the alarms that give the colours their reasons."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from gateway.wire.bus import BusInfo, NodeInfo
from server_gui.core.alarms.alarm import Alarm, Alarms
from server_gui.core.alarms.bus_alarms import bus_alarms
from server_gui.core.alarms.marks import NOT_KNOWN, STATES, Mark, age_text
from server_gui.core.alarms.texts import TEXTS, Kind
from server_gui.core.follow.missing_pdos import SOME_PERCENT, told_percent
from server_gui.core.follow.robot import FollowedComponent
from server_gui.core.processing.bus_health import BusHealthLevel, findings, node_level, of_load, rated
from server_gui.core.processing.bus_senders import Talking, kinds, talking, total, whole_numbers

UNKNOWN: Final = "–"
FEW: Final = 2  # lines of one kind
BEFORE: Final = "silent by now"  # names the frames of the last second that are of nodes without a number
FILLS: Final = "most of the load"
SILENT: Final = frozenset({"lost", "stale"})
GONE: Final = frozenset({Kind.LOST, Kind.PART_STALE})  # alarms about parts that are silent
FOR_NOW: Final = "for now"  # PDOs are missing: it is told of the node if that lasts
UNANSWERED: Final = Mark("triangle", "warn", "no SDO answer")
FEW_PDOS: Final = Mark("cross", "warn", "PDOs missing")  # as a gap of a recording; ▲ has a confirmed STOP
_HEARTBEAT: Final = re.compile(r"heartbeat has been missing for (\d+(?:\.\d+)? \w+)")
_WORST: Final = ("bad", "warn")


@dataclass(frozen=True, slots=True)
class Row:
    """One sender; `frames` is how many a second, or for how long it has been silent."""

    node: str
    name: str
    mark: Mark | None  # None: of what is no node
    share: str
    frames: str
    sends: str
    trips: str
    unanswered: str
    missing: str
    ids: str = ""  # of what is not one of the robot's nodes: its identifiers

    @property
    def colour(self) -> str:
        """Name its colour."""
        return self.mark.colour if self.mark is not None and self.mark.colour in (*_WORST, "old") else "text"


def rows(bus: BusInfo, parts: Mapping[str, FollowedComponent], alarms: Alarms, *, live: bool) -> list[Row]:
    """Return the senders of a bus, worst first; the numbers add up to those of the bus."""
    senders = talking(bus)
    by_node = {one.node_id: one for one in senders if one.node_id is not None}
    nodes = {node.node_id: node for node in bus.nodes}
    silent = {
        node.node_id: words
        for node in bus.nodes
        if (words := _silence(node, parts, alarms, by_node.get(node.node_id)))
    }
    loud = [one for one in senders if one.node_id not in silent]
    before = sum(one.frames_per_s for one in senders if one.node_id in silent)
    rates = [one.frames_per_s for one in loud] + [before] * bool(before)
    numbers = whole_numbers(rates, total(bus) or 0.0)
    made = []
    for talk, number in zip(loud, numbers, strict=False):
        node = nodes.get(-1 if talk.node_id is None else talk.node_id)
        row = _row(talk.node_id, node, talk, str(number), _mark(node, talk, alarms, live=live))
        made.append(_blamed(row, bus) if talk is senders[0] else row)
    for node_id, node in nodes.items():
        if node_id in silent or node_id not in by_node:
            words = silent.get(node_id, UNKNOWN)
            made.append(_row(node_id, node, None, words, _mark(node, None, alarms, live=live)))
    made.sort(key=_order)
    if before:
        share = f"{100 * before / (total(bus) or before):.0f} %"
        made.append(_nameless(BEFORE, share, str(numbers[-1]), ""))
    return made


def told_kinds(bus: BusInfo) -> list[str]:
    """Return each kind of frames, how many a second, and their share of all: `TPDO 1527 (59 %)`."""
    found, whole = kinds(bus), total(bus) or 0.0
    numbers = whole_numbers([rate for _, rate in found], whole)
    return [
        f"{kind} {number} ({100 * rate / whole:.0f} %)"
        for (kind, rate), number in zip(found, numbers, strict=True)
        if whole
    ]


def lines(buses: Sequence[BusInfo], alarms: Alarms) -> list[tuple[bool, str]]:
    """Return the lines of the alarms about buses and what is on them, worst first: is it bad, and what.

    What another alarm explains has a line, too, many nodes one: each colour of a row has its reason here.
    """
    about = _about(buses)
    told = {alarm.subject for alarm in alarms.each}
    made = (one for bus in buses if f"bus.{bus.name}" not in told for one in bus_alarms(bus))
    tops = [*(one.alarm for one in alarms.active), *made]
    found: dict[str, bool] = {}
    for top in sorted(tops, key=lambda alarm: alarm.rank):
        under = [one for one in top.under if one.subject in about]
        if top.subject in about or under:
            found.setdefault(top.line, top.mark.colour == "bad")
        found.update({line: bad for bad, line in _explained(under) if line not in found})
    return [(bad, line) for line, bad in found.items()]


def _explained(under: Sequence[Alarm]) -> list[tuple[bool, str]]:
    """Return the lines of what an alarm explains: of a bus its own, of many nodes one a kind."""
    by_word: dict[str, list[Alarm]] = {}
    for alarm in under:
        by_word.setdefault(alarm.mark.word, []).append(alarm)
    found = []
    for word, each in by_word.items():
        bad = any(one.mark.colour == "bad" for one in each)
        if len(each) > FEW and not each[0].subject.startswith("bus."):
            found.append((bad, f"{word}: {', '.join(one.spoken for one in each)}"))
        else:
            found += [(bad, one.line) for one in each]
    return found


def checks(buses: Sequence[BusInfo], alarms: Alarms) -> list[str]:
    """Return what to check about those lines, each once."""
    about = _about(buses)
    found = [one.check for one in alarms.each if one.subject in about and not one.subject.startswith("bus.")]
    found += [check for bus in buses for _, check in findings(bus)]
    return [*dict.fromkeys(filter(None, found))]


def _about(buses: Iterable[BusInfo]) -> set[str]:
    """Return the subjects of alarms about these buses and what is on them."""
    return {
        subject
        for bus in buses
        for subject in (f"bus.{bus.name}", *(name for node in bus.nodes for name in node.components))
    }


def _silence(
    node: NodeInfo, parts: Mapping[str, FollowedComponent], alarms: Alarms, talk: Talking | None
) -> str | None:
    """Return for how long a node has been silent, or its heartbeat missing; None where it is not.

    Others may miss it, and an alarm say so, before the robot does.
    """
    known = [parts[name] for name in node.components if name in parts]
    missed = {alarm.subject for alarm in alarms.each if alarm.kind in GONE}
    gone = [one for one in known if one.state in SILENT or one.name in missed]
    heart = next((found[1] for one in gone if (found := _HEARTBEAT.search(one.problem or ""))), None)
    if heart is not None:
        return f"silent {heart}" if talk is None else f"no heartbeat {heart}"
    if not gone or len(gone) < len(known) or talk is not None:
        return None
    ages = [one.age_ms for one in gone if one.age_ms is not None]
    return f"silent {age_text(min(ages) / 1000)}" if ages else "silent"


def _mark(node: NodeInfo | None, talk: Talking | None, alarms: Alarms, *, live: bool) -> Mark | None:
    """Return the state of a node: of its worst alarm, else of what is found of it on the bus."""
    if node is None:
        return None
    told = [one for one in alarms.each if one.subject in node.components and one.mark.colour in _WORST]
    worst = min(told, key=lambda one: one.rank, default=None)
    if worst is not None:
        return worst.mark
    if node_level(node) is not BusHealthLevel.GOOD:
        return _found(node)
    is_known = talk is not None or node.sdo_p50_ms is not None
    return STATES["ok"] if live and is_known else NOT_KNOWN


def _found(node: NodeInfo) -> Mark:
    if any("no SDO" in one.words for one in node.findings):
        return UNANSWERED
    return FEW_PDOS if told_percent(node) else TEXTS[Kind.REPORTS].mark


def _row(
    node_id: int | None, node: NodeInfo | None, talk: Talking | None, frames: str, mark: Mark | None
) -> Row:
    share = UNKNOWN if talk is None else f"{100 * talk.share:.0f} %"
    sends = "" if talk is None else ", ".join(f"{kind} {rate:.0f}/s" for kind, rate in talk.kinds)
    if node is None:
        return _nameless(
            "not in the file" if node_id is not None else (talk.who if talk else ""),
            share,
            frames,
            "" if node_id is None else str(node_id),
            sends if node_id is not None else "",
            "" if talk is None else talk.ids,
        )
    names = ", ".join(name.replace("_", " ") for name in node.components)
    is_silent = frames != UNKNOWN and not frames.isdigit()
    if mark is not None and "silent" in mark.word:
        frames = frames.replace("silent ", "for ")  # its state says so already
    trips = UNKNOWN
    if node.sdo_p50_ms is not None and not is_silent:
        trips = f"{node.sdo_p50_ms:.1f} / {node.sdo_max_ms or 0.0:.1f} ms"
    percent = told_percent(node) or node.pdos_missing_percent  # what is told of it stands in its row, too
    is_known = percent is not None and not is_silent and (percent > 0.0 or talk is not None)
    missing = f"{percent:.1f} %" if is_known else UNKNOWN
    if is_known and percent is not None and percent >= SOME_PERCENT and not told_percent(node):
        missing = f"{missing}, {FOR_NOW}"
    return Row(str(node_id), names, mark, share, frames, sends, trips, str(node.sdo_timeouts), missing)


def _nameless(name: str, share: str, frames: str, node: str, sends: str = "", ids: str = "") -> Row:
    return Row(node or UNKNOWN, name, None, share, frames, sends, UNKNOWN, UNKNOWN, UNKNOWN, ids)


def _blamed(row: Row, bus: BusInfo) -> Row:
    """Mark the largest sender of a bus with too much load, where nothing worse is known of it."""
    load = next((one for one in rated(bus) if of_load(one)), None)
    if load is None or row.colour in _WORST:
        return row
    is_full = load[0] is BusHealthLevel.ALARM
    return replace(row, mark=Mark(*(("square", "bad") if is_full else ("triangle", "warn")), FILLS))


def _order(row: Row) -> tuple[int, bool, bool, float, bool, int]:
    """Order the worst first; of equals what fills the bus, who is silent, then the largest share."""
    bad = _WORST.index(row.colour) if row.colour in _WORST else len(_WORST)
    share = 0.0 if row.share == UNKNOWN else float(row.share.removesuffix(" %"))
    fills = row.mark is not None and row.mark.word == FILLS
    is_silent = row.frames != UNKNOWN and not row.frames.isdigit()
    return bad, not fills, not is_silent, -share, row.node == UNKNOWN, _number(row.node)


def _number(node: str) -> int:
    return 0 if node == UNKNOWN else int(node)
