"""Report of a scan, in words and as JSON."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from drivers.bus.emcy import parse_emcy
from drivers.bus.settings import CanSettings
from drivers.joint.cia402 import MODES
from drivers.scan.identification import Axis, NodeAnswers
from drivers.scan.products import Proposal
from drivers.scan.scan import ScanResult
from eds.profile import profile_of
from eds.table import BUS, joint_table

_TYPES = {  # CiA 301 §7.5.2.1: the device profile, in the low half of 1000h
    0x0191: "inputs and outputs (CiA 401)",
    0x0192: "drive (CiA 402)",
    0x0194: "measuring device (CiA 404)",
    0x0195: "controller (CiA 405)",
    0x0196: "encoder (CiA 406)",
    0x019A: "inclinometer (CiA 410)",
    0x012D: "gateway (CiA 301)",
}
_DRIVES = {0x1: "frequency converter", 0x2: "servo drive", 0x4: "stepper drive", 0x8: "several axes"}
_ERRORS = ("generic", "current", "voltage", "temperature", "communication", "profile", "", "vendor's own")


def as_json(
    settings: CanSettings, found: ScanResult, proposals: Mapping[int, Sequence[Proposal]], bus: str = BUS
) -> dict[str, Any]:
    """Return everything that was found, for machines. `bus` is what a robot's file calls this one."""
    traffic = found.traffic
    return {
        "bus": {"interface": settings.interface, "channel": settings.channel, "bitrate": settings.bitrate},
        "frames_per_s": round(found.frames_per_s, 1),
        "load_percent": found.load_percent,
        "error_frames": found.error_frames,
        "state": found.state.name.lower(),
        "problem": found.trouble,
        "master": list(traffic.master()),
        "other_ids": list(traffic.others()),
        "nodes": [_node_json(node, found, proposals.get(node, ()), bus) for node in found.nodes],
    }


def _node_json(node: int, found: ScanResult, proposals: Sequence[Proposal], bus: str) -> dict[str, Any]:
    traffic, told = found.traffic, found.told.get(node)
    profile = profile_of(proposals[0].description) if proposals else None
    state = traffic.states.get(node)
    heartbeat = traffic.seen.get(0x700 + node)
    return {
        "node_id": node,
        "nmt_state": None if state is None else state.words,
        "heartbeat_s": None if heartbeat is None else heartbeat.period_s,
        "boots": traffic.boots.get(node, 0),
        "sends": {f"0x{can_id:X}": seen.period_s for can_id, seen in traffic.sends(node).items()},
        "emcy": _emcy(node, found),
        "asked_by_others": node in traffic.asked(),
        "answer": None if told is None else told if isinstance(told, str) else asdict(told),
        "eds": [{"file": str(one.description.path), "differs": list(one.differs)} for one in proposals],
        "profile": None if profile is None else profile.name,
        "table": _table(node, told, proposals, bus) if isinstance(told, NodeAnswers) else None,
    }


def _table(node: int, told: NodeAnswers, proposals: Sequence[Proposal], bus: str) -> str | None:
    """Return the table for a robot's file, by the best EDS and the device's own answers."""
    if not proposals:
        return None
    read = {(index, subindex): value for index, subindex, value in told.ratios}
    return joint_table(proposals[0].description, node, bus, read)


def as_text(
    settings: CanSettings,
    found: ScanResult,
    proposals: Mapping[int, Sequence[Proposal]],
    bus: str = BUS,
    *,
    active: bool,
) -> Iterator[str]:
    """Yield it for people: the bus in a few lines, each node, then what to paste into a robot's file."""
    traffic = found.traffic
    load = "" if found.load_percent is None else f" · {found.load_percent:.0f} % of its time"
    errors = f"{found.error_frames} error frames" if found.error_frames else "no error frames"
    yield f"{settings.interface}:{settings.channel} · {found.frames_per_s:.0f} frames/s{load} · {errors}"
    if found.trouble:
        yield f"  wrong       {found.trouble}"
    master = ", ".join(traffic.master())
    yield f"  master      {master or 'none heard: no NMT command, no SYNC, no SDO request'}"
    if others := traffic.others():
        yield f"  other ids   {', '.join(f'0x{one & 0x1FFF_FFFF:X}' for one in others)}"
    if not traffic.seen and not found.told:
        yield "  silent      nothing was sent, by anybody: check bit rate, wiring and power" + (
            "" if active else "; --active asks"
        )
    for node in found.nodes:
        yield from _node_text(node, found, proposals.get(node, ()))
    for node, told in sorted(found.told.items()):
        if isinstance(told, NodeAnswers) and (table := _table(node, told, proposals.get(node, ()), bus)):
            yield f"\nfor robot.toml\n\n{table.rstrip()}"


def _node_text(node: int, found: ScanResult, proposals: Sequence[Proposal]) -> Iterator[str]:
    traffic, told = found.traffic, found.told.get(node)
    state = traffic.states.get(node)
    heartbeat = traffic.seen.get(0x700 + node)
    life = "no heartbeat" if heartbeat is None else f"heartbeat{_every(heartbeat.period_s)}"
    yield f"node {node}: {'state unknown' if state is None else state.words}, {life}"
    if boots := traffic.boots.get(node):
        yield f"  booted      {boots} time{'s' if boots > 1 else ''} meanwhile"
    if emcy := _emcy(node, found):
        yield f"  emergency   {emcy}"
    if sent := traffic.sends(node):
        yield "  sends       " + ", ".join(f"0x{one:X}{_every(seen.period_s)}" for one, seen in sent.items())
    if node in found.not_asked:
        yield "  not asked   somebody else is asking it by SDO; stop that, and scan again"
    elif isinstance(told, str):
        yield f"  no answer   {told}"
    elif told is not None:
        yield from _told_text(told, _names(proposals))
        yield from _proposal_text(told, proposals)


def _names(proposals: Sequence[Proposal]) -> Callable[[int, int], str]:
    """Return a function that names objects, by the best-fitting file."""
    description = proposals[0].description if proposals else None

    def name(index: int, subindex: int) -> str:
        variable = None if description is None else description.variable(index, subindex)
        return f"{index:04X}:{subindex:02X}" + ("" if variable is None else f" {variable.qualname}")

    return name


def _told_text(told: NodeAnswers, name: Callable[[int, int], str]) -> Iterator[str]:
    names = [part for part in (told.name, told.hardware, told.software) if part]
    yield f"  device      {_kind(told.device_type)}{': ' if names else ''}{', '.join(names)}"
    identity = (("vendor", told.vendor_id), ("product", told.product_code), ("revision", told.revision))
    parts = [f"{name} {'unknown' if value is None else f'0x{value:X}'}" for name, value in identity]
    if told.serial_number:
        parts.append(f"serial number {told.serial_number}")
    yield f"  identity    {', '.join(parts)}"
    if told.error_register:
        yield f"  error       {_bits(told.error_register, _ERRORS)} (1001h = 0x{told.error_register:02X})"
    if told.heartbeat_ms == 0:
        yield "  heartbeat   off (1017h = 0): it is missed by nobody when it dies"
    for axis in told.axes:
        yield f"  axis {axis.number}      {_axis(axis)}"
    for tpdo in told.tpdos:
        objects = ", ".join(f"{name(one.index, one.subindex)} ({one.bits} bits)" for one in tpdo.objects)
        state = tpdo.trigger if tpdo.enabled else "disabled"
        yield f"  TPDO{tpdo.number:<7} 0x{tpdo.cob_id:X}, {state}{': ' if objects else ''}{objects}"
    if told.problem:
        yield f"  incomplete  {told.problem}"


def _proposal_text(told: NodeAnswers, proposals: Sequence[Proposal]) -> Iterator[str]:
    if not proposals:
        known = told.vendor_id is not None and told.product_code is not None
        why = "take it from its maker, and give its folder with --eds" if known else "it says not who made it"
        yield f"  EDS         none for this vendor and product: {why}"
    elif profile := profile_of(proposals[0].description):
        yield f"  profile     {profile.name}"
    for one in proposals:
        yield f"  EDS         {one.description.path}"
        yield from (f"              {text}" for text in one.differs)


def _emcy(node: int, found: ScanResult) -> str | None:
    seen = found.traffic.seen.get(0x080 + node)
    emcy = None if seen is None else parse_emcy(seen.last_ns, seen.data)
    if emcy is None or seen is None:
        return None
    told = found.told.get(node)
    return f"{emcy.text(told.vendor_id if isinstance(told, NodeAnswers) else None)} ({seen.count} of them)"


def _every(period_s: float | None) -> str:
    return " once" if period_s is None else f" every {period_s * 1000:.3g} ms"


def _kind(device_type: int) -> str:
    profile = device_type & 0xFFFF
    name = _TYPES.get(profile, f"device of profile {profile}" if profile else "device of no profile")
    drive = _DRIVES.get(device_type >> 16 & 0xFF) if profile == 0x0192 else None
    return f"{drive} (CiA 402)" if drive else name


def _axis(axis: Axis) -> str:
    motor = "" if axis.motor_type is None else f"motor type {axis.motor_type}, "
    if axis.modes is None:
        return f"{motor}modes not told"
    return f"{motor}{_bits(axis.modes, tuple(MODES.get(bit + 1, '') for bit in range(10)))}"


def _bits(value: int, names: Sequence[str]) -> str:
    return ", ".join(name for bit, name in enumerate(names) if value >> bit & 1 and name) or "nothing known"
